#include "samples/study/validation/stack.h"

#include <numeric>

namespace effuse::study {

using namespace flow::sph;

Stack::Stack(int layers, Real dx) : layers_(layers), dx_(dx), period_(Vec2::Constant(kAcross * dx)) {
  for (int k = 0; k < layers; ++k)
    for (int j = 0; j < kAcross; ++j)
      for (int i = 0; i < kAcross; ++i) x_.push_back(dx * Vec3(i + 0.5, j + 0.5, -(k + 0.5)));
  sky_.assign(x_.size(), 0);
  // Neighbours over the borders: images, then their originals' numbers.
  std::vector<Vec3> all = x_;
  std::vector<Index> original(x_.size());
  std::iota(original.begin(), original.end(), Index{0});
  const Real support = kSupport * dx;
  for (int axis = 0; axis < 2; ++axis) {
    const std::size_t now = all.size();
    for (std::size_t i = 0; i < now; ++i)
      for (const Real shift : {period_[axis], -period_[axis]}) {
        Vec3 y = all[i];
        y[axis] += shift;
        if (y[axis] <= -support || y[axis] >= period_[axis] + support) continue;
        all.push_back(y);
        original.push_back(original[i]);
      }
  }
  ColumnGrid grid;
  grid.build(all, support);
  neighbors_.find(grid, support);
  for (std::size_t i = 0; i < x_.size(); ++i)
    for (const Index& j : neighbors_[i]) const_cast<Index&>(j) = original[j];
}

HeatBudget Stack::step(Heat& heat, Real dt) const {
  return heat.step(dt, {.x = x_, .neighbors = neighbors_, .kernel = KernelKind::kWendlandC2, .support = kSupport * dx_, .period = period_,
                        .sky_area = sky_, .ground_area = {}, .ground_temperature = {}, .dissipation = {}});
}

Curve Stack::profile(const Heat& heat) const {
  Curve curve;
  for (const Heat::Level& level : heat.profile(0)) {
    curve.x.push_back(level.depth);
    curve.y.push_back(level.temperature);
  }
  for (int k = curve.x.empty() ? 0 : 1; k < layers_; ++k) {
    curve.x.push_back(depth_of_layer(k));
    curve.y.push_back(heat.temperature()[static_cast<std::size_t>(k) * kAcross * kAcross]);
  }
  return curve;
}

}  // namespace effuse::study
