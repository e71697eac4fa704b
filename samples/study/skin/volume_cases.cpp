#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include "flow/effects/registry.h"
#include "flow/scene/scene.h"
#include "flow/scene/simulation.h"
#include "geometry/base/error.h"
#include "importers/scene/scene_file.h"
#include "importers/terrain/import_terrain.h"
#include "samples/effuse/terrain_options.h"
#include "samples/study/skin/cases.h"
#include "samples/study/skin/soundness.h"

/// The skin of a real flow encloses its particles' volume.
namespace effuse::study {

namespace {

namespace fs = std::filesystem;
using skin::SkinKind;

constexpr Real kVolume = 0.03, kThin = 0.005;  // the bars
constexpr SkinKind kKinds[] = {SkinKind::kNoise, SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian};
constexpr skin::TessellationKind kBoth[] = {skin::TessellationKind::kLevelSet, skin::TessellationKind::kVoronoi};

/// samples/scenes/maunga-whau.toml with other particles; how the skin looks is left to the case.
class MountainFlow {
 public:
  MountainFlow(const std::string& spacing, int frames) {
    const fs::path file = fs::path(__FILE__).parent_path().parent_path().parent_path() / "scenes" / "maunga-whau.toml";
    root_ = importers::read_scene_file(file);
    importers::apply_override(root_, "lava.spacing=" + spacing);
    importers::apply_override(root_, fmt::format("film.frames={}", frames));
    flow::Parameters root(root_);
    scene_ = flow::read_scene(root, flow::effect_kinds());
    if (!root.faults().empty()) throw InputError(root.faults());
    terrain_ = importers::import_terrain(file.parent_path() / scene_.terrain.files.at(0), terrain_options(scene_.terrain)).terrain;
    simulation_ = std::make_unique<flow::Simulation>(scene_, flow::World{&*terrain_, scene_.seed});
  }
  bool advance() { return simulation_->frame() < scene_.frames && simulation_->advance([] { return true; }); }
  const flow::Effect& lava() const { return *simulation_->effects().front(); }
  const geometry::Terrain& ground() const { return *terrain_; }
  Real time() const { return simulation_->time(); }
  int frame() const { return simulation_->frame(); }

 private:
  flow::Node root_;
  flow::Scene scene_;
  std::optional<geometry::Terrain> terrain_;
  std::unique_ptr<flow::Simulation> simulation_;
};

std::string name_of(SkinKind kind) { return std::string(skin::kSkinKindNames[static_cast<std::size_t>(kind)]); }

/// kind: nullptr for the smooth skin.
skin::SkinOptions options_of(const flow::Effect& lava, const geometry::Points& points, skin::TessellationKind tessellation, const SkinKind* kind) {
  skin::SkinOptions options;
  options.level_set.spacing = lava.spacing();
  options.tessellation = tessellation;
  if (!kind) return options;
  options.detail.emplace();
  options.detail->kind = *kind;
  options.detail->edge = 0.25;
  options.detail->rest_ratio = points.rest_ratio;
  return options;
}

struct Resolution {
  const char *spacing, *file;
};
constexpr Resolution kResolutions[] = {{"2.5 m", "skin_film_volume"}, {"1.6 m", "skin_film_volume_fine"}};
constexpr int kFrames = 60, kEvery = 10;  // 75 s of lava; frames looked at

CaseResult film_volume() {
  CaseResult result;
  std::string counts;
  for (const Resolution& resolution : kResolutions) {
    MountainFlow flow(resolution.spacing, kFrames);
    Plot plot{resolution.file, fmt::format("Volume of the skin above the ground over the particles', {}", resolution.spacing), "time [s]", "ratio", false, false, {}};
    for (const char* what : {"particles", "smooth", "noise", "aa", "pahoehoe", "block", "obsidian"}) plot.curves.push_back({what, {}, {}, false, plot.curves.empty()});
    Real worst_residual = 0, widest_shift = 0;
    while (flow.advance()) {
      const bool last = flow.frame() == kFrames;
      if (flow.frame() % kEvery != 0) continue;
      const geometry::Points points = flow.lava().points();
      const auto ratio_of = [&](skin::TessellationKind tessellation, const SkinKind* kind) {
        const skin::SkinOptions options = options_of(flow.lava(), points, tessellation, kind);
        const skin::Skin skin = skin::make_skin(points, flow.lava().volume(), &flow.ground(), options);
        const Real ratio = volume_above(skin.mesh, flow.ground()) / flow.lava().volume();
        worst_residual = std::max(worst_residual, std::abs(skin.report.level_set.residual));
        widest_shift = std::max(widest_shift, std::abs(skin.report.level_set.shift) / flow.lava().spacing());
        if (!last) return ratio;
        const std::string which = fmt::format("{}, {}, {}", resolution.spacing, skin::kTessellationNames[static_cast<std::size_t>(tessellation)], kind ? name_of(*kind) : "smooth");
        result.measures.push_back({which + ": volume at 75 s over the particles'", "", ratio, 1, std::abs(ratio - 1), kVolume, ""});
        const bool sound = soundness(skin, points, options).sound(kThin);
        result.measures.push_back({which + ": closed, few thin triangles, regions as surface particles", "", sound ? 1.0 : 0.0, 1, sound ? 0.0 : 1.0, 0, ""});
        return ratio;
      };
      plot.curves[0].x.push_back(flow.time());
      plot.curves[0].y.push_back(1);
      for (std::size_t k = 1; k < plot.curves.size(); ++k) {
        const SkinKind* kind = k == 1 ? nullptr : &kKinds[k - 2];
        plot.curves[k].x.push_back(flow.time());
        plot.curves[k].y.push_back(ratio_of(kBoth[0], kind));
        if (last) ratio_of(kBoth[1], kind);
      }
    }
    for (std::size_t k = 1; k < plot.curves.size(); ++k) {
      Real worst = 1;
      for (const Real ratio : plot.curves[k].y)
        if (std::abs(ratio - 1) > std::abs(worst - 1)) worst = ratio;
      result.measures.push_back({fmt::format("{}, levelset, {}: volume over the particles', worst frame", resolution.spacing, plot.curves[k].name), "", worst, 1, std::abs(worst - 1), kVolume, ""});
    }
    counts += fmt::format("{}{} particles of {} in the end (the level set's own volume is {:.2g} % off at worst, its shift {:.2f} spacings)", counts.empty() ? "" : ", ",
                          flow.lava().points().size(), resolution.spacing, 100 * worst_residual, widest_shift);
    result.plots.push_back(std::move(plot));
  }
  result.note = fmt::format("The sample scene's fissure on Maunga Whau: {}; every {}th of {} frames looked at, edges of a quarter spacing.", counts, kEvery, kFrames);
  return result;
}

}  // namespace

void add_volume_cases(std::vector<Case>& cases) {
  cases.push_back({"film-volume", "Displaced skins of a flow on Maunga Whau enclose its volume", "the particles' volume; samples/scenes/maunga-whau.toml", false, film_volume});
}

}  // namespace effuse::study
