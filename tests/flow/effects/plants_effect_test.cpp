#include "flow/effects/plants_effect.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "flow/effects/registry.h"
#include "flow/scene/simulation.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/terrain/plane.h"
#include "importers/scene/scene_file.h"

namespace effuse::flow {
namespace {

/// Hot particles that stand still, in place of lava: what plants know of it is its points.
class Embers final : public Effect {
 public:
  Embers(std::vector<Vec3> x, Real temperature) : x_(std::move(x)), radius_(x_.size(), 0.25), T_(x_.size(), temperature) {}
  std::string_view name() const override { return "embers"; }
  Real time() const override { return time_; }
  void step(Real t_end) override { time_ = t_end; }
  geometry::Points points() const override {
    geometry::Points p;
    p.position = x_, p.radius = radius_, p.temperature = T_;
    return p;
  }
  Real spacing() const override { return 0.5; }
  std::size_t memory() const override { return 0; }
  void add_to(StateHash& hash) const override { hash.add(time_); }
  void save(StateWriter& out) const override { out.value("time", time_); }
  void load(StateReader& in) override { in.value("time", time_); }
  std::vector<std::pair<std::string, double>> figures() const override { return {}; }
  std::string status() const override { return ""; }

 private:
  std::vector<Vec3> x_;
  std::vector<Real> radius_, T_;
  Real time_ = 0;
};

struct PlantsScene {
  Node node;
  Scene scene;
  geometry::Terrain terrain;
  std::unique_ptr<Simulation> simulation;

