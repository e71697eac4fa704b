#include <fmt/format.h>

#include <algorithm>

#include "flow/effects/registry.h"
#include "samples/effuse/scene_keys.h"

namespace effuse {

namespace {

using flow::KeyDoc;
using flow::ParameterDoc;

bool is_table(const KeyDoc& key) {
  const ParameterDoc::Kind kind = key.variants.front().kind;
  return kind == ParameterDoc::Kind::kTable || kind == ParameterDoc::Kind::kTables;
}

/// The table at the top that a key stands in, or is.
std::string top_of(const KeyDoc& key) {
  const std::size_t end = key.path.find_first_of(".[");
  return end == std::string::npos && !is_table(key) ? "" : key.path.substr(0, end);
}

/// As a cell of a table holds it: bars would end the cell, the rest would be marks.
std::string cell(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '|' || c == '*' || c == '_' || c == '<' || c == '[' || c == ']' || c == '\\' || c == '`') out += '\\';
    out += c;
  }
  return out;
}

std::string code(const std::string& text) { return text.empty() ? "" : "`" + text + "`"; }

/// What a scene may write: choices by their names, numbers by their unit.
std::string value_of(const ParameterDoc& doc) {
  if (doc.names.empty()) return cell(doc.unit.empty() ? "number" : doc.unit);
  std::string names;
  for (const std::string& name : doc.names) names += (names.empty() ? "" : ", ") + code(name);
  return doc.kind == ParameterDoc::Kind::kChoices ? "any of " + names : names;
}

std::string default_of(const KeyDoc& key, const ParameterDoc& doc) { return doc.default_value.empty() ? key.required ? "required" : "" : code(doc.default_value); }

}  // namespace

std::vector<ScenePart> scene_parts(const std::vector<KeyDoc>& keys) {
  std::vector<ScenePart> parts;
  for (const flow::EffectKind& kind : flow::effect_kinds()) parts.push_back({kind.name, kind.what, true, {}});
  for (const KeyDoc& key : keys) {
    const std::string top = top_of(key);
    auto part = std::find_if(parts.begin(), parts.end(), [&](const ScenePart& each) { return each.name == top; });
    if (part == parts.end()) part = parts.insert(part, {top, top.empty() ? "beside all tables" : key.variants.front().what, false, {}});
    if (key.path != top && key.path != top + "[]") part->keys.push_back(key);
  }
  return parts;
}

std::string scene_reference(const std::vector<KeyDoc>& keys) {
  const std::vector<ScenePart> parts = scene_parts(keys);
  std::string text =
      "# Reference of scenes\n\n"
      "Every key that a scene may have, as the program reads it: `effuse effects --markdown` prints this page, `effuse effects` the same for a terminal, "
      "`effuse effects --schema` for editors.\n\n"
      "Numbers are SI, or text with a unit: `2` and `\"2 m\"`. `a[].b` stands in each `[[a]]`. Keys *with* another are read where that is so. "
      "A number whose meaning says keys of it may change in time: `[[\"0 s\", 1], [\"10 s\", 5]]`. A key without a default may be left out, unless it is required.\n\n";
  for (const bool effect : {true, false}) {
    text += effect ? "Effects: " : "Beside them: ";
    std::string names;
    for (const ScenePart& part : parts)
      if (part.effect == effect && !part.name.empty()) names += fmt::format("{}[{}](#{})", names.empty() ? "" : ", ", part.name, part.name);
    text += names + "\n\n";
  }
  for (const ScenePart& part : parts) {
    text += part.name.empty() ? std::string("## Beside all tables\n") : fmt::format("## {}\n\n{}\n", part.name, cell(part.what));
    const std::string* with = nullptr;
    for (const KeyDoc& key : part.keys) {
      if (!with || *with != key.with) {
        text += key.with.empty() ? with ? "\nWith all:\n" : "" : fmt::format("\nWith {}:\n", code(key.with));
        text += "\n| key | value | default | what it is |\n|---|---|---|---|\n";
      }
      with = &key.with;
      for (const ParameterDoc& doc : key.variants) {
        const std::string range = flow::range_of(doc), what = cell(doc.what);
        text += fmt::format("| {} | {} | {} | {}{} |\n", code(doc.path), is_table(key) ? "table" : value_of(doc), is_table(key) ? "" : default_of(key, doc), what, range.empty() ? "" : (what.empty() ? "" : "; ") + cell(range));
      }
    }
    text += "\n";
  }
  text.pop_back();
  return text;
}

}  // namespace effuse
