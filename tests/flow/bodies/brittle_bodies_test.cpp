#include "flow/bodies/brittle_bodies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/bodies/worlds.h"

namespace effuse::flow::bodies {
namespace {

using namespace worlds;
using geometry::CellLayout;
using geometry::CellOptions;
using geometry::FracturedBody;

constexpr Real kForever = std::numeric_limits<Real>::infinity();

std::shared_ptr<const FracturedBody> cut(const Vec3& size, const CellOptions& options) {
  const geometry::TriMesh mesh = geometry::make_box(-size / 2, size / 2);
  return std::make_shared<const FracturedBody>(geometry::fracture(mesh, geometry::cell_regions(mesh, options)));
}

BodyOptions with_gravity(Real g) {
  BodyOptions options = awake();
  options.gravity = Vec3(0, 0, -g);
  return options;
}

struct Scene {
  RigidBodies bodies;
  BrittleBodies brittle;
  explicit Scene(const BodyOptions& options, std::optional<geometry::Terrain> ground = {}) : bodies(options, std::move(ground)), brittle(bodies) {}
};

std::string hash_of(const Scene& s) {
  StateHash hash;
  s.bodies.add_to(hash);
  s.brittle.add_to(hash);
  return hash.hex();
}

/// A plate in the air, hit by a ball.
std::unique_ptr<Scene> hammer(Real strength, Real speed, std::size_t cells = 60) {
  auto scene = std::make_unique<Scene>(weightless());
  scene->brittle.add({cut(Vec3(2, 2, 0.2), {.cells = cells}), strength, 0}, 2500, at(0, 0, 0), {}, Vec3(0.1, 0.2, 0), Vec3(0.1, 0, 0.3));
  scene->bodies.add(Shape::sphere(0.15), 7800, at(0.6, 0.55, 0.5), {}, Vec3(0, 0, -speed));
  return scene;
}

TEST(BrittleBodies, ABlowKeepsMassAndBothMomenta) {
  const auto scene = hammer(2e6, 20);
  const Vec3 p = total_momentum(scene->bodies), L = total_angular_momentum(scene->bodies);
  const Real before = scene->bodies.kinetic_energy();
  Real mass = 0;
  for (BodyId i = 0; i < scene->bodies.size(); ++i) mass += scene->bodies.mass(i);
  std::size_t broken = 0;
  Real energy = before;
  for (int k = 0; k < 60; ++k) {
    broken += scene->brittle.step(1.0 / 120).broken_bodies;
    // Free rotation wavers by (w dt)^2 of its own share, RotorScheme::kSplitting.
    EXPECT_LE(scene->bodies.kinetic_energy(), energy + 1e-6 * before) << "step " << k;
    energy = scene->bodies.kinetic_energy();
  }
  ASSERT_GT(broken, 0u);
  Real after = 0;
  for (BodyId i = 0; i < scene->bodies.size(); ++i)
    if (!scene->bodies.is_gone(i)) after += scene->bodies.mass(i);
  EXPECT_NEAR(after, mass, 1e-12 * mass);
  EXPECT_LT((total_momentum(scene->bodies) - p).norm(), 1e-11 * p.norm());
  EXPECT_LT((total_angular_momentum(scene->bodies) - L).norm(), 1e-11 * L.norm());
  EXPECT_GT(scene->brittle.pieces().size(), 4u);
}

TEST(BrittleBodies, APieceGoesOnAsItsPartOfTheBodyDid) {
  // Spun so fast that the bar breaks by itself in the first step: what follows is free flight of pieces.
  Scene scene(weightless());
  const auto cells = cut(Vec3(2, 0.2, 0.2), {.layout = CellLayout::kBricks, .cells = 10, .axis = 1, .flatness = 1});
  const Vec3 v(1, 2, 3), w(0, 0, 100);
  const BodyId id = scene.brittle.add({cells, 1e6, 0}, 2500, at(5, 6, 7), {}, v, w);
  const Real energy = scene.bodies.kinetic_energy();
  const BrittleReport report = scene.brittle.step(1e-6);
  ASSERT_EQ(report.broken_bodies, 1u);
  EXPECT_TRUE(scene.bodies.is_gone(id));
  for (const auto& [piece, what] : scene.brittle.pieces()) {
    const Vec3 r = scene.bodies.centres()[piece] - Vec3(5, 6, 7);
    EXPECT_LT((scene.bodies.momenta()[piece] / scene.bodies.mass(piece) - (v + w.cross(r))).norm(), 1e-3 * w.norm()) << piece;
    EXPECT_LT((scene.bodies.spin(piece) - w).norm(), 1e-9 * w.norm());
  }
  EXPECT_NEAR(scene.bodies.kinetic_energy(), energy, 1e-9 * energy);
  // Centrifugal stress is largest in the middle, and what is left holds.
  for (const auto& [piece, what] : scene.brittle.pieces()) EXPECT_LT(what.cells.size(), cells->cells.size());
}

TEST(BrittleBodies, OfInfiniteStrengthItNeverBreaks) {
  const auto scene = hammer(kForever, 200);
  for (int k = 0; k < 30; ++k) EXPECT_EQ(scene->brittle.step(1.0 / 120).broken_bodies, 0u);
  EXPECT_EQ(scene->brittle.pieces().size(), 1u);
  EXPECT_EQ(scene->brittle.broken_bonds(), 0u);
}

// Pieces are small where the ball struck, large elsewhere.
TEST(BrittleBodies, ABlowShattersNearTheContact) {
  const auto scene = hammer(2e6, 20, 120);
  for (int k = 0; k < 30; ++k) scene->brittle.step(1.0 / 120);
  const FracturedBody& cells = *scene->brittle.material(0).cells;
  Real near = 0, far = 0;
  std::size_t n_near = 0, n_far = 0;
  for (const auto& [id, piece] : scene->brittle.pieces())
    for (const Index c : piece.cells) {
      // Where the ball meets the plate, as the plate has turned and moved by then.
      const bool close = (cells.cells[c].mass.centre.head<2>() - Vec2(0.6, 0.55)).norm() < 0.35;
      (close ? near : far) += static_cast<Real>(piece.cells.size());
      ++(close ? n_near : n_far);
    }
  ASSERT_GT(n_near, 0u);
  std::cout << "[ figures  ] cells in the piece of a cell: near the blow " << near / static_cast<Real>(n_near) << ", elsewhere " << far / static_cast<Real>(n_far) << "\n";
  EXPECT_LT(near / static_cast<Real>(n_near), 0.5 * far / static_cast<Real>(n_far));
}

// A bar on two supports under its own weight: breaks at the length beam theory says, in the middle.
TEST(BrittleBodies, ABarOnTwoSupportsBreaksWhereAndWhenBeamTheorySays) {
  const Vec3 size(3, 0.3, 0.2);
  const Real rho = 2500, span = 2.8;
  // s = M / W,  M = w span^2 / 8 - w overhang^2 / 2,  w = rho g b h,  W = b h^2 / 6
  const auto stress = [&](Real g) { return rho * g * (span * span / 8 - 0.1 * 0.1 / 2) * 6 / size.z(); };
  const auto breaks_at = [&](Real factor) {
    const Real strength = stress(9.81) / factor;
    Scene scene(with_gravity(9.81));
    for (const Real x : {-span / 2, span / 2}) scene.bodies.add_static(Shape::box(Vec3(0.01, 0.3, 0.3)), at(x, 0, -0.4));
    scene.brittle.add({cut(size, {.layout = CellLayout::kBricks, .cells = 15, .axis = 1, .flatness = 1}), strength, 0}, rho, at(0, 0, 0.0));
    for (int k = 0; k < 60; ++k) {
      if (scene.brittle.step(1.0 / 120).broken_bodies == 0) continue;
      for (const auto& [id, piece] : scene.brittle.pieces()) EXPECT_LT(scene.bodies.centres()[id].head<1>().norm(), 1.5);
      std::vector<Real> ends;
      for (const auto& [id, piece] : scene.brittle.pieces()) ends.push_back(std::abs(scene.bodies.centres()[id].x()));
      EXPECT_LE(ends.size(), 3u);
      return true;
    }
    return false;
  };
  EXPECT_FALSE(breaks_at(0.8));
  EXPECT_TRUE(breaks_at(1.25));
}

TEST(BrittleBodies, PiecesDoNotOverlapAtBirthAndDoNotExplode) {
  Scene scene(with_gravity(9.81), plane());
  // A wall on the ground, as weak as sand: it falls apart where it stands and stays a heap.
  const auto cells = cut(Vec3(2, 0.4, 1.2), {.cells = 40});
  scene.brittle.add({cells, 300, 0}, 2200, at(0, 0, 0.6005));
  Real fastest = 0, deepest = 0;
  const Real above = scene.bodies.potential_energy();
  for (int k = 0; k < 120; ++k) {
    const BrittleReport report = scene.brittle.step(1.0 / 120);
    for (BodyId i = 0; i < scene.bodies.size(); ++i)
      if (scene.bodies.is_dynamic(i)) fastest = std::max(fastest, scene.bodies.momenta()[i].norm() / scene.bodies.mass(i));
    deepest = std::max(deepest, report.bodies.penetration);
    EXPECT_LT(energy(scene.bodies), above * (1 + 1e-6) + 1) << k;
  }
  std::cout << "[ figures  ] " << scene.brittle.pieces().size() << " pieces, fastest " << fastest << " m/s, deepest " << deepest * 1000 << " mm\n";
  EXPECT_GT(scene.brittle.pieces().size(), 5u);
  EXPECT_LT(fastest, std::sqrt(2 * 9.81 * 1.2));  // nothing goes faster than what falls from the top
  EXPECT_LT(deepest, 0.02);
}

TEST(BrittleBodies, AHollowMeshBreaksToo) {
  const geometry::TriMesh ring = geometry::make_torus(Vec3::Zero(), 1, 0.3, 20, 10);
  const auto cells = std::make_shared<const FracturedBody>(geometry::fracture(ring, geometry::cell_regions(ring, {.cells = 12})));
  Scene scene(weightless());
  scene.brittle.add({cells, 1e6, 0}, 2500, at(0, 0, 0));
  scene.bodies.add(Shape::sphere(0.3), 7800, at(1, 0, 1), {}, Vec3(0, 0, -20));
  const Vec3 p = total_momentum(scene.bodies), L = total_angular_momentum(scene.bodies);
  for (int k = 0; k < 30; ++k) scene.brittle.step(1.0 / 120);
  EXPECT_GT(scene.brittle.pieces().size(), 1u);
  EXPECT_LT((total_momentum(scene.bodies) - p).norm(), 1e-11 * p.norm());
  EXPECT_LT((total_angular_momentum(scene.bodies) - L).norm(), 1e-11 * L.norm());
}

TEST(BrittleBodies, WhatHitsAWeakWallGoesThrough) {
  const auto speed_left = [](Real strength) {
    Scene scene(weightless());
    scene.brittle.add({cut(Vec3(3, 0.2, 3), {.cells = 80}), strength, 0}, 2000, at(0, 0, 0));
    const BodyId ball = scene.bodies.add(Shape::sphere(0.4), 2700, at(0, -1, 0), {}, Vec3(0, 15, 0));
    for (int k = 0; k < 40; ++k) scene.brittle.step(1.0 / 120);
    return scene.bodies.momenta()[ball].y() / scene.bodies.mass(ball);
  };
  const Real through = speed_left(1e5), stopped = speed_left(kForever);
  std::cout << "[ figures  ] ball at 15 m/s: " << through << " m/s behind the weak wall, " << stopped << " m/s before the one that holds\n";
  EXPECT_GT(through, 8);
  EXPECT_LT(stopped, 6);
}

TEST(BrittleBodies, TheSameBitsOnAnyNumberOfThreads) {
  std::string first;
  for (const int threads : {1, 1, 3}) {
    const ThreadLimit limit(threads);
    const auto scene = hammer(2e6, 20);
    for (int k = 0; k < 20; ++k) scene->brittle.step(1.0 / 120);
    if (first.empty()) first = hash_of(*scene);
    EXPECT_EQ(hash_of(*scene), first);
  }
}

TEST(BrittleBodies, ACheckpointInTheMidstOfABreakGoesOnToTheSameBits) {
  const auto made = [] {
    auto scene = hammer(1.5e6, 20);
    // Something hangs from the plate.
    const BodyId load = scene->bodies.add(Shape::sphere(0.1), 2500, at(-0.8, -0.8, -0.5));
    scene->bodies.join({.kind = Joint::Kind::kDistance, .a = 0, .b = load, .anchor = Vec3(-0.8, -0.8, -0.1), .anchor_b = Vec3(-0.8, -0.8, -0.4)});
    return scene;
  };
  const auto scene = made();
  std::size_t broken = 0;
  int steps = 0;
  while (broken == 0 && steps < 60) broken += scene->brittle.step(1.0 / 120).broken_bodies, ++steps;
  ASSERT_GT(broken, 0u);
  StateWriter out;
  scene->brittle.save(out);
  scene->bodies.save(out);
  const auto again = made();
  StateReader in(out.bytes(), "test");
  again->brittle.load(in);
  again->bodies.load(in);
  EXPECT_EQ(hash_of(*again), hash_of(*scene));
  EXPECT_TRUE(std::equal(scene->bodies.momenta().begin(), scene->bodies.momenta().end(), again->bodies.momenta().begin()));
  for (int k = 0; k < 20; ++k) {
    scene->brittle.step(1.0 / 120);
    again->brittle.step(1.0 / 120);
    ASSERT_EQ(hash_of(*again), hash_of(*scene)) << k;
  }
  EXPECT_LT(again->bodies.joint_error(0), 1e-4);

  const auto other = hammer(1.5e6, 20, 30);  // other cells
  StateReader wrong(out.bytes(), "test");
  EXPECT_THROW(other->brittle.load(wrong), InputError);
}

TEST(BrittleBodies, ForcesWithAPlaceBreakWhereTheyAct) {
  // A long bar pushed at its middle, held by its inertia alone: bends as a free beam and breaks near the middle.
  Scene scene(weightless());
  const BodyId id = scene.brittle.add({cut(Vec3(3, 0.2, 0.2), {.layout = CellLayout::kBricks, .cells = 15, .axis = 1, .flatness = 1}), 1e6, 0}, 2500, at(0, 0, 0));
  // M in the middle of a free bar pushed there by F: F L / 8.
  const Real F = 1.3 * 1e6 * (0.2 * 0.2 * 0.2 / 6) * 8 / 3;
  scene.brittle.add_force(id, Vec3(0, F, 0), Vec3(0, 0, 0));
  EXPECT_EQ(scene.brittle.step(1.0 / 60).broken_bodies, 1u);
  const Vec3 p = total_momentum(scene.bodies);
  EXPECT_NEAR(p.y(), F / 60, 1e-9 * F);
  Scene weak(weightless());
  const BodyId holds = weak.brittle.add({cut(Vec3(3, 0.2, 0.2), {.layout = CellLayout::kBricks, .cells = 15, .axis = 1, .flatness = 1}), 1e6, 0}, 2500, at(0, 0, 0));
  weak.brittle.add_force(holds, Vec3(0, F / 1.7, 0), Vec3(0, 0, 0));
  EXPECT_EQ(weak.brittle.step(1.0 / 60).broken_bodies, 0u);
}

}  // namespace
}  // namespace effuse::flow::bodies
