#include "samples/effuse/flow_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/base/units.h"
#include "geometry/base/zones.h"
#include "importers/scene/scene_file.h"
#include "skin/write/raster.h"

namespace effuse {

namespace fs = std::filesystem;
using flow::sph::FlowMap;
using flow::sph::PlanLine;
using Layer = FlowMap::Layer;

namespace {

constexpr std::string_view kMagic = "effuse flow record 4";
constexpr const char* kHeader =
    "frame,time_s,front_m,front_x,front_y,inundated_m2,covered_m2,volume_m3,discharge_m3_s,max_speed_m_s,mean_temperature_K,max_temperature_K,min_temperature_K";
constexpr const char* kHeatBudget[] = {"radiated_J", "convected_J", "ground_J", "vent_J", "stored_J", "viscous_J", "left_J"};

constexpr const char* kAmongObstacles[] = {"crushed", "stopped"};

const flow::Effect* first_with_particles(const flow::Simulation& simulation) {
  for (const auto& effect : simulation.effects())
    if (effect->spacing() > 0) return effect.get();
  return nullptr;
}

/// A point of a resolved scene, whose lengths are texts with their unit.
std::optional<Vec2> point(const flow::Node& table, const char* key) {
  const flow::Node* array = table.find(key);
  if (!array || array->items.size() != 2) return std::nullopt;
  return Vec2(parse_quantity(array->items[0].text, "m"), parse_quantity(array->items[1].text, "m"));
}

/// The vents of an effect, in the terrain's local frame: from the resolved scene, which has them as they were built.
std::vector<PlanLine> vents_of(const std::string& resolved, std::string_view effect, const Vec2& origin) {
  std::vector<PlanLine> vents;
  const flow::Node scene = importers::read_scene_text(resolved, "resolved scene");
  const flow::Node* table = scene.find(std::string(effect));
  const flow::Node* list = table ? table->find("vent") : nullptr;
  if (!list) return vents;
  for (const flow::Node& vent : list->items) {
    const std::optional<Vec2> at = point(vent, "at"), from = point(vent, "from"), to = point(vent, "to");
    if (at) vents.push_back({*at - origin, *at - origin});
    else if (from && to) vents.push_back({*from - origin, *to - origin});
  }
  return vents;
}

/// A field: as many digits as tell neighbouring millimetres of a map apart; empty for what is not there.
std::string field(std::optional<Real> value) { return value && std::isfinite(*value) ? fmt::format("{:.10g}", *value) : ""; }

}  // namespace

FlowWriter::FlowWriter(const LoadedScene& loaded, fs::path folder) : loaded_(loaded), folder_(std::move(folder)) {
  const skin::SkinSettings& s = loaded.skin;
  if (!s.maps && !s.series) return;
  effect_ = first_with_particles(*loaded.simulation);
  if (!effect_) return;
  const Real spacing = effect_->spacing();
  map_.emplace(flow::sph::map_grid(*loaded.terrain, s.map_cell, spacing), s.arrival_thickness > 0 ? s.arrival_thickness : spacing / 2);
  for (const char* term : kHeatBudget)
    for (const auto& [name, value] : effect_->figures())
      if (name == term) budget_.emplace_back(term);
  for (const char* count : kAmongObstacles)
    for (const auto& [name, value] : effect_->figures())
      if (name == count) budget_.emplace_back(count);
  vents_ = vents_of(loaded.resolved, effect_->name(), loaded.terrain->georeference().origin.head<2>());
}

void check_map(const skin::SkinSettings& settings, const geometry::Terrain& terrain, const flow::Simulation& simulation) {
  const flow::Effect* effect = first_with_particles(simulation);
  if (!effect || (!settings.maps && !settings.series)) return;
  try {
    flow::sph::map_grid(terrain, settings.map_cell, effect->spacing());
  } catch (const InputError& error) {
    throw InputError(settings.map_cell_place, "output.map_cell: " + error.faults().front().message);
  }
}

void FlowWriter::add_frame() {
  if (!effect_) return;
  ZONE("flow.measure");
  const flow::Simulation& simulation = *loaded_.simulation;
  map_->add(simulation.time(), effect_->points(), effect_->volume());
  rows_ += row(*effect_);
  const int every = loaded_.skin.thickness_every;
  if (loaded_.skin.maps && every > 0 && simulation.frame() % every == 0)
    write_map(fmt::format("thickness.{:04}", simulation.frame()), Layer::kThickness, "m", fmt::format("Thickness of the flow at {} s", field(simulation.time())));
}

std::string FlowWriter::row(const flow::Effect& effect) {
  const auto figures = effect.figures();
  const auto figure = [&](std::string_view name) -> std::optional<Real> {
    for (const auto& [key, value] : figures)
      if (key == name) return value;
    return std::nullopt;
  };
  const flow::Simulation& simulation = *loaded_.simulation;
  const geometry::Points points = effect.points();
  const std::size_t n = points.size();
  const Vec2 origin = loaded_.terrain->georeference().origin.head<2>();
  const Real time = simulation.time(), volume = effect.volume();

  const std::optional<flow::sph::Front> front = flow::sph::find_front(points, vents_);

  // What the vents let out, from its mass and the density of what is there.
  std::optional<Real> discharge;
  const std::optional<Real> emitted = figure("mass_emitted_kg"), present = figure("mass_present_kg");
  if (emitted && *emitted == last_emitted_) discharge = 0;
  else if (emitted && present && *present > 0 && time > last_time_) discharge = (*emitted - last_emitted_) * (volume / *present) / (time - last_time_);
  last_emitted_ = emitted.value_or(0);
  last_time_ = time;

  // An effect whose particles show the temperature of their surface has figures of the whole; all three, or none.
  std::optional<Real> speed, mean, hottest, coldest;
  if (points.velocity.size() == n && n > 0) speed = parallel_max(n, 0, [&](std::size_t p) { return points.velocity[p].norm(); });
  if (points.temperature.size() == n && n > 0) {
    const auto T = [&](std::size_t p) { return points.temperature[p]; };
    mean = parallel_sum(n, 0.0, T) / static_cast<Real>(n);
    hottest = parallel_max(n, 0, T);
    coldest = -parallel_max(n, -1e300, [&](std::size_t p) { return -T(p); });
    const auto own_mean = figure("mean_temperature_K"), own_hottest = figure("max_temperature_K"), own_coldest = figure("min_temperature_K");
    if (own_mean && own_hottest && own_coldest) {
      mean = own_mean;
      hottest = own_hottest;
      coldest = own_coldest;
    }
  }

  std::string line = fmt::format("{}", simulation.frame());
  const auto add = [&](std::optional<Real> value) { line += "," + field(value); };
  add(time);
  add(front ? std::optional(front->distance) : std::nullopt);
  add(front ? std::optional(origin.x() + front->at.x()) : std::nullopt);
  add(front ? std::optional(origin.y() + front->at.y()) : std::nullopt);
  add(map_->inundated_area());
  add(flow::sph::covered_area(points));
  add(volume);
  add(discharge);
  add(speed);
  add(mean);
  add(hottest);
  add(coldest);
  for (const std::string& term : budget_) add(figure(term));
  return line + "\n";
}

void FlowWriter::write_series() const {
  if (!effect_ || !loaded_.skin.series) return;
  ZONE("write.flow_csv");
  std::string header = kHeader;
  for (const std::string& term : budget_) header += "," + term;
  write_file(folder_ / "flow.csv", header + "\n" + rows_);
}

void FlowWriter::write_map(const std::string& name, Layer layer, const std::string& unit, const std::string& description) const {
  const flow::sph::MapGrid& grid = map_->grid();
  const geometry::Georeference& geo = loaded_.terrain->georeference();
  skin::Raster raster;
  raster.corner = geo.origin.head<2>() + grid.corner;
  raster.cell = grid.cell;
  raster.nx = grid.nx;
  raster.ny = grid.ny;
  raster.values = map_->layer(layer);
  raster.crs = geo.crs;
  raster.unit = unit;
  raster.description = description;
  if (loaded_.skin.map_tif) skin::write_geotiff(folder_ / "maps" / (name + ".tif"), raster);
  if (loaded_.skin.map_asc) skin::write_esri_ascii(folder_ / "maps" / (name + ".asc"), raster);
}

void FlowWriter::write_maps() const {
  if (!effect_ || !loaded_.skin.maps) return;
  ZONE("write.maps");
  write_map("max_thickness", Layer::kMaxThickness, "m", "Largest thickness of the flow");
  write_map("max_temperature", Layer::kMaxTemperature, "K", "Highest temperature of the flow");
  write_map("arrival_time", Layer::kArrivalTime, "s", fmt::format("Time at which the flow first is thicker than {} m", field(map_->arrival_thickness())));
  write_map("deposit", Layer::kThickness, "m", fmt::format("Thickness of the flow at its last frame, {} s", field(last_time_)));
}

fs::path FlowWriter::record_file(int frame) const { return folder_ / "checkpoints" / fmt::format("flow.{:04}.state", frame); }

void FlowWriter::save_record() const {
  if (!effect_) return;
  ZONE("checkpoint");
  StateWriter out;
  out.text("magic", kMagic);
  out.text("scene", loaded_.key);
  out.value("frame", loaded_.simulation->frame());
  out.text("rows", rows_);
  out.value("last_time", last_time_);
  out.value("last_emitted", last_emitted_);
  map_->save(out);
  out.text("end", "end");
  StateHash hash;
  hash.add(std::string_view(out.bytes()));
  write_file(record_file(loaded_.simulation->frame()), out.bytes() + hash.hex());
}

void FlowWriter::remove_old_records() const {
  std::vector<fs::path> kept;
  for (const fs::path& checkpoint : flow::checkpoints(folder_)) {
    std::string name = checkpoint.filename().string();
    kept.push_back(folder_ / "checkpoints" / name.replace(0, name.find('.'), "flow"));
  }
  std::error_code ignored;
  std::vector<fs::path> old;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "checkpoints", ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("flow.") && name.ends_with(".state") && std::find(kept.begin(), kept.end(), entry.path()) == kept.end()) old.push_back(entry.path());
  }
  for (const fs::path& file : old) fs::remove(file, ignored);
}

