#include "flow/scene/breaking.h"

#include <gtest/gtest.h>

#include "flow/effects/registry.h"
#include "flow/effects/solid_world.h"
#include "flow/scene/scene.h"
#include "flow/sph/modern_lava.h"
#include "geometry/procedural/primitives.h"
#include "geometry/terrain/height_field.h"
#include "tests/flow/effects/scene_lines.h"

/// What scenes say of bodies that break.
namespace effuse::flow {
namespace {

Lines wall(Lines more = {}) {
  Lines lines = {{"body[0].box", "[0.4, 3, 2]"}, {"body[0].name", "wall"}, {"body[0].position", "[0, 0, 1]"}, {"body[0].density", "2000 kg/m3"}};
  lines.insert(lines.end(), more.begin(), more.end());
  return lines;
}

std::vector<PlannedBody> read(const Lines& lines, std::vector<Fault>* faults = nullptr) {
  const Node root = scene_of(lines);
  Parameters all(root);
  std::vector<PlannedBody> plans = read_bodies(all, 7);
  try {
    all.finish();
  } catch (const InputError& error) {
    if (!faults) throw;
    *faults = error.faults();
  }
  return plans;
}

geometry::Terrain flat() { return geometry::Terrain::from_height_field(geometry::HeightField({-50, -50}, {50, 50}, 3, 3, std::vector<Real>(9, 0.0))); }

TEST(Breaking, KeysOfABody) {
  const auto plans = read(wall({{"body[0].strength", "2 MPa"}, {"body[0].cells", "30"}, {"body[0].cell_layout", "bricks"}, {"body[0].cell_flatness", "2"}, {"body[0].smallest_piece", "0.1 m3"}}));
  const PlannedBreaking& b = plans.at(0).breaking;
  EXPECT_EQ(b.strength, 2e6);
  EXPECT_EQ(b.cells.cells, 30u);
  EXPECT_EQ(b.cells.seed, 7u) << "the scene's";
  EXPECT_EQ(b.cells.layout, geometry::CellLayout::kBricks);
  EXPECT_EQ(b.cells.flatness, 2);
  EXPECT_EQ(b.smallest, 0.1);
  EXPECT_FALSE(read(wall()).at(0).breaking.breaks());
}

TEST(Breaking, WhatMakesNoSenseIsSaid) {
  const auto said = [](const Lines& more, const std::string& word) {
    std::vector<Fault> faults;
    read(wall(more), &faults);
    for (const Fault& fault : faults)
      if (fault.message.find(word) != std::string::npos) return true;
    for (const Fault& fault : faults) std::cout << fault.message << "\n";
    return false;
  };
  EXPECT_TRUE(said({{"body[0].strenght", "2 MPa"}}, "strength"));
  EXPECT_TRUE(said({{"body[0].strength", "2 MPa"}, {"body[0].cell_layot", "bricks"}}, "cell_layout"));
  EXPECT_TRUE(said({{"body[0].cells", "30"}}, "goes with a strength"));
  EXPECT_TRUE(said({{"body[0].strength", "2 m"}}, "Pa"));
  EXPECT_TRUE(said({{"body[0].strength", "2 MPa"}, {"body[0].cell_layout", "near"}}, "cell_centre"));
  EXPECT_TRUE(said({{"body[0].strength", "2 MPa"}, {"body[0].cell_axis", "x"}}, "goes with cell_layout"));
  EXPECT_TRUE(said({{"body[0].strength", "2 MPa"}, {"body[0].cells", "100000"}}, "5000"));
}

TEST(Breaking, AMeshThatCannotBeCutIsAFaultAtItsFile) {
  auto plans = read({{"body[0].file", "ring.obj"}, {"body[0].position", "[0, 0, 1]"}, {"body[0].density", "2000"}, {"body[0].shape", "mesh"}, {"body[0].strength", "1 MPa"}});
  geometry::TriMesh two = geometry::make_box(Vec3::Zero(), Vec3(1, 1, 1));
  geometry::append(two, geometry::make_box(Vec3(0.5, 0.5, 0.5), Vec3(2, 2, 2)));
  std::vector<PlacedBody> placed;
  std::vector<Fault> faults;
  place_body(plans.at(0), two, flat(), placed, faults);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].message.find("cuts through itself"), std::string::npos) << faults[0].message;
  EXPECT_TRUE(placed.empty());
}

