#include "skin/scene/skin_settings.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/error.h"
#include "importers/scene/scene_file.h"

/// Cameras of a scene: what [preview] may say, what it may not, and where the eye is.
namespace effuse::skin {
namespace {

constexpr Real kDegree = kPi / 180;

/// What a scene's text says of the skin; throws InputError as a scene does.
SkinSettings read(const std::string& text) {
  const flow::Node node = importers::read_scene_text(text, "scene.toml");
  flow::Parameters root(node);
  const SkinSettings settings = read_skin_settings(root);
  root.finish();
  return settings;
}

/// A ridge along y, ten metres high at x = 50, on a map far from its origin: heights 100 + z.
geometry::Terrain ridge(const Vec3& origin = Vec3(2'667'400, 6'478'700, 100)) {
  std::vector<Real> heights;
  for (int j = 0; j < 21; ++j)
    for (int i = 0; i < 21; ++i) heights.push_back(10 - 0.2 * std::abs(5 * i - 50));
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2(0, 0), Vec2(5, 5), 21, 21, std::move(heights)), geometry::Georeference{origin, ""});
}

TEST(SkinSettings, CoverIsReadAndNoLargerThanALoneParticlesRadius) {
  EXPECT_EQ(read("").level_set.cover, LevelSetOptions{}.cover);
  EXPECT_EQ(read("[skin]\ncover = 0").level_set.cover, 0);
  EXPECT_EQ(read("[skin]\ncover = 0.5").level_set.cover, 0.5);
  EXPECT_THROW(read("[skin]\ncover = 0.7"), InputError);
  EXPECT_THROW(read("[skin]\ncovr = 0.4"), InputError);
}

TEST(PreviewCamera, StandsAtItsDistanceFromATargetOnTheGroundInTheTermsOfTheMap) {
  const SkinSettings s = read("[preview]\ntarget = [2667450, 6478750]\ndistance = \"20 m\"\nazimuth = \"90 deg\"\nelevation = \"30 deg\"\nfov = \"40 deg\"\nturn = \"10 deg/s\"");
  const geometry::Terrain terrain = ridge();
  const Camera camera = picture_at(s, terrain, 0).camera;
  EXPECT_LT((camera.target - Vec3(50, 50, 10)).norm(), 1e-9) << camera.target.transpose();
  EXPECT_LT((camera.eye - camera.target - 20 * Vec3(0, std::cos(30 * kDegree), 0.5)).norm(), 1e-9) << "north of it, looking down";
  EXPECT_NEAR(camera.field_of_view, 40 * kDegree, 1e-12);
  const Camera later = picture_at(s, terrain, 9).camera;
  EXPECT_LT((later.eye - later.target - 20 * Vec3(-std::cos(30 * kDegree), 0, 0.5)).norm(), 1e-9) << "a quarter turn later in the west";
  EXPECT_EQ(later.target, camera.target);
  check_camera(s, terrain, 216, 24);
}

TEST(PreviewCamera, ItsNumbersAndTheSunsMayHaveKeysBySecondsOfFilm) {
  const SkinSettings s = read("[preview]\ntarget = [2667450, 6478750]\ndistance = [[\"0 s\", \"20 m\"], [2, 40, \"hold\"], [3, 10]]\nfov = [[0, \"20 deg\"], [2, \"40 deg\"]]\nmotion = \"smooth\"\n"
                              "sun_elevation = [[0, \"-10 deg\"], [4, \"30 deg\"]]\nexposure = [[0, 1, \"linear\"], [4, 2]]\n");
  const geometry::Terrain terrain = ridge();
  const auto at = [&](Real t) { return picture_at(s, terrain, t); };
  const auto distance = [&](Real t) { return (at(t).camera.eye - at(t).camera.target).norm(); };
  EXPECT_NEAR(distance(0), 20, 1e-9);
  EXPECT_NEAR(distance(1), 30 + 2.5, 1e-9) << "leaves at 10 m/s, arrives at 0: 2 times (10 - 0) / 8 above the middle";
  EXPECT_NEAR(distance(2.9), 40, 1e-9);
  EXPECT_NEAR(distance(3), 10, 1e-9);
  EXPECT_NEAR(at(1).camera.field_of_view, 30 * kDegree, 1e-12);
  EXPECT_NEAR(std::asin(at(2).sun_direction.z()), 10 * kDegree, 1e-9);
  EXPECT_NEAR(at(2).exposure, 1.5, 1e-12);
}