bool FlowWriter::restore(const std::string& scene_key) {
  if (!effect_) return true;
  const fs::path file = record_file(loaded_.simulation->frame());
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return false;
  const std::string bytes = read_file(file), name = file.string();
  if (!flow::undamaged(bytes)) return false;
  StateReader in(bytes, name);
  std::string magic, key, rows, end;
  int frame = 0;
  Real last_time = 0, last_emitted = 0;
  in.text("magic", magic);
  in.text("scene", key);
  if (magic != kMagic || key != (scene_key.empty() ? loaded_.key : scene_key)) return false;  // left by another version, or another run
  in.value("frame", frame);
  in.text("rows", rows);
  in.value("last_time", last_time);
  in.value("last_emitted", last_emitted);
  try {
    map_->load(in, name);
  } catch (const InputError& error) {
    throw InputError(Place{name}, error.faults().front().message + "; put output.map_cell and output.arrival_thickness back, or start anew with --force");
  }
  in.text("end", end);
  CHECK_EQ(frame, loaded_.simulation->frame());
  rows_ = std::move(rows);
  last_time_ = last_time;
  last_emitted_ = last_emitted;
  return true;
}

std::vector<std::pair<std::string, std::string>> FlowWriter::files() const {
  std::vector<std::pair<std::string, std::string>> found;
  if (!effect_) return found;
  const skin::SkinSettings& s = loaded_.skin;
  std::error_code ignored;
  const auto list = [&](const std::string& name, const std::string& path) {
    if (fs::exists(folder_ / path, ignored)) found.emplace_back(name, path);
  };
  if (s.series) list("series", "flow.csv");
  if (!s.maps) return found;
  for (const char* name : {"max_thickness", "max_temperature", "arrival_time", "deposit"}) {
    if (s.map_tif) list(fmt::format("{}_tif", name), fmt::format("maps/{}.tif", name));
    if (s.map_asc) list(fmt::format("{}_asc", name), fmt::format("maps/{}.asc", name));
  }
  return found;
}

}  // namespace effuse