std::vector<PlacedBody> wall_and_ball(Real strength) {
  const geometry::Terrain terrain = flat();
  std::vector<PlacedBody> placed;
  std::vector<Fault> faults;
  auto plans = read(wall({{"body[0].strength", std::to_string(strength)}, {"body[0].cells", "40"}, {"body[1].ball", "0.5"}, {"body[1].position", "[-1.5, 0, 1.2]"}, {"body[1].density", "2700"},
                          {"body[1].velocity", "[14, 0, 0]"}}));
  for (const PlannedBody& plan : plans) place_body(plan, mesh_of(plan), terrain, placed, faults);
  EXPECT_TRUE(faults.empty());
  return placed;
}

TEST(Breaking, AWorldHasPiecesAndGoesOnFromACheckpoint) {
  const geometry::Terrain terrain = flat();
  const std::vector<PlacedBody> bodies = wall_and_ball(3e5);
  SolidWorld world({}, bodies, &terrain);
  ASSERT_EQ(world.pieces().size(), 1u);
  Real t = 0;
  const Real dt = 1.0 / 120;
  for (int k = 0; k < 30; ++k, t += dt) world.step(t, dt);
  const std::vector<SolidPiece> pieces = world.pieces();
  EXPECT_GT(pieces.size(), 3u);
  for (const SolidPiece& p : pieces) EXPECT_EQ(p.body, 0u);
  EXPECT_EQ(world.poses().size(), 2u);

  StateWriter out;
  world.save(out);
  SolidWorld again({}, bodies, &terrain);
  StateReader in(out.bytes(), "test");
  again.load(in);
  ASSERT_EQ(again.pieces().size(), pieces.size());
  for (std::size_t k = 0; k < pieces.size(); ++k) EXPECT_EQ(again.pieces()[k].id, pieces[k].id);
  for (int k = 0; k < 20; ++k, t += dt) {
    world.step(t, dt);
    again.step(t, dt);
  }
  StateHash a, b;
  world.add_to(a);
  again.add_to(b);
  EXPECT_EQ(a.hex(), b.hex());
}

// Lava stands against a wall: it is pushed where the lava lies, so that a weak one breaks and a strong one does not.
TEST(BreakingSlow, LavaBreaksAWeakWall) {
  const auto pieces = [](Real strength) {
    const geometry::Terrain terrain = flat();
    std::vector<PlacedBody> placed = wall_and_ball(strength);
    placed.pop_back();
    placed[0].pose.position = Vec3(0, 0, 1.01);
    SolidWorld world({}, placed, &terrain);
    sph::ModernOptions o;
    o.spacing = 0.25;
    o.rheology = sph::Rheology::newtonian(500);
    o.heat.on = false;
    o.rest_period = 0;
    o.ground_speed = 0;
    o.max_step = 0.02;
    sph::ModernLava lava(o, {}, {[&](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) { terrain.contacts(x, reach, out); }}, {}, world.solids());
    std::vector<Vec3> x;
    for (int i = 0; i < 8; ++i)
      for (int j = 0; j < 12; ++j)
        for (int k = 0; k < 7; ++k) x.emplace_back(-0.5 - 0.25 * i, -1.375 + 0.25 * j, 0.125 + 0.25 * k);
    lava.add(x, std::vector<Vec3>(x.size(), Vec3(2, 0, 0)), std::vector<Real>(x.size(), 1400));
    while (lava.time() < 0.3) {
      lava.step(0.02);
      world.wet(lava.positions(), o.spacing);
    }
    return world.pieces().size();
  };
  EXPECT_GT(pieces(3e3), 1u);
  EXPECT_EQ(pieces(1e8), 1u);
}

TEST(Breaking, CrustBlocksNeedACrust) {
  const auto faults = [](Lines lines) {
    Lines all = {{"film.frames", "10"}, {"terrain.file", "a.asc"}, {"lava.spacing", "0.5 m"}, {"lava.vent[0].at", "[1, 2]"}, {"lava.vent[0].width", "3 m"}, {"lava.vent[0].rate", "1 m3/s"}};
    all.insert(all.end(), lines.begin(), lines.end());
    const Node root = scene_of(all);
    Parameters parameters(root);
    read_scene(parameters, effect_kinds());
    std::string text;
    try {
      parameters.finish();
    } catch (const InputError& error) {
      text = error.what();
    }
    return text;
  };
  EXPECT_NE(faults({{"lava.crust_blocks.size", "3 m"}}).find("need a crust"), std::string::npos);
  EXPECT_EQ(faults({{"lava.preset", "etna"}, {"lava.crust_blocks.size", "3 m"}}), "");
  EXPECT_NE(faults({{"lava.preset", "etna"}, {"lava.crust_blocks.sizes", "3 m"}}).find("size"), std::string::npos);
  EXPECT_NE(faults({{"lava.preset", "etna"}, {"lava.crust_blocks.size", "1 m"}}).find("too small"), std::string::npos);
}

}  // namespace
}  // namespace effuse::flow