TEST(PreviewCamera, GoesFromKeyToKey) {
  const std::string keys = "[preview]\nfov = 0.5\n[[preview.key]]\ntime = 0\nposition = [2667410, 6478750, 5]\ntarget = [2667450, 6478750, 2]\n[[preview.key]]\ntime = 2\nposition = [2667410, 6478790, 5]\n";
  const SkinSettings s = read(keys);
  const geometry::Terrain terrain = ridge();
  const Camera from = picture_at(s, terrain, 0).camera, middle = picture_at(s, terrain, 1).camera, to = picture_at(s, terrain, 9).camera;
  EXPECT_LT((from.eye - Vec3(10, 50, 7)).norm(), 1e-9) << from.eye.transpose();
  EXPECT_LT((from.target - Vec3(50, 50, 12)).norm(), 1e-9);
  EXPECT_LT((middle.eye - Vec3(10, 70, 7)).norm(), 1e-9);
  EXPECT_LT((to.eye - Vec3(10, 90, 7)).norm(), 1e-9);
  EXPECT_EQ(to.target, from.target) << "kept from the key before";
  check_camera(s, terrain, 48, 24);
  EXPECT_THROW(read(keys + "target = [0, 0, 0]\ntime = 3\nazimut = 3\n"), InputError);
  EXPECT_THROW(read("[preview]\nazimuth = 1\n[[preview.key]]\ntime = 0\nposition = [0, 0, 5]\ntarget = [1, 0, 5]\n"), InputError) << "two ways to say where it stands";
  EXPECT_THROW(read("[preview]\n[[preview.key]]\ntime = 0\nposition = [0, 0, 5]\n"), InputError) << "looks at nothing";
  // Straight through the ridge; beside the terrain; at its own target.
  const auto refused = [&](const std::string& more) { EXPECT_THROW(check_camera(read(keys + more), terrain, 96, 24), InputError) << more; };
  refused("[[preview.key]]\ntime = 4\nposition = [2667450, 6478790, -3]\n");
  refused("[[preview.key]]\ntime = 4\nposition = [2667950, 6478790, 3]\n");
  refused("[[preview.key]]\ntime = 4\nposition = [2667450, 6478750, 2]\n");
}

TEST(PreviewCamera, ATargetWithAHeightIsThere) {
  const SkinSettings s = read("[preview]\ntarget = [2667450, 6478750, \"117 m\"]\ndistance = 5\nelevation = 0\nazimuth = 0");
  const Camera camera = picture_at(s, ridge(), 0).camera;
  EXPECT_LT((camera.target - Vec3(50, 50, 17)).norm(), 1e-9);
  EXPECT_LT((camera.eye - Vec3(55, 50, 17)).norm(), 1e-9);
}

TEST(PreviewCamera, AViewWithANarrowFieldIsSeenFromFartherAway) {
  const geometry::Terrain terrain = ridge();
  const auto distance = [&](const std::string& fov) {
    const Camera camera = picture_at(read("[preview]\nview = [2667450, 6478750, 30]\n" + fov), terrain, 0).camera;
    return (camera.eye - camera.target).norm();
  };
  EXPECT_NEAR(distance(""), distance("fov = 0.7"), 1e-9) << "the default";
  EXPECT_GT(distance("fov = \"10 deg\""), 3 * distance(""));
}

TEST(PreviewCamera, EdgesByPixelsGoByTheCloseCamera) {
  const geometry::Terrain terrain = ridge();
  const SkinSettings s = read("[skin]\nedge_pixels = 2\n[preview]\nheight = 500\ntarget = [2667450, 6478750]\ndistance = 20\nfov = 0.5\n");
  const DisplaceOptions detail = detail_at(s, terrain, 0);
  ASSERT_TRUE(detail.view.has_value());
  EXPECT_NEAR(detail.view->edge_at(Vec3(50, 50, 10)), 20 * 0.5 / 500 * 2, 1e-9);
}

