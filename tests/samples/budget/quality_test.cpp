#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <iostream>

#include "geometry/base/files.h"
#include "importers/scene/scene_file.h"
#include "samples/budget/rehearsal.h"
#include "samples/effuse/load_scene.h"
#include "tests/samples/budget/run_program.h"

/// What draft, normal and fine come to on the slope of Maunga Whau, run to the end: what each takes, and how far the front moves from one to the next.
namespace effuse::budget {
namespace {

/// A minute of stiff lava from a short fissure on Maunga Whau: a crop of maunga-whau-modern.toml that fine can be paid for.
std::string crop(const std::string& head) {
  return fmt::format("format = 1\n{}[film]\nframes = 11\nfps = 1\ntime_scale = 5\n[terrain]\nfile = \"{}/samples/scenes/maunga-whau.asc\"\n"
                     "[lava]\n[lava.rheology]\nviscosity = \"10000 Pa s\"\n"
                     "[[lava.vent]]\nfrom = [2667704, 6479198.5]\nto = [2667716, 6479196.5]\nwidth = \"6 m\"\nrate = \"40 m3/s\"\nramp = \"5 s\"\n"
                     "[output]\nformats = [\"ply\"]\n[preview]\npictures = false\n",
                     head, EFFUSE_SOURCE_DIR);
}

/// maunga-whau-modern.toml, without the spacing that it asks for, until `frames`.
std::string sample(const std::string& head, int frames) {
  std::string text = read_file(std::string(EFFUSE_SOURCE_DIR) + "/samples/scenes/maunga-whau-modern.toml");
  const auto replace = [&](const std::string& what, const std::string& by) {
    const std::size_t at = text.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    if (at != std::string::npos) text.replace(at, what.size(), by);
  };
  replace("format = 1\n", "format = 1\n" + head);
  replace("frames = 216", fmt::format("frames = {}", frames));
  replace("spacing = \"1.2 m\"\n", "");
  replace("\"maunga-whau.asc\"", fmt::format("\"{}/samples/scenes/maunga-whau.asc\"", EFFUSE_SOURCE_DIR));
  return text;
}

/// Runs draft, normal and fine to the end; scene_of(head): the scene with `head` in it.
template <class SceneOf>
void expect_draft_far_cheaper_and_nearby_and_fine_converged(SceneOf&& scene_of) {
  const TestFolder folder;
  std::vector<Rehearsal> runs;
  for (const char* quality : {"draft", "normal", "fine"}) {
    const std::unique_ptr<LoadedScene> chosen = load_scene(folder.write("chosen.toml", scene_of(fmt::format("quality = \"{}\"\n", quality))), {}, 0);
    // With the tolerances and the step that were chosen, too.
    const flow::Node scene = importers::read_scene_text(chosen->resolved, "chosen");
    runs.push_back(rehearse(scene, flow::World{&*chosen->terrain, chosen->scene.seed}, chosen->forecast->spacing, 1e12));
    const Moment& end = runs.back().moments.back();
    std::cout << fmt::format("{}: particles of {:.2g} m, {} at the end, {:.3g} s; front {:.4g} m", quality, runs.back().spacing, end.particles, end.seconds, end.front) << std::endl;
  }
  const auto seconds = [&](int k) { return runs[static_cast<std::size_t>(k)].moments.back().seconds; };
  const Real draft = difference_of_fronts(runs[0], runs[1]), fine = difference_of_fronts(runs[2], runs[1]);
  std::cout << fmt::format("normal costs {:.3g} drafts, fine {:.3g} normals; front's rms difference from normal over the film: draft {:.3f}, fine {:.3f}\n", seconds(1) / seconds(0), seconds(2) / seconds(1), draft, fine);
  EXPECT_GT(seconds(1), 10 * seconds(0));
  EXPECT_LT(draft, 0.1);
  EXPECT_LT(fine, 0.02);
}

TEST(QualitySlow, DraftIsFarCheaperAndNearbyAndFineIsConverged) {
  expect_draft_far_cheaper_and_nearby_and_fine_converged(crop);
}

// The eruption of the sample itself, its first minute and a half: an hour of one core.
TEST(QualitySlow, SoTheyAreOnTheSampleOfMaungaWhau) {
  if (!std::getenv("EFFUSE_HOURS")) GTEST_SKIP() << "takes an hour: set EFFUSE_HOURS";
  expect_draft_far_cheaper_and_nearby_and_fine_converged([](const std::string& head) { return sample(head, 72); });
}

}  // namespace
}  // namespace effuse::budget
