#include "samples/effuse/branch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>

#include "flow/scene/simulation.h"
#include "geometry/base/error.h"
#include "importers/scene/scene_file.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {

/// Of [lava]: what the particles of the frame before are made for, or their heat counts from.
const std::set<std::string> kOfParticles = {"lava.model", "lava.spacing", "lava.support", "lava.kernel", "lava.density", "lava.heat.on", "lava.heat.crust",
                                            "lava.heat.crust_cells", "lava.heat.heat_capacity", "lava.heat.latent_heat", "lava.heat.solidus", "lava.heat.liquidus",
                                            "lava.crust_blocks.on", "lava.crust_blocks.size", "lava.heat_capacity"};

/// "lava.vent[0].rate" -> its value as TOML has it.
void flatten(const flow::Node& node, const std::string& path, std::map<std::string, std::string>& out) {
  const auto is_table = [](const flow::Node& each) { return each.kind == flow::Node::Kind::kTable; };
  if (is_table(node)) {
    for (const auto& [name, value] : node.entries) flatten(value, path.empty() ? name : path + "." + name, out);
  } else if (node.kind == flow::Node::Kind::kArray && !node.items.empty() && std::all_of(node.items.begin(), node.items.end(), is_table)) {
    for (std::size_t k = 0; k < node.items.size(); ++k) flatten(node.items[k], fmt::format("{}[{}]", path, k), out);
  } else {
    flow::Node one;
    one.set("v", node);
    std::string text = importers::to_toml(one);
    text.erase(0, text.find("= ") + 2);
    while (!text.empty() && text.back() == '\n') text.pop_back();
    out[path] = text;
  }
}

bool may_change(const std::string& key, bool in_both) {
  const std::string table = key.substr(0, key.find_first_of(".["));
  if (table == "skin" || table == "output" || table == "preview" || key == "name" || key == "film.frames") return true;
  return table == "lava" && in_both && !kOfParticles.contains(key);
}

}  // namespace

std::vector<std::string> changes_between(const flow::Node& before, const flow::Node& now) {
  std::map<std::string, std::string> old_values, new_values;
  flatten(before, "", old_values);
  flatten(now, "", new_values);
  std::map<std::string, std::string> changed;
  for (const auto& [key, value] : new_values)
    if (const auto was = old_values.find(key); was == old_values.end()) changed[key] = "none -> " + value;
    else if (was->second != value) changed[key] = was->second + " -> " + value;
  for (const auto& [key, value] : old_values)
    if (!new_values.contains(key)) changed[key] = value + " -> none";
  std::vector<std::string> told;
  std::vector<Fault> faults;
  for (const auto& [key, change] : changed) {
    const std::string line = key + ": " + change;
    if (may_change(key, old_values.contains(key) && new_values.contains(key))) told.push_back(line);
    else faults.push_back({Place{"--from-frame"}, line + " cannot come in the midst of a run: the frames before it were made with another; start anew in another folder"});
  }
  if (!faults.empty()) throw InputError(faults);
  return told;
}

fs::path checkpoint_after(const fs::path& folder, int frame) {
  std::vector<int> others;
  for (const fs::path& checkpoint : flow::checkpoints(folder)) {
    const std::string name = checkpoint.filename().string();
    const int number = std::atoi(name.c_str() + name.find('.') + 1);
    if (number == frame) return checkpoint;
    others.insert(others.begin(), number + 1);
  }
  std::string list;
  for (const int other : others) list += (list.empty() ? "" : ", ") + std::to_string(other);
  throw InputError(Place{"--from-frame"}, others.empty() ? fmt::format("{} holds no checkpoint", folder.string())
                                                         : fmt::format("no checkpoint stands after frame {}: with those there are it may be {}; output.checkpoint_every says how often one is kept", frame, list));
}

}  // namespace effuse
