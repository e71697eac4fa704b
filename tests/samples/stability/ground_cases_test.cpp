#include "geometry/terrain/terrain.h"
#include "samples/study/validation/setups.h"
#include "tests/samples/stability/hard_case.h"

/// Lava on ground that is hard to stand on.
namespace effuse::stability {

using flow::sph::ModernLava;
using flow::sph::ModernOptions;
using geometry::Terrain;
using geometry::TriMesh;

namespace {

/// Heights at the corners of an n x n grid of cells of side `cell`, from the origin.
template <class Height>
Terrain grid(int n, Real cell, const Height& height, const Vec2& corner = Vec2::Zero()) {
  std::vector<Real> z;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) z.push_back(height(i, j));
  return Terrain::from_height_field(geometry::HeightField(corner, Vec2(cell, cell), n, n, std::move(z)));
}

/// A strip of ground along y through these points of the xz plane, from left to right.
Terrain strip(const std::vector<Vec2>& profile, Real width = 4) {
  TriMesh mesh;
  for (const Vec2& p : profile)
    for (const Real y : {-width / 2, width / 2}) mesh.positions.emplace_back(p.x(), y, p.y());
  for (Index k = 0; k + 1 < profile.size(); ++k) {
    const Index a = 2 * k;
    mesh.triangles.push_back({a, a + 2, a + 3});
    mesh.triangles.push_back({a, a + 3, a + 1});
  }
  return Terrain::from_mesh(std::move(mesh));
}

/// A block of lava falls on it for two seconds; nothing gets into the ground, or goes faster than its height gives.
std::string fall(const std::string& name, const Terrain& ground, const Vec3& from, bool guarded, Real dx = 0.1, Real height = 2) {
  const Real scale = dx / 0.1;
  ModernOptions o = study::isothermal(dx, 300 * std::pow(scale, 1.5));
  o.max_step = 0.05 * std::sqrt(scale);
  o.min_step = 1e-6 * std::sqrt(scale);
  o.rest_period = 0;
  o.ground_speed = 0;
  o.guards.projection = guarded;
  const auto source = [&](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) { ground.contacts(x, reach, out); };
  ModernLava lava(o, {}, {source}, [&](const Vec3& x) { return ground.height(x.x(), x.y()).has_value(); });
  const std::vector<Vec3> x = study::block(from, {6, 6, 6}, dx);
  const Real down = std::sqrt(2 * kGravity * height);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3(0, 0, -0.5 * down)), std::vector<Real>(x.size(), 1400));
  LavaBounds b;
  b.speed = 1.6 * std::hypot(down, 0.5 * down) + kGravity * 2 * std::sqrt(scale);  // and on, where it falls off the edge
  b.clearance = [&](const Vec3& p) {
    const geometry::Contact c = ground.contact(p, 3 * dx);
    return c.any() ? c.distance : 3 * dx;
  };
  b.least_clearance = 0.1 * dx;
  return run_lava(name, lava, 2 * std::sqrt(scale), o.max_step, b);
}

/// Two flat levels of a grid of 25 cm, n cells apart.
Terrain plain_with(int from, int to, Real level, const Vec2& corner = Vec2::Zero()) {
  return grid(33, 0.25, [=](int i, int j) { return i >= from && i <= to && j >= from && j <= to ? level : 0; }, corner);
}

}  // namespace

std::vector<HardCase> ground_cases() {
  std::vector<HardCase> cases;
  const auto add = [&](const std::string& name, const Terrain& ground, const Vec3& from, Real dx = 0.1, Real height = 2) {
    cases.push_back({name, "projection", [=](bool guarded) { return fall(name, ground, from, guarded, dx, height); }});
  };
  // 2 m in 3.5 cm: 89 degrees.
  add("cliff-of-89-degrees", strip({{-3, 2}, {0, 2}, {0.035, 0}, {3, 0}}), Vec3(-0.3, -0.3, 2.2));
  add("overhang", strip({{-3, 0}, {1, 0}, {1.2, 0.6}, {0, 1}, {0, 1.2}, {3, 1.2}}), Vec3(-0.3, -0.3, 1.7));
  add("knife-ridge", strip({{-3, 0}, {-0.02, 1.5}, {0.02, 1.5}, {3, 0}}), Vec3(-0.3, -0.3, 1.7));
  add("pit-one-cell-wide", plain_with(16, 16, -2), Vec3(3.7, 3.7, 0.2));
  add("needle-one-post-high", plain_with(16, 16, 3), Vec3(3.7, 3.7, 3.2), 0.1, 4);
  {
    // Triangles of no area and needles a thousand times as long as wide among sound ones.
    TriMesh mesh;
    mesh.positions = {Vec3(-3, -3, 0), Vec3(3, -3, 0), Vec3(3, 3, 0), Vec3(-3, 3, 0), Vec3(0, 0, 0.3), Vec3(0.002, 0, 0.3), Vec3(0.001, 0, 0.3), Vec3(0, 0, 0.3)};
    mesh.triangles = {{0, 1, 5}, {0, 5, 4}, {1, 2, 5}, {2, 3, 4}, {2, 4, 5}, {3, 0, 4}, {4, 5, 6}, {4, 7, 4}, {0, 0, 1}};
    add("needles-and-empty-triangles", Terrain::from_mesh(mesh), Vec3(-0.3, -0.3, 0.6));
  }
  {
    const Vec2 far(2.6674e6, 6.4787e6);
    add("at-northing-6.5e6", plain_with(14, 18, -0.5, far), Vec3(far.x() + 3.7, far.y() + 3.7, 0.2));
  }
  add("at-a-thousandth-of-the-scale", grid(17, 5e-4, [](int i, int) { return 2e-4 * std::abs(i - 8); }), Vec3(3.7e-3, 3.7e-3, 6e-4), 1e-4, 2e-3);
  return cases;
}

}  // namespace effuse::stability
