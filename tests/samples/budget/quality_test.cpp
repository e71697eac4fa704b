#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "importers/scene/scene_file.h"
#include "samples/budget/rehearsal.h"
#include "samples/effuse/load_scene.h"
#include "tests/samples/budget/run_program.h"

/// What draft, normal and fine come to on the slope of Maunga Whau, run to the end: what each takes, and how far the front moves from one to the next.
namespace effuse::budget {
namespace {

/// A minute of stiff lava from a short fissure on Maunga Whau: a crop of maunga-whau-modern.toml that fine can be paid for.
std::string crop(const std::string& head, const std::string& spacing) {
  return fmt::format("format = 1\n{}[film]\nframes = 11\nfps = 1\ntime_scale = 5\n[terrain]\nfile = \"{}/samples/scenes/maunga-whau.asc\"\n"
                     "[lava]\n{}[lava.rheology]\nviscosity = \"10000 Pa s\"\n"
                     "[[lava.vent]]\nfrom = [2667704, 6479198.5]\nto = [2667716, 6479196.5]\nwidth = \"6 m\"\nrate = \"40 m3/s\"\nramp = \"5 s\"\n"
                     "[output]\nformats = [\"ply\"]\n[preview]\npictures = false\n",
                     head, EFFUSE_SOURCE_DIR, spacing);
}

TEST(QualitySlow, DraftIsFarCheaperAndNearbyAndFineIsConverged) {
  const TestFolder folder;
  std::vector<Rehearsal> runs;
  for (const char* quality : {"draft", "normal", "fine"}) {
    const std::unique_ptr<LoadedScene> chosen = load_scene(folder.write("chosen.toml", crop(fmt::format("quality = \"{}\"\n", quality), "")), {}, 0);
    // With the tolerances and the step that were chosen, too.
    const flow::Node scene = importers::read_scene_text(chosen->resolved, "chosen");
    runs.push_back(rehearse(scene, flow::World{&*chosen->terrain, chosen->scene.seed}, chosen->forecast->spacing, 1e12));
    const Moment& end = runs.back().moments.back();
    std::cout << fmt::format("{}: particles of {:.2g} m, {} at the end, {:.3g} s; front {:.4g} m\n", quality, runs.back().spacing, end.particles, end.seconds, end.front);
  }
  const auto seconds = [&](int k) { return runs[static_cast<std::size_t>(k)].moments.back().seconds; };
  const Real draft = difference_of_fronts(runs[0], runs[1]), fine = difference_of_fronts(runs[2], runs[1]);
  std::cout << fmt::format("normal costs {:.3g} drafts, fine {:.3g} normals; front's rms difference from normal over the film: draft {:.3f}, fine {:.3f}\n", seconds(1) / seconds(0), seconds(2) / seconds(1), draft, fine);
  EXPECT_GT(seconds(1), 10 * seconds(0));
  EXPECT_LT(draft, 0.1);
  EXPECT_LT(fine, 0.02);
}

}  // namespace
}  // namespace effuse::budget
