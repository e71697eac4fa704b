#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include "geometry/base/units.h"
#include "samples/effuse/import_report_internal.h"
#include "samples/effuse/terrain_options.h"

namespace effuse {

namespace {

using flow::Node;

/// The options as a scene's [terrain] has them, so that one reader reads both.
Node terrain_table(const ImportCommand& c, bool is_grid) {
  Node table;
  const auto text = [&](const char* key, const std::string& value) {
    if (value.empty()) return;
    Node& node = table.set(key, Node{});
    node.kind = Node::Kind::kText;
    node.text = value;
  };
  const auto numbers = [&](const char* key, const std::vector<double>& values) {
    if (values.empty()) return;
    Node& node = table.set(key, Node{});
    node.kind = Node::Kind::kArray;
    for (const double value : values) {
      Node& item = node.items.emplace_back();
      item.kind = Node::Kind::kReal;
      item.real = value;
    }
  };
  text("crs", c.crs);
  numbers("crop", c.crop);
  // Of grids.
  text("file_crs", c.file_crs);
  for (std::string_view rest = c.resample; !rest.empty();) {
    const std::string_view part = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(rest.size(), part.size() + 1));
    const bool length = part.find_first_of("-+.0123456789") == 0;
    const char* key = length ? "spacing" : "resample";
    if (table.find(key)) throw InputError(Place{}, fmt::format("--resample: '{}' is the second {}, wanted one", part, length ? "distance" : "method"));
    if (length && metres(std::string(part), "--resample") == 0) throw InputError(Place{}, "--resample: posts 0 m apart, wanted more");
    text(key, std::string(part));
  }
  text("vertical_unit", c.vertical_unit);
  text("holes", c.holes);
  const std::size_t colon = std::min(c.pits.find(':'), c.pits.size());
  text("pits", c.pits.substr(0, colon));
  if (colon < c.pits.size() && c.pits.substr(0, colon) == "keep") throw InputError(Place{}, "--pits: keep leaves them all, and needs no depth");
  if (colon < c.pits.size()) text("pit_depth", c.pits.substr(colon + 1));
  numbers("size", c.size);
  numbers("range", c.range);
  // Of meshes; of a grid's mesh max_error means another thing.
  text("up", c.up);
  text("unit", c.unit);
  if (c.keep) table.set("repair", Node{}).kind = Node::Kind::kFlag;
  text("stitch", c.stitch);
  text("fill_holes", c.fill_holes == "all" ? "1e30 m" : c.fill_holes);
  if (!is_grid) text("max_error", c.max_error);
  text("edge", c.edge);
  return table;
}

/// The option that a key is given by.
std::string option_of(std::string key) {
  if (key == "spacing") return "--resample";
  if (key == "pit_depth") return "--pits";
  if (key == "repair") return "--keep";
  std::replace(key.begin(), key.end(), '_', '-');
  return "--" + key;
}

}  // namespace

Real metres(const std::string& text, const char* option) {
  try {
    const Real value = parse_quantity(text, "m");
    if (value >= 0 && std::isfinite(value)) return value;
  } catch (const std::invalid_argument& error) {
    throw InputError(Place{}, fmt::format("{}: {}", option, error.what()));
  }
  throw InputError(Place{}, fmt::format("{}: '{}' is less than 0", option, text));
}

importers::TerrainImportOptions import_options(const ImportCommand& command, bool is_grid, const importers::ReadLimits& limits) {
  const Node table = terrain_table(command, is_grid);
  std::vector<Fault> faults = flow::misfits(table, "", is_grid, command.files.front().string());
  flow::Parameters parameters(table);
  flow::TerrainSettings settings;
  flow::read_terrain_keys(parameters, settings);
  for (const Fault& fault : parameters.faults()) faults.push_back(fault);
  // A key's 0 is its default: not asked for.
  for (const auto& [key, value] : {std::pair{"spacing", settings.spacing}, {"edge", settings.edge}})
    if (faults.empty() && table.find(key) && value == 0) faults.push_back({Place{}, std::string(key) + ": 0 m, wanted more"});
  for (Fault& fault : faults) {
    const std::size_t end = fault.message.find(':');
    fault.message = option_of(fault.message.substr(0, end)) + fault.message.substr(end);
  }
  if (!faults.empty()) throw InputError(faults);
  importers::TerrainImportOptions options = terrain_options(settings, limits);
  options.dem.max_posts = command.max_posts;
  return options;
}

}  // namespace effuse
