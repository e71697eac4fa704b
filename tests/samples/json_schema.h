#pragma once

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <string>
#include <vector>

/// As much of JSON Schema (draft 2020-12) as our schema of scenes uses, after json-schema.org/draft/2020-12.
namespace effuse {

using Json = nlohmann::ordered_json;

inline bool is_of_type(const Json& value, const std::string& type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "number") return value.is_number();
  return type == "integer" && value.is_number() && value.get<double>() == std::trunc(value.get<double>());
}

/// Made once: there are few.
inline const std::regex& pattern_of(const std::string& text) {
  static std::map<std::string, std::regex> made;
  return made.try_emplace(text, text).first->second;
}

/// What a value has that its schema does not allow, a line each.
inline std::vector<std::string> schema_faults(const Json& schema, const Json& value, const std::string& at = "") {
  std::vector<std::string> faults;
  const auto tell = [&](const std::string& what) { faults.push_back(fmt::format("{}: {}", at.empty() ? "scene" : at, what)); };
  const auto below = [&](const Json& of, const Json& part, const std::string& name) {
    for (std::string& fault : schema_faults(of, part, at + name)) faults.push_back(std::move(fault));
  };
  if (schema.is_boolean()) {
    if (!schema.get<bool>()) tell("is not allowed");
    return faults;
  }
  if (schema.contains("type") && !is_of_type(value, schema["type"])) {
    tell("is no " + schema["type"].get<std::string>());
    return faults;
  }
  if (schema.contains("enum") && std::find(schema["enum"].begin(), schema["enum"].end(), value) == schema["enum"].end()) tell(value.dump() + " is none of " + schema["enum"].dump());
  if (schema.contains("anyOf")) {
    std::vector<std::string> why;
    bool any = false;
    for (const Json& one : schema["anyOf"]) {
      const std::vector<std::string> against = schema_faults(one, value, at);
      any = any || against.empty();
      if (!against.empty()) why.push_back(against.front());
    }
    if (!any) tell(fmt::format("fits none: {}", fmt::join(why, "; ")));
  }
  if (value.is_number()) {
    const double x = value.get<double>();
    if (schema.contains("minimum") && !(x >= schema["minimum"].get<double>())) tell("is below the minimum");
    if (schema.contains("maximum") && !(x <= schema["maximum"].get<double>())) tell("is above the maximum");
    if (schema.contains("exclusiveMinimum") && !(x > schema["exclusiveMinimum"].get<double>())) tell("is not above the minimum");
  }
  if (value.is_string()) {
    const auto text = value.get<std::string>();
    if (schema.contains("pattern") && !std::regex_search(text, pattern_of(schema["pattern"].get<std::string>()))) tell("'" + text + "' does not have the pattern");
    if (schema.contains("minLength") && text.size() < schema["minLength"].get<std::size_t>()) tell("is too short");
  }
  if (value.is_array()) {
    if (schema.contains("minItems") && value.size() < schema["minItems"].get<std::size_t>()) tell("has too few entries");
    if (schema.contains("maxItems") && value.size() > schema["maxItems"].get<std::size_t>()) tell("has too many entries");
    if (schema.value("uniqueItems", false) && std::set<Json>(value.begin(), value.end()).size() < value.size()) tell("has an entry twice");
    const std::size_t first = schema.contains("prefixItems") ? schema["prefixItems"].size() : 0;
    for (std::size_t k = 0; k < value.size(); ++k) {
      if (k < first) below(schema["prefixItems"][k], value[k], fmt::format("[{}]", k));
      else if (schema.contains("items")) below(schema["items"], value[k], fmt::format("[{}]", k));
    }
  }
  if (value.is_object()) {
    for (const auto& [key, part] : value.items()) {
      if (schema.contains("properties") && schema["properties"].contains(key)) below(schema["properties"][key], part, "." + key);
      else if (schema.contains("additionalProperties")) below(schema["additionalProperties"], part, "." + key);
    }
    if (schema.contains("required"))
      for (const Json& key : schema["required"])
        if (!value.contains(key.get<std::string>())) tell("lacks " + key.get<std::string>());
  }
  return faults;
}

/// Where a schema is none: keywords that the meta-schema does not have or that schema_faults() does not know, values of another kind than it wants.
inline std::vector<std::string> faults_of_schema(const Json& schema, const std::string& at = "#") {
  std::vector<std::string> faults;
  if (schema.is_boolean()) return faults;
  if (!schema.is_object()) return {at + ": is neither an object nor true or false"};
  static const std::set<std::string> types = {"object", "array", "string", "boolean", "number", "integer"};
  for (const auto& [word, value] : schema.items()) {
    const std::string here = at + "/" + word;
    const auto whole = [](const Json& n) { return n.is_number_integer() && n.get<std::int64_t>() >= 0; };
    const auto each = [&](const Json& all, bool named) {
      for (const auto& [name, one] : all.items()) {
        for (std::string& fault : faults_of_schema(one, here + "/" + name)) faults.push_back(std::move(fault));
      }
      if (named != all.is_object() || (!named && all.empty())) faults.push_back(here + ": wrong kind");
    };
    bool good = true;
    if (word == "$schema" || word == "title" || word == "description" || word == "x-unit") good = value.is_string();
    else if (word == "type") good = value.is_string() && types.contains(value);
    else if (word == "properties") each(value, true);
    else if (word == "prefixItems" || word == "anyOf") each(value, false);
    else if (word == "items" || word == "additionalProperties") {
      for (std::string& fault : faults_of_schema(value, here)) faults.push_back(std::move(fault));
    } else if (word == "required") {
      good = value.is_array() && std::set<Json>(value.begin(), value.end()).size() == value.size();
      for (const Json& key : value) good = good && key.is_string() && schema.contains("properties") && schema["properties"].contains(key.get<std::string>());
    } else if (word == "enum") good = value.is_array() && !value.empty();
    else if (word == "minItems" || word == "maxItems" || word == "minLength") good = whole(value);
    else if (word == "uniqueItems") good = value.is_boolean();
    else if (word == "minimum" || word == "maximum" || word == "exclusiveMinimum") good = value.is_number();
    else if (word == "pattern") {
      good = value.is_string();
      if (good) std::regex(value.get<std::string>());  // throws if it is none
    } else if (word != "default") {
      faults.push_back(here + ": no keyword known here");
    }
    if (!good) faults.push_back(here + ": " + value.dump() + " is not what this keyword has");
  }
  return faults;
}

}  // namespace effuse
