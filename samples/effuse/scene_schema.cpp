#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "flow/effects/registry.h"
#include "flow/scene/scene.h"
#include "geometry/base/units.h"
#include "samples/effuse/scene_keys.h"
#include "skin/scene/skin_settings.h"

namespace effuse {

namespace {

using flow::KeyDoc;
using flow::ParameterDoc;
using nlohmann::ordered_json;
using Kind = ParameterDoc::Kind;

// A number, then a unit as geometry/base/units.h reads them: letters, %, powers, products, quotients, parentheses.
constexpr const char* kQuantity = R"(^\s*[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?(\s*[A-Za-z%(][-A-Za-z0-9%^*/.() ]*|\s+1/[A-Za-z(][-A-Za-z0-9^*/.() ]*|\s*)$)";

ordered_json number(const ParameterDoc& doc, bool in_range) {
  ordered_json bare = {{"type", "number"}};
  if (in_range && std::isfinite(doc.low)) bare[doc.open_low ? "exclusiveMinimum" : "minimum"] = doc.low;
  if (in_range && std::isfinite(doc.high)) bare["maximum"] = doc.high;
  return {{"anyOf", {bare, {{"type", "string"}, {"pattern", kQuantity}}}}};
}

ordered_json array_of(ordered_json items, std::size_t count) {
  ordered_json j = {{"type", "array"}, {"items", std::move(items)}};
  if (count > 0) j["minItems"] = j["maxItems"] = count;
  return j;
}

/// What one value may be; tables are made of their keys.
ordered_json value(const ParameterDoc& doc) {
  switch (doc.kind) {
    case Kind::kNumber:
      return number(doc, true);
    case Kind::kCurve: {
      ParameterDoc time = doc;
      time.si_unit = "s";
      ordered_json key = {{"type", "array"}, {"minItems", 2}, {"maxItems", 5}};
      key["prefixItems"] = {number(time, false), number(doc, true), {{"enum", {"linear", "hold", "smooth", "catmull_rom", "bezier"}}}, number(doc, false), number(doc, false)};
      ordered_json keys = {{"type", "array"}, {"minItems", 1}, {"items", key}};
      ordered_json either = number(doc, true);
      either["anyOf"].push_back(std::move(keys));
      return either;
    }
    case Kind::kInteger: {
      ordered_json j = {{"type", "integer"}};
      // Bounds beyond 2^53 are those of the type, and a reader of JSON may round them.
      constexpr Real kExact = 9007199254740992.0;
      if (std::abs(doc.low) < kExact) j["minimum"] = static_cast<std::int64_t>(doc.low);
      if (std::abs(doc.high) < kExact) j["maximum"] = static_cast<std::int64_t>(doc.high);
      return j;
    }
    case Kind::kFlag:
      return {{"type", "boolean"}};
    case Kind::kText:
      return {{"type", "string"}};
    case Kind::kTexts:
      return array_of({{"type", "string"}}, doc.count);
    case Kind::kTextOrTexts: {
      const ordered_json one = {{"type", "string"}, {"minLength", 1}};
      return {{"anyOf", {one, {{"type", "array"}, {"minItems", 1}, {"items", one}}}}};
    }
    case Kind::kChoice:
      return {{"enum", doc.names}};
    case Kind::kChoices:
      return {{"type", "array"}, {"uniqueItems", true}, {"items", {{"enum", doc.names}}}};
    case Kind::kNumbers:
      return array_of(number(doc, false), doc.count);
    case Kind::kNumberLists:
      return array_of(array_of(number(doc, false), doc.count), 0);
    case Kind::kTable:
    case Kind::kTables:
      break;
  }
  return ordered_json::object();
}

/// The default as a scene would say it; null: none.
ordered_json usual(const ParameterDoc& doc) {
  const std::string& text = doc.default_value;
  if (text.empty()) return nullptr;
  switch (doc.kind) {
    case Kind::kNumber:
    case Kind::kCurve:
      return doc.si_unit.empty() ? ordered_json(parse_quantity(text, "")) : ordered_json(text);
    case Kind::kInteger:
      return std::stoll(text);
    case Kind::kFlag:
      return text == "true";
    case Kind::kText:
      return text == "\"\"" ? "" : text;
    case Kind::kChoice:
      return text;
    default:
      return nullptr;
  }
}

/// The table of the schema that a path's parent is: "lava.vent[]" is properties/lava/properties/vent/items.
ordered_json& table_at(ordered_json& root, std::string_view path) {
  ordered_json* table = &root;
  while (!path.empty()) {
    const std::size_t dot = path.find('.');
    std::string key(path.substr(0, dot));
    const bool array = key.ends_with("[]");
    if (array) key.resize(key.size() - 2);
    table = &(*table)["properties"][key];
    if (array) table = &(*table)["items"];
    path.remove_prefix(dot == std::string_view::npos ? path.size() : dot + 1);
  }
  return *table;
}

ordered_json table(const std::string& what) {
  ordered_json j = {{"type", "object"}};
  if (!what.empty()) j["description"] = what;
  j["properties"] = ordered_json::object();
  j["additionalProperties"] = false;
  return j;
}

}  // namespace

std::vector<KeyDoc> scene_keys() {
  std::vector<KeyDoc> keys = flow::explore([](flow::Parameters& root) {
    flow::read_scene(root, flow::effect_kinds());
    skin::read_skin_settings(root);
  });
  // Before its readers see it, load_scene() chooses what a scene with accuracy or quality leaves open.
  for (KeyDoc& key : keys) {
    if (key.path != "lava.spacing") continue;
    key.required = false;
    ParameterDoc chosen{key.path, "choice: auto", "", "chosen, where accuracy or quality say how right", Kind::kChoice};
    chosen.names = {"auto"};
    key.variants.push_back(std::move(chosen));
  }
  return keys;
}

std::string scene_schema(const std::vector<KeyDoc>& keys) {
  ordered_json schema = table("");
  schema["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  schema["title"] = "A scene of effuse";
  for (const KeyDoc& key : keys) {
    const ParameterDoc& doc = key.variants.front();
    const std::size_t dot = key.path.rfind('.');
    ordered_json& parent = table_at(schema, dot == std::string::npos ? "" : std::string_view(key.path).substr(0, dot));
    std::string name = key.path.substr(dot == std::string::npos ? 0 : dot + 1);
    if (doc.kind == Kind::kTables) name.resize(name.size() - 2);
    ordered_json one;
    if (doc.kind == Kind::kTable) {
      one = table(doc.what);
    } else if (doc.kind == Kind::kTables) {
      one = {{"type", "array"}, {"description", doc.what}, {"items", table("")}};
    } else {
      if (key.variants.size() == 1) one = value(doc);
      else
        for (const ParameterDoc& variant : key.variants) one["anyOf"].push_back(value(variant));
      std::string what = doc.what, unit;
      for (const ParameterDoc& variant : key.variants)
        if (!variant.si_unit.empty() && unit.find(variant.si_unit) == std::string::npos) unit += (unit.empty() ? "" : " or ") + variant.si_unit;
      if (!unit.empty()) what += fmt::format(" [{}]", unit);
      if (const std::string range = flow::range_of(doc); key.variants.size() == 1 && !range.empty()) what += (what.empty() ? "" : "; ") + range;
      if (!key.with.empty()) what += fmt::format("; with {}", key.with);
      one["description"] = what;
      if (!unit.empty()) one["x-unit"] = unit;
      if (const ordered_json other = usual(doc); !other.is_null()) one["default"] = other;
    }
    parent["properties"][name] = std::move(one);
    if (key.required) parent["required"].push_back(name);
  }
  return schema.dump(1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace effuse
