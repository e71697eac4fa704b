#include "skin/preview/glow_field.h"

#include <array>
#include <map>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {

/// Glowing triangles of one cube of space, as one source.
struct Patch {
  Vec3f position = Vec3f::Zero();  ///< mean by flux
  Vec3f flux = Vec3f::Zero();      ///< sum of radiance * area [m^2]
  float area = 0;
};

/// At most a few hundred patches: cubes of a fortieth of the lava's extent, larger when that is too many.
std::vector<Patch> make_patches(std::span<const Vec3f> positions, std::span<const geometry::Triangle> triangles,
                                std::span<const Vec3f> glow, const Eigen::AlignedBox3f& box) {
  constexpr std::size_t kMost = 400;
  for (float cube = std::max(box.sizes().maxCoeff() / 40, 1e-3f);; cube *= 1.3f) {
    std::map<std::array<int, 3>, Patch> patches;  // ordered: the sum over patches has one order
    for (const geometry::Triangle& t : triangles) {
      const Vec3f radiance = (glow[t[0]] + glow[t[1]] + glow[t[2]]) / 3;
      if (luminance(radiance) < 1e-4f) continue;
      const Vec3f &a = positions[t[0]], &b = positions[t[1]], &c = positions[t[2]];
      const float area = 0.5f * (b - a).cross(c - a).norm();
      const Vec3f centre = (a + b + c) / 3, at = (centre - box.min()) / cube;
      Patch& patch = patches[{static_cast<int>(at.x()), static_cast<int>(at.y()), static_cast<int>(at.z())}];
      patch.flux += area * radiance;
      patch.position += area * luminance(radiance) * centre;
      patch.area += area;
    }
    if (patches.size() > kMost) continue;
    std::vector<Patch> list;
    for (auto& [key, patch] : patches) {
      patch.position /= luminance(patch.flux);
      list.push_back(patch);
    }
    return list;
  }
}

}  // namespace

GlowField::GlowField(std::span<const Vec3f> positions, std::span<const geometry::Triangle> triangles, std::span<const Vec3f> glow,
                     const Surroundings& surroundings) {
  ZONE("preview.glow_field");
  Eigen::AlignedBox3f box;
  for (const geometry::Triangle& t : triangles)
    for (const Index v : t) box.extend(positions[v]);
  if (box.isEmpty()) return;
  const std::vector<Patch> patches = make_patches(positions, triangles, glow, box);
  if (patches.empty()) return;
  float flux = 0;
  for (const Patch& patch : patches) flux += luminance(patch.flux);

  // Out to where all of it in one place would add two hundredths.
  constexpr float kFaint = 0.02f;
  constexpr int kAcross = 112;
  const float reach = std::sqrt(flux / (static_cast<float>(kPi) * kFaint));
  const float margin = std::min(reach, 8 * box.sizes().head<2>().maxCoeff());
  const Eigen::Vector2f size = box.sizes().head<2>().array() + 2 * margin;
  cell_ = size.maxCoeff() / kAcross;
  nx_ = static_cast<int>(size.x() / cell_) + 2;
  ny_ = static_cast<int>(size.y() / cell_) + 2;
  x0_ = box.min().x() - margin;
  y0_ = box.min().y() - margin;
  cells_.resize(static_cast<std::size_t>(nx_) * static_cast<std::size_t>(ny_));

  parallel_for(
      cells_.size(),
      [&](std::size_t k) {
        const int i = static_cast<int>(k) % nx_, j = static_cast<int>(k) / nx_;
        const float x = x0_ + cell_ * static_cast<float>(i), y = y0_ + cell_ * static_cast<float>(j);
        const Vec3f p(x, y, surroundings.ground_height(x, y) + 0.4f * cell_);
        // Each patch a disc seen from p: L A / (pi d^2 + A) tends to L near it and to L A / (pi d^2) far away. How much of
        // it p faces is not known at this coarseness: half.
        const auto light_of = [&](const Patch& patch) {
          const float d2 = (patch.position - p).squaredNorm();
          return Vec3f(0.5f * patch.flux / (static_cast<float>(kPi) * d2 + patch.area + cell_ * cell_));
        };
        // Ground between hides a patch. Asked for those that matter: a thirtieth of the whole each.
        Vec3f all = Vec3f::Zero();
        for (const Patch& patch : patches) all += light_of(patch);
        const float matters = 0.03f * luminance(all);
        Cell& cell = cells_[k];
        for (const Patch& patch : patches) {
          const Vec3f light = light_of(patch);
          const Vec3f to = patch.position + Vec3f(0, 0, 0.4f * cell_);
          if (luminance(light) > matters && surroundings.hidden(p, to)) continue;
          cell.light += light;
          cell.direction += luminance(light) * (to - p).normalized();
        }
        // Fade at the grid's border, so that its edge does not show.
        const float border = static_cast<float>(std::min({i, j, nx_ - 1 - i, ny_ - 1 - j})) / (0.1f * kAcross);
        cell.light *= smooth(0, 1, border);
      },
      64);
}

Vec3f GlowField::operator()(const Vec3f& p, const Vec3f& n) const {
  const float gx = (p.x() - x0_) / cell_, gy = (p.y() - y0_) / cell_;
  if (cells_.empty() || !(gx >= 0 && gy >= 0 && gx < static_cast<float>(nx_ - 1) && gy < static_cast<float>(ny_ - 1))) return Vec3f::Zero();
  const int i = static_cast<int>(gx), j = static_cast<int>(gy);
  const float u = gx - static_cast<float>(i), v = gy - static_cast<float>(j);
  const Cell* row = cells_.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(nx_) + i;
  const float w00 = (1 - u) * (1 - v), w10 = u * (1 - v), w01 = (1 - u) * v, w11 = u * v;
  const Vec3f light = w00 * row[0].light + w10 * row[1].light + w01 * row[nx_].light + w11 * row[nx_ + 1].light;
  const Vec3f direction = w00 * row[0].direction + w10 * row[1].direction + w01 * row[nx_].direction + w11 * row[nx_ + 1].direction;
  // Light from a wide source wraps around: a surface that leans away still sees part of it.
  const float length = direction.norm(), facing = length > 1e-9f ? n.dot(direction) / length : 0;
  return light * saturate((facing + 0.35f) / 1.35f);
}

}  // namespace effuse::skin
