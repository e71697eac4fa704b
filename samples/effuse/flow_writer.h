#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "flow/sph/flow_map.h"
#include "samples/effuse/load_scene.h"

namespace effuse {

/// What a run writes for people who study flows, of the scene's first effect with particles; nothing of it is
/// allocated when [output] asks for neither maps nor series, or there is no such effect.
///
///   flow.csv                    one line a frame, columns below
///   maps/max_thickness.tif      GeoTIFF and ESRI ASCII (.asc, .prj) on the terrain's cells and in its coordinate
///   maps/max_temperature.tif    system; nodata -9999 where nothing came. [m], [K], [s], [m].
///   maps/arrival_time.tif       the first frame's time at which lava is thicker than output.arrival_thickness
///   maps/deposit.tif            thickness at the last frame; 0 where lava came and left
///   maps/thickness.0010.tif     with output.thickness_every: at these frames
///
/// Columns of flow.csv; a field is empty where the effect does not say, or where there is nothing to say it of:
///   frame, time_s
///   front_m, front_x, front_y   distance from the nearest vent, seen from above, straight, within which all but half a per cent of the
///                               volume lies (flow::sph::find_front), and the particle there; map coordinates
///   inundated_m2                cells of the map reached so far (as arrival_time has them), whole: cells much wider than
///                               particles read high (Maunga Whau at its end, 10 m cells, particles of 1.35 m: 19,200
///                               where 15,300 are covered; output.map_cell)
///   covered_m2                  where particles lie now, to half a particle
///   volume_m3                   present
///   discharge_m3_s              let out by the vents, mean since the frame before
///   max_speed_m_s, mean_temperature_K, max_temperature_K, min_temperature_K   over particles: of the effect's figures
///                               if it has all three temperatures, else of what its points show (their surfaces, maybe)
///   radiated_J convected_J ground_J vent_J stored_J viscous_J left_J   heat budget since the start; columns are there for the terms that
///                               the effect has among its figures (the classic lava has none)
///   crushed, stopped            with obstacles: times, since the start, that a particle found no room among them, or was held because
///                               it met too many in one step (geometry::Slid)
///
/// Everything is sampled at frames: a run of more frames a second sees more. What has been gathered is kept beside
/// each checkpoint (checkpoints/flow.0042.state), so that a run resumed writes the same bytes.
class FlowWriter {
 public:
  /// Writes nothing. loaded outlives this, its simulation too.
  FlowWriter(const LoadedScene& loaded, std::filesystem::path folder);

  /// Takes in the simulation's newest frame; writes its thickness if asked to.
  void add_frame();
  /// flow.csv up to the newest frame.
  void write_series() const;
  /// The four maps up to the newest frame.
  void write_maps() const;

  /// What has been gathered, to stand beside the checkpoint of the simulation's frame: to be called before that is
  /// written, so that a run killed in between has none without its record.
  void save_record() const;
  /// Removes the records whose checkpoints are gone.
  void remove_old_records() const;
  /// Goes back to what had been gathered at the simulation's frame. False when its record is missing or damaged, the
  /// state here as it was. Throws InputError when it was gathered with other settings.
  /// scene_key: of the record, where it is not this scene's.
  bool restore(const std::string& scene_key = {});

  /// For the manifest: name and path of what has been written.
  std::vector<std::pair<std::string, std::string>> files() const;

 private:
  std::filesystem::path record_file(int frame) const;
  void write_map(const std::string& name, flow::sph::FlowMap::Layer layer, const std::string& unit, const std::string& description) const;
  std::string row(const flow::Effect& effect);

  const LoadedScene& loaded_;
  std::filesystem::path folder_;
  const flow::Effect* effect_ = nullptr;  // null: nothing to do
  std::vector<flow::sph::PlanLine> vents_;
  std::vector<std::string> budget_;  // columns
  std::optional<flow::sph::FlowMap> map_;

  // Of the frames so far, all of it in the record.
  std::string rows_;
  Real last_time_ = 0, last_emitted_ = 0;  // [s], [kg]
};

/// Throws InputError at the scene's line when the map its [output] asks for would be too large.
void check_map(const skin::SkinSettings& settings, const geometry::Terrain& terrain, const flow::Simulation& simulation);

}  // namespace effuse
