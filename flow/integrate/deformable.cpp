#include "flow/integrate/deformable.h"

#include <limits>

#include "geometry/base/check.h"
#include "geometry/mesh/weld.h"

namespace effuse::flow {

void HungSurface::gather(std::span<const Vec3> of_points, std::vector<Vec3>& out) const {
  out.assign(size(), Vec3::Zero());
  for (std::size_t q = 0; q < size(); ++q)
    for (Index k = first[q]; k < first[q + 1]; ++k) out[q] += weight[k] * of_points[point[k]];
}

void HungSurface::scatter(std::span<const Vec3> of_vertices, std::span<Vec3> to_points) const {
  CHECK_EQ(of_vertices.size(), size());
  for (std::size_t q = 0; q < size(); ++q)
    for (Index k = first[q]; k < first[q + 1]; ++k) to_points[point[k]] += weight[k] * of_vertices[q];
}

std::vector<Vec3> OwedImpulses::as_forces(Real dt, std::span<const Vec3> others) const {
  std::vector<Vec3> forces(others.begin(), others.end());
  if (impulses_.empty()) return forces;
  forces.resize(impulses_.size(), Vec3::Zero());
  for (std::size_t i = 0; i < forces.size(); ++i) forces[i] += impulses_[i] / dt;
  return forces;
}

HungSurface hang(std::span<const Vec3> places, std::span<const geometry::Triangle> triangles, std::span<const Index> first, std::span<const Index> point, std::span<const Real> weight) {
  CHECK_EQ(first.size(), places.size() + 1);
  CHECK_EQ(point.size(), weight.size());
  constexpr Index kUnused = std::numeric_limits<Index>::max();
  const std::vector<Index> same = geometry::first_coincident(places);
  std::vector<Index> number(places.size(), kUnused);
  HungSurface surface;
  for (const geometry::Triangle& t : triangles) {
    const geometry::Triangle merged{same[t[0]], same[t[1]], same[t[2]]};
    if (merged[0] == merged[1] || merged[1] == merged[2] || merged[2] == merged[0]) continue;
    surface.triangles.push_back(merged);
    for (const Index v : merged) number[v] = 0;
  }
  for (std::size_t q = 0; q < places.size(); ++q) {
    if (number[q] == kUnused) continue;
    number[q] = static_cast<Index>(surface.size());
    Real sum = 0;
    for (Index k = first[q]; k < first[q + 1]; ++k) sum += weight[k];
    for (Index k = first[q]; k < first[q + 1]; ++k) {
      if (weight[k] == 0) continue;
      surface.point.push_back(point[k]);
      surface.weight.push_back(weight[k] / sum);
    }
    surface.first.push_back(static_cast<Index>(surface.point.size()));
  }
  for (geometry::Triangle& t : surface.triangles)
    for (Index& v : t) v = number[v];
  return surface;
}

}  // namespace effuse::flow
