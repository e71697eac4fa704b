#include <fmt/format.h>

#include <filesystem>
#include <random>

#include "geometry/base/files.h"
#include "samples/study/skin/cases.h"
#include "samples/study/skin/closeups.h"
#include "samples/study/skin/jpeg.h"
#include "skin/preview/gloss.h"
#include "skin/preview/preview.h"
#include "skin/write/png.h"

/// Close-ups of every kind of skin: to be looked at.
namespace effuse::study {

namespace {

namespace fs = std::filesystem;
using skin::SkinKind;

constexpr SkinKind kKinds[] = {SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian};
constexpr int kWidth = 320, kHeight = 240;
constexpr Real kPixels = 1.5;               // of the mesh's edges
constexpr std::size_t kMostBytes = 200'000;  // of the sheet
constexpr const char* kSheet = "skin-kinds.jpg";

/// A folder of its own, gone in the end.
struct Folder {
  fs::path path;
  Folder() : path(fs::temp_directory_path() / fmt::format("effuse_closeups_{:08x}", std::random_device{}())) { fs::create_directories(path); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

CaseResult closeups() {
  CaseResult result;
  const Folder folder;
  std::vector<fs::path> pictures;
  std::vector<std::string> labels;
  const skin::PreviewOptions view = view_of_toe(kWidth, kHeight);
  std::size_t particles = 0;
  Plot plot{"skin_closeups", "Light of the close-ups", "kind: 0 smooth, then as in the sheet", "mean of the picture's brightest channel, linear", false, true, {}};
  for (const CoolingStage& stage : kCoolingStages) {
    const LavaToe toe(stage);
    particles = toe.x.size();
    const skin::Preview preview(toe.ground().mesh());
    Curve light{stage.name, {}, {}, true, false};
    for (int k = 0; k <= static_cast<int>(std::size(kKinds)); ++k) {
      const SkinKind* kind = k == 0 ? nullptr : &kKinds[k - 1];
      skin::PreviewOptions lit = view;
      if (kind) lit.gloss = skin::gloss_of(*kind);
      const skin::Image image = preview.render(skin_of_toe(toe, kind, view, kPixels), lit);
      pictures.push_back(folder.path / fmt::format("{}.png", pictures.size()));
      labels.push_back(fmt::format("{} {}", kind ? skin::kSkinKindNames[static_cast<std::size_t>(*kind)] : "no displacement", stage.name));
      skin::write_png(pictures.back(), image);
      Real sum = 0;
      for (std::size_t p = 0; p < image.rgb.size(); p += 3) sum += std::max({image.rgb[p], image.rgb[p + 1], image.rgb[p + 2]});
      light.x.push_back(k);
      light.y.push_back(sum / (kWidth * kHeight));
    }
    plot.curves.push_back(std::move(light));
  }
  for (int k = 0; k <= static_cast<int>(std::size(kKinds)); ++k) {
    const auto at = static_cast<std::size_t>(k);
    const Real ratio = plot.curves[2].y[at] / plot.curves[0].y[at];
    result.measures.push_back({fmt::format("{}: light when cold over light when hot", k == 0 ? "no displacement" : skin::kSkinKindNames[static_cast<std::size_t>(kKinds[k - 1])]), "", ratio, 0, ratio, 0.2, "times"});
  }

  skin::write_contact_sheet(folder.path / "sheet.png", pictures, labels, 1 + static_cast<int>(std::size(kKinds)));
  const skin::Rgb8Image sheet = skin::read_png(folder.path / "sheet.png");
  int quality = 92;
  std::string bytes = encode_jpeg(sheet, quality);
  for (; bytes.size() > kMostBytes && quality > 40; bytes = encode_jpeg(sheet, quality)) quality -= 4;
  const auto size = static_cast<double>(bytes.size());
  result.measures.push_back({"size of the sheet", "bytes", size, kMostBytes, size, kMostBytes, "bytes"});
  result.pictures.push_back({kSheet, std::move(bytes)});
  result.plots.push_back(std::move(plot));
  result.note = fmt::format("A toe of {} particles, rendered from close by without displacement and with each kind of skin, hot, cooling and cold: pictures/{}, JPEG quality {}.", particles, kSheet, quality);
  return result;
}

}  // namespace

void add_picture_cases(std::vector<Case>& cases) {
  cases.push_back({"close-ups", "Close-ups of each kind of skin, hot, cooling, cold", "to be looked at", false, closeups});
}

}  // namespace effuse::study
