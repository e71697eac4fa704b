#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "flow/effects/registry.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/scene_keys.h"

namespace effuse {

namespace {

using flow::KeyDoc;
using flow::ParameterDoc;
using nlohmann::ordered_json;

/// The table of a scene that a key stands in, or is: "lava", "particles"; "" of those beside all tables.
std::string top_of(const KeyDoc& key) {
  const ParameterDoc::Kind kind = key.variants.front().kind;
  const bool table = kind == ParameterDoc::Kind::kTable || kind == ParameterDoc::Kind::kTables;
  const std::size_t end = key.path.find_first_of(".[");
  return end == std::string::npos && !table ? "" : key.path.substr(0, end);
}

void print(const KeyDoc& key) {
  for (const ParameterDoc& doc : key.variants) {
    const std::string range = flow::range_of(doc);
    fmt::print("  {:<32} {:<18} {:<18} {}{}\n", doc.path, doc.unit, doc.default_value.empty() ? key.required ? "(required)" : "-" : doc.default_value, doc.what, range.empty() ? "" : fmt::format(" ({})", range));
  }
}

ordered_json document(const KeyDoc& key) {
  const ParameterDoc& doc = key.variants.front();
  ordered_json j = {{"path", doc.path}, {"unit", doc.unit}, {"default", doc.default_value}, {"what", doc.what}};
  if (const std::string range = flow::range_of(doc); !range.empty()) j["range"] = range;
  if (!doc.names.empty()) j["choices"] = doc.names;
  if (key.required) j["required"] = true;
  if (!key.with.empty()) j["with"] = key.with;
  for (std::size_t k = 1; k < key.variants.size(); ++k) j["or"].push_back({{"unit", key.variants[k].unit}, {"default", key.variants[k].default_value}, {"what", key.variants[k].what}});
  return j;
}

}  // namespace

ExitCode effects(const EffectsCommand& command, const CommonOptions& common) {
  const std::vector<KeyDoc> keys = scene_keys();
  if (command.schema) {
    print_document(scene_schema(keys));
    return ExitCode::kDone;
  }
  struct Part {
    std::string name, what;
    bool effect;
  };
  // Effects first, then the other tables.
  std::vector<Part> parts;
  for (const flow::EffectKind& kind : flow::effect_kinds()) parts.push_back({kind.name, kind.what, true});
  for (const KeyDoc& key : keys)
    if (const std::string top = top_of(key); std::none_of(parts.begin(), parts.end(), [&](const Part& part) { return part.name == top; })) parts.push_back({top, top.empty() ? "beside all tables" : key.variants.front().what, false});
  ordered_json all = ordered_json::array();
  for (const Part& part : parts) {
    ordered_json entries = ordered_json::array();
    if (!common.json) fmt::print("[{}]  {}\n", part.name, part.what);
    std::string with;
    for (const KeyDoc& key : keys) {
      if (top_of(key) != part.name || key.path == part.name || key.path == part.name + "[]") continue;
      if (common.json) {
        entries.push_back(document(key));
        continue;
      }
      if (key.with != with) fmt::print(" with {}:\n", key.with.empty() ? "all" : key.with);
      with = key.with;
      print(key);
    }
    all.push_back({{"name", part.name}, {"what", part.what}, {"effect", part.effect}, {"parameters", entries}});
  }
  if (common.json) print_document(all.dump(1, ' ', false, ordered_json::error_handler_t::replace));
  return ExitCode::kDone;
}

}  // namespace effuse
