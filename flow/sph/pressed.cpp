#include "flow/sph/pressed.h"

namespace effuse::flow::sph {

void Pressed::respond(std::span<const Vec3> impulses, std::vector<Vec3>& points, std::vector<Vec3>& on_vertices) const {
  const std::span<const std::uint8_t> held = solid->held();
  std::vector<Vec3> of_points(held.size(), Vec3::Zero());
  solid->surface().scatter(impulses, of_points);
  for (std::size_t i = 0; i < held.size(); ++i)
    if (held[i]) of_points[i].setZero();
  points.resize(held.size());
  answer.solve(of_points, points);
  solid->surface().gather(points, on_vertices);
}

void Pressed::add(Real factor, std::span<const Vec3> points, std::span<const Vec3> on_vertices) {
  for (std::size_t i = 0; i < points.size(); ++i) velocity[i] += factor * points[i];
  for (std::size_t q = 0; q < on_vertices.size(); ++q) vertices[q] += factor * on_vertices[q];
}

std::vector<Vec3> Pressed::impulses() const {
  const std::span<const std::uint8_t> held = solid->held();
  std::vector<Vec3> change(held.size()), all(held.size());
  for (std::size_t i = 0; i < change.size(); ++i) change[i] = held[i] ? Vec3(Vec3::Zero()) : Vec3(velocity[i] - free[i]);
  answer.multiply(change, all);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (held[i]) all[i].setZero();
  return all;
}

}  // namespace effuse::flow::sph