  explicit PlantsScene(const std::string& text, Real slope = 0, std::vector<Vec3> hot = {})
      : node(importers::read_scene_text("[film]\nframes = 9999\n[terrain]\nplane = { size = [100, 100] }\n" + text, "test.toml")),
        terrain(geometry::Terrain::from_height_field(geometry::make_plane(Vec2(100, 100), slope, 0, 32, 0))) {
    Parameters root(node);
    scene = read_scene(root, effect_kinds());
    root.finish();
    if (!hot.empty()) {
      EffectPlan plan;
      plan.name = "embers";
      plan.misfits = [](const World&) { return std::vector<Fault>(); };
      plan.build = [hot](const World&) -> std::unique_ptr<Effect> { return std::make_unique<Embers>(hot, 1350); };
      scene.effects.insert(scene.effects.begin(), plan);
    }
    World world{&terrain, 1};
    simulation = std::make_unique<Simulation>(scene, world);
  }
  void frames(int n) {
    for (int k = 0; k < n; ++k) simulation->advance([] { return true; });
  }
  const Effect& plants() const { return *simulation->effects().back(); }
  double figure(const std::string& name) const {
    for (const auto& [key, value] : plants().figures())
      if (key == name) return value;
    return -1;
  }
};

std::string fault_of(const std::string& text) {
  try {
    PlantsScene scene(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(PlantsEffect, StandOnTheGroundAsHighAndAsManyAsAsked) {
  PlantsScene scene("[[plants]]\nkind = \"bush\"\nheight = 2\nheight_spread = 0.2\nat = [0, 0]\nradius = 10\ndensity = 0.2\n", 0.2);
  EXPECT_NEAR(scene.figure("plants"), 0.2 * kPi * 100, 8) << "cells of the lattice at the circle's rim";
  const NamedMesh shown = scene.plants().meshes().at(0);
  const Box3 box = geometry::bounds(shown.mesh);
  EXPECT_EQ(shown.name, "plants");
  EXPECT_EQ(shown.since, 0) << "no wind: it stays as it is";
  EXPECT_EQ(shown.mesh.attributes.at("glow").values.size(), 3 * shown.mesh.positions.size());
  // The slope falls by 2 m from the circle's middle to its rim; a plant is 2.4 m high at most, and leaves stand out over its top.
  EXPECT_LT(box.max().z(), 10 * std::tan(0.2) + 2.4 + 0.5);
  EXPECT_GT(box.max().z(), 1.6);
  EXPECT_LT(box.min().z(), 0);
}

TEST(PlantsEffect, NoneStandsWhereItIsTooSteep) {
  const std::string text = "[[plants]]\nkind = \"grass\"\nheight = 0.5\nat = [0, 0]\nradius = 5\ndensity = 1\nslope_limit = \"20 deg\"\n";
  EXPECT_GT(PlantsScene(text, 0.3).figure("plants"), 60);
  try {
    PlantsScene scene(text, 0.4);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("are steeper than slope_limit"), std::string::npos) << error.what();
  }
}

TEST(PlantsEffect, SwayWithTheWindAsAFunctionOfTime) {
  const std::string text = "[[plants]]\nkind = \"grass\"\nheight = 1\nplaces = [[0, 0], [1, 0]]\nvariants = 2\n";
  PlantsScene still(text), windy(text + "wind = [6, 0]\n");
  still.frames(1);
  windy.frames(1);
  const auto lean = [](const PlantsScene& scene) {
    Vec3 mean = Vec3::Zero();
    const geometry::TriMesh mesh = scene.plants().meshes().at(0).mesh;
    for (const Vec3& x : mesh.positions) mean += x / static_cast<Real>(mesh.positions.size());
    return mean;
  };
  EXPECT_GT(lean(windy).x() - lean(still).x(), 0.05);
  EXPECT_LT(windy.plants().meshes()[0].since, 0);
  const Vec3 before = lean(windy);
  windy.frames(24);
  EXPECT_GT((lean(windy) - before).norm(), 0.005);
  PlantsScene other(text + "wind = [6, 0]\n");
  other.frames(25);
  EXPECT_EQ(lean(other), lean(windy));
}

TEST(PlantsEffect, BurnDownBesideSomethingHotFarOnesDoNotAndACheckpointGoesOnToTheSameBits) {
  std::vector<Vec3> hot;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) hot.push_back(Vec3(0.5 * i - 2, 0.5 * j - 0.75, 0.2));
  const std::string text = "[[plants]]\nkind = \"bush\"\nheight = 3\nplaces = [[0, 0], [20, 0]]\nburn_time = 8\n";
  PlantsScene scene(text, 0, hot);
  const std::size_t whole = scene.plants().meshes().at(0).mesh.triangles.size();
  int frame = 0;
  for (; frame < 24 * 60 && scene.figure("burning") == 0; ++frame) scene.frames(1);
  EXPECT_EQ(scene.figure("burning"), 1) << "after " << frame << " frames";
  scene.frames(30);
  EXPECT_GT(scene.plants().fires().size(), 0u);
  const geometry::TriMesh flames = scene.plants().meshes().at(1).mesh;
  EXPECT_GT(flames.triangles.size(), 0u);
  EXPECT_EQ(scene.plants().meshes()[1].name, "plants-flames");
  const std::vector<float> glow = scene.plants().meshes()[0].mesh.attributes.at("glow").values;
  EXPECT_GT(*std::max_element(glow.begin(), glow.end()), 0.3f);
  const std::string bytes = scene.simulation->checkpoint("key");
  PlantsScene again(text, 0, hot);
  again.simulation->restore(bytes, "key", "checkpoint");
  EXPECT_EQ(again.plants().fires().size(), scene.plants().fires().size());
  {
    const ThreadLimit one(1);
    again.frames(24 * 30);
  }
  scene.frames(24 * 30);
  EXPECT_EQ(scene.simulation->state_hash(), again.simulation->state_hash());
  const geometry::TriMesh a = scene.plants().meshes()[0].mesh, b = again.plants().meshes()[0].mesh;
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(scene.figure("burnt_down"), 1);
  EXPECT_EQ(scene.figure("burning"), 0);
  EXPECT_LT(a.triangles.size(), 0.8 * static_cast<double>(whole)) << "one of two stands bare";
  EXPECT_GE(scene.plants().meshes()[0].since, 0) << "and stays so";
  EXPECT_LT(scene.plants().meshes()[0].since, scene.simulation->time());
}

TEST(PlantsEffect, GrowsTheScenesOwnLSystem) {
  PlantsScene scene("[[plants]]\nkind = \"own\"\naxiom = \"A(1)\"\ngenerations = 3\nheight = 2\nvariants = 1\nplaces = [[0, 0]]\n[[plants.rule]]\nfrom = \"A(l)\"\nto = \"F(l)[+(30)A(l*0.7)][-(30)A(l*0.7)]\"\n");
  EXPECT_EQ(scene.figure("limbs"), 1 + 2 + 4);
  EXPECT_NEAR(geometry::bounds(scene.plants().meshes()[0].mesh).max().z(), 2, 0.6);
}

TEST(PlantsEffect, SaysWhatDoesNotFit) {
  const auto tells = [](const std::string& text, const char* part) {
    const std::string faults = fault_of(text);
    EXPECT_NE(faults.find(part), std::string::npos) << text << "\n" << faults;
  };
  tells("[[plants]]\nheight = 1\n", "plants[0].at: is missing");
  tells("[[plants]]\nkind = \"tre\"\nheight = 1\nplaces = [[0, 0]]\n", "did you mean 'tree'");
  tells("[[plants]]\nheight = 1\nplaces = [[0, 0]]\nheigt_spread = 3\n", "height_spread");
  tells("[[plants]]\nheight = 1\nplaces = [[400, 0]]\n", "no ground at 400, 0");
  tells("[[plants]]\nheight = 1\nat = [0, 0]\nradius = 1000\ndensity = 10\n", "are the most");
  tells("[[plants]]\nkind = \"own\"\naxiom = \"F[\"\nheight = 1\nplaces = [[0, 0]]\n", "without its");
  tells("[[plants]]\nkind = \"own\"\naxiom = \"A\"\nheight = 1\nplaces = [[0, 0]]\n", "no limb that goes up");
  tells("[[plants]]\nheight = 1\nplaces = [[0, 0]]\n[[plants]]\nheight = 1\nplaces = [[0, 0]]\n", "the name of another effect");
}

}  // namespace
}  // namespace effuse::flow