TEST(PreviewCamera, WhatContradictsIsToldAtItsLineOnce) {
  struct Case {
    std::string keys, says;
    int line;
  };
  for (const Case& c : std::vector<Case>{
           {"target = [1, 2]\ndistance = 5\nview = [1, 2, 30]", "preview.target: says what the camera looks at, and so does view", 2},
           {"distance = 5", "preview.distance: goes with target", 2},
           {"view = [1, 2, 3]\ndistance = 5", "preview.distance: goes with target", 3},
           {"target = [1, 2]", "preview.distance: is missing (of the camera from its target)", 1},
           {"distance = 5\ntarget = [1]", "preview.target: has 1 numbers, wanted [x, y]", 3},
           {"distance = 5\ntarget = [1, 2, 3, 4]", "preview.target: has 4 numbers", 3},
           {"target = [1, 2, \"ground\"]\ndistance = 5", "preview.target[2]:", 2},
           {"target = [1, 2]\ndistance = 0", "preview.distance: 0 is out of range", 3},
           {"target = [1, 2]\ndistance = \"3 kg\"", "preview.distance:", 3},
           {"target = [1e300, 2]\ndistance = 5", "preview.target: lies more than", 2},
           {"fov = \"170 deg\"", "preview.fov: '170 deg' is out of range", 2},
           {"target = [1, 2]\ndistence = 5", "preview.distance: is missing", 1}}) {
    try {
      read("[preview]\n" + c.keys);
      ADD_FAILURE() << c.keys;
    } catch (const InputError& error) {
      const Fault& first = error.faults().front();
      EXPECT_TRUE(first.message.starts_with(c.says)) << first.message << " for " << c.keys;
      EXPECT_EQ(first.place.line, c.line) << c.keys;
      EXPECT_LE(error.faults().size(), c.keys.find("distence") == std::string::npos ? 1u : 2u) << error.what();
    }
  }
}

TEST(PreviewCamera, TheResolvedSceneReadsBackAsItself) {
  for (const std::string keys : {"", "view = [1, 2, 30]\nfov = \"20 deg\"", "target = [1, 2]\ndistance = 5", "target = [1, 2, \"3 km\"]\ndistance = 5"}) {
    const flow::Node node = importers::read_scene_text("[preview]\n" + keys, "scene.toml");
    flow::Parameters root(node);
    read_skin_settings(root);
    root.finish();
    const std::string resolved = importers::to_toml(root.resolved());
    const flow::Node again = importers::read_scene_text(resolved, "resolved");
    flow::Parameters second(again);
    const SkinSettings s = read_skin_settings(second);
    EXPECT_NO_THROW(second.finish()) << resolved;
    EXPECT_EQ(importers::to_toml(second.resolved()), resolved);
    EXPECT_EQ(s.camera.target.size(), keys.find("km") != std::string::npos ? 3u : keys.find("target") != std::string::npos ? 2u : 0u);
  }
}

TEST(PreviewCamera, IsNotToStandInTheGroundNorToLookForAHeightThatIsNotThere) {
  const geometry::Terrain terrain = ridge();
  const auto refused = [&](const std::string& keys) -> std::string {
    try {
      check_camera(read("[preview]\n" + keys), terrain, 48, 24);
    } catch (const InputError& error) {
      EXPECT_EQ(error.faults().front().place.line, 2);
      return error.faults().front().message;
    }
    return "";
  };
  // From the foot of the ridge towards it, level: inside.
  EXPECT_NE(refused("target = [2667430, 6478750]\ndistance = 20\nazimuth = 0\nelevation = 0").find("in frame 1 the camera stands at 2667450.0, 6478750.0, which is 3.9 m in the ground"), std::string::npos);
  EXPECT_EQ(refused("target = [2667430, 6478750]\ndistance = 20\nazimuth = \"180 deg\"\nelevation = 0"), "") << "on the other side it stands in the air";
  // It turns into the ridge within the film.
  const std::string turned = refused("target = [2667430, 6478750]\ndistance = 20\nazimuth = \"180 deg\"\nelevation = 0\nturn = \"90 deg/s\"");
  EXPECT_NE(turned.find("in frame "), std::string::npos) << turned;
  EXPECT_EQ(turned.find("in frame 1 "), std::string::npos) << turned;
  EXPECT_NE(refused("target = [2660000, 6478750]\ndistance = 20").find("give it a z"), std::string::npos);
  EXPECT_EQ(refused("target = [2660000, 6478750, 200]\ndistance = 20"), "");
  // Without pictures nobody stands there.
  EXPECT_EQ(refused("pictures = false\ntarget = [2667430, 6478750]\ndistance = 20\nazimuth = 0\nelevation = 0"), "");
}

}  // namespace
}  // namespace effuse::skin
