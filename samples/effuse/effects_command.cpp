#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "samples/effuse/commands.h"
#include "samples/effuse/scene_keys.h"

namespace effuse {

namespace {

using flow::KeyDoc;
using flow::ParameterDoc;
using nlohmann::ordered_json;

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
  if (command.markdown) {
    fmt::print("{}", scene_reference(keys));
    return ExitCode::kDone;
  }
  ordered_json all = ordered_json::array();
  for (const ScenePart& part : scene_parts(keys)) {
    ordered_json entries = ordered_json::array();
    if (!common.json) fmt::print("[{}]  {}\n", part.name, part.what);
    std::string with;
    for (const KeyDoc& key : part.keys) {
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
