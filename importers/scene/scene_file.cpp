#include "importers/scene/scene_file.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "importers/input_file.h"

namespace effuse::importers {

using flow::Node;

namespace {

constexpr std::uint64_t kSceneLimit = 16u << 20;  // bytes; a scene written by hand has a few thousand
// What is nested is read and destroyed recursively: these keep the stack small. (Brackets times dots
// is the depth a file can reach.)
constexpr int kBracketLimit = 64;
constexpr int kDotLimit = 32;

/// Throws InputError when brackets or dotted keys nest too deeply, before a recursive parser sees them.
void check_nesting(std::string_view text, const std::string& name) {
  int brackets = 0, dots = 0, line = 1;
  std::size_t line_start = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\n') {
      ++line;
      line_start = i + 1;
      dots = 0;
    } else if (c == '#') {
      while (i + 1 < text.size() && text[i + 1] != '\n') ++i;
    } else if (c == '"' || c == '\'') {
      // A string: to its end, or to the end of the line when it has none (a syntax error, told later).
      const std::string three(3, c);
      const bool multiline = text.substr(i, 3) == three;
      i += multiline ? 3 : 1;
      for (; i < text.size(); ++i) {
        if (text[i] == '\n') {
          if (!multiline) break;
          ++line;
          line_start = i + 1;
        }
        if (c == '"' && text[i] == '\\' && i + 1 < text.size() && text[i + 1] != '\n') {
          ++i;
        } else if (multiline ? text.substr(i, 3) == three : text[i] == c) {
          i += multiline ? 2 : 0;
          break;
        }
      }
      if (i < text.size() && text[i] == '\n') --i;  // counted above
    } else if (c == '.') {
      ++dots;
    } else if (c == '[' || c == '{') {
      ++brackets;
      dots = 0;
    } else if (c == ']' || c == '}') {
      --brackets;
      dots = 0;
    } else if (c == '=' || c == ',') {
      dots = 0;
    }
    if (brackets > kBracketLimit || dots > kDotLimit) {
      throw InputError({name, line, static_cast<int>(std::min<std::size_t>(i - line_start + 1, 1 << 30))},
                       fmt::format("nested too deeply: at most {} brackets and {} dots in a name", kBracketLimit, kDotLimit));
    }
  }
}

Place place_of(const toml::source_region& region, const std::string& name) {
  return {name, static_cast<int>(region.begin.line), static_cast<int>(region.begin.column)};
}

/// A toml++ node as one of ours; what has no meaning in a scene is added to faults.
Node converted(const toml::node& from, const std::string& name, std::vector<Fault>& faults) {
  Node node;
  node.place = place_of(from.source(), name);
  if (const auto* table = from.as_table()) {
    node.kind = Node::Kind::kTable;
    // toml++ sorts by key; ours stand in the order of the file.
    std::vector<std::tuple<Place, std::string, const toml::node*>> members;
    for (const auto& [key, value] : *table) members.emplace_back(place_of(key.source(), name), std::string(key.str()), &value);
    std::stable_sort(members.begin(), members.end(), [](const auto& a, const auto& b) {
      return std::tie(std::get<0>(a).line, std::get<0>(a).column) < std::tie(std::get<0>(b).line, std::get<0>(b).column);
    });
    for (const auto& [key_place, key, value] : members) {
      node.entries.emplace_back(key, converted(*value, name, faults));
      node.key_places.push_back(key_place);
    }
  } else if (const auto* array = from.as_array()) {
    node.kind = Node::Kind::kArray;
    for (const toml::node& item : *array) node.items.push_back(converted(item, name, faults));
  } else if (const auto* text = from.as_string()) {
    node.kind = Node::Kind::kText;
    node.text = text->get();
  } else if (const auto* integer = from.as_integer()) {
    node.kind = Node::Kind::kInteger;
    node.integer = integer->get();
  } else if (const auto* real = from.as_floating_point()) {
    node.kind = Node::Kind::kReal;
    node.real = real->get();
  } else if (const auto* flag = from.as_boolean()) {
    node.kind = Node::Kind::kFlag;
    node.flag = flag->get();
  } else {
    faults.push_back({node.place, "found a date or time, which a scene has no use for: put text in quotes"});
  }
  return node;
}

/// A basic string with everything escaped that has to be.
std::string toml_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    switch (c) {
      case '"':
        out += "\\\"";
        break;
      case '\\':
        out += "\\\\";
        break;
      case '\n':
        out += "\\n";
        break;
      case '\t':
        out += "\\t";
        break;
      case '\r':
        out += "\\r";
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
          out += fmt::format("\\u{:04X}", static_cast<unsigned>(c));
        } else {
          out += c;
        }
    }
  }
  return out + '"';
}

bool bare_character(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-'; }

std::string toml_key(const std::string& key) {
  return !key.empty() && std::all_of(key.begin(), key.end(), bare_character) ? key : toml_text(key);
}

/// The shortest digits that read back bit for bit, marked as a real.
std::string toml_real(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  const std::string digits = fmt::format("{}", value);
  return digits.find_first_of(".e") == std::string::npos ? digits + ".0" : digits;
}

bool array_of_tables(const Node& node) {
  return node.kind == Node::Kind::kArray && !node.items.empty() &&
         std::all_of(node.items.begin(), node.items.end(), [](const Node& item) { return item.kind == Node::Kind::kTable; });
}

std::string inline_value(const Node& node) {
  switch (node.kind) {
    case Node::Kind::kText:
      return toml_text(node.text);
    case Node::Kind::kInteger:
      return fmt::format("{}", node.integer);
    case Node::Kind::kReal:
      return toml_real(node.real);
    case Node::Kind::kFlag:
      return node.flag ? "true" : "false";
    case Node::Kind::kArray: {
      std::vector<std::string> items;
      for (const Node& item : node.items) items.push_back(inline_value(item));
      return fmt::format("[{}]", fmt::join(items, ", "));
    }
    case Node::Kind::kTable:
      break;
  }
  std::vector<std::string> items;
  for (const auto& [key, value] : node.entries) items.push_back(toml_key(key) + " = " + inline_value(value));
  return items.empty() ? "{}" : fmt::format("{{ {} }}", fmt::join(items, ", "));
}

/// A value after its key; long arrays get a line for each item.
std::string value_of_key(const Node& node) {
  std::string one_line = inline_value(node);
  if (node.kind != Node::Kind::kArray || one_line.size() <= 100) return one_line;
  std::string lines = "[\n";
  for (const Node& item : node.items) lines += "  " + inline_value(item) + ",\n";
  return lines + "]";
}

void write_table(const Node& table, const std::string& path, std::string& out) {
  const auto below = [&](const std::string& key) { return path.empty() ? toml_key(key) : path + "." + toml_key(key); };
  const auto own_section = [](const Node& node) { return node.kind == Node::Kind::kTable || array_of_tables(node); };
  // What belongs to this table has to stand before the next header.
  for (const auto& [key, node] : table.entries)
    if (!own_section(node)) out += toml_key(key) + " = " + value_of_key(node) + "\n";
  for (const auto& [key, node] : table.entries) {
    if (node.kind == Node::Kind::kTable) {
      out += (out.empty() ? "[" : "\n[") + below(key) + "]\n";
      write_table(node, below(key), out);
    } else if (array_of_tables(node)) {
      for (const Node& item : node.items) {
        out += (out.empty() ? "[[" : "\n[[") + below(key) + "]]\n";
        write_table(item, below(key), out);
      }
    }
  }
}

/// One step of an override's path: a key, or an index into an array.
struct Step {
  std::string key;
  std::optional<std::size_t> index;
};

[[noreturn]] void refuse(const std::string& message) { throw InputError({"--set"}, message); }

std::vector<Step> parse_path(std::string_view path) {
  std::vector<Step> steps;
  const std::string example = "; wanted key.key[0].key=value";
  std::size_t i = 0;
  bool key_wanted = true;
  while (i < path.size()) {
    if (path[i] == '[' && !steps.empty() && !key_wanted) {
      const std::size_t end = path.find(']', i);
      std::size_t index = 0;
      const char* first = path.data() + i + 1;
      const char* last = end == std::string_view::npos ? first : path.data() + end;
      const auto [stopped, error] = std::from_chars(first, last, index);
      if (error != std::errc{} || stopped != last || first == last) refuse(fmt::format("wrong index in {}{}", quote(path), example));
      steps.push_back({"", index});
      i = end + 1;
    } else if (path[i] == '.' && !key_wanted) {
      key_wanted = true;
      ++i;
    } else if (key_wanted && path[i] == '"') {
      const std::size_t end = path.find('"', i + 1);
      if (end == std::string_view::npos) refuse(fmt::format("no closing quote in {}", quote(path)));
      steps.push_back({std::string(path.substr(i + 1, end - i - 1)), std::nullopt});
      i = end + 1;
      key_wanted = false;
    } else if (key_wanted && bare_character(path[i])) {
      std::size_t end = i;
      while (end < path.size() && bare_character(path[end])) ++end;
      steps.push_back({std::string(path.substr(i, end - i)), std::nullopt});
      i = end;
      key_wanted = false;
    } else {
      refuse(fmt::format("wrong name {}{}", quote(path), example));
    }
  }
  if (key_wanted) refuse(fmt::format("wrong name {}{}", quote(path), example));
  if (steps.size() > kBracketLimit) refuse("the name has too many parts");
  return steps;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front()))) text.remove_prefix(1);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.remove_suffix(1);
  return text;
}

void set_place(Node& node, const Place& place) {
  node.place = place;
  for (auto& [key, child] : node.entries) set_place(child, place);
  for (Node& item : node.items) set_place(item, place);
  std::fill(node.key_places.begin(), node.key_places.end(), place);
}

/// A value as TOML has it; text as it stands when it is not TOML ("30 m3/s").
Node override_value(std::string_view text) {
  Node node;
  node.kind = Node::Kind::kText;
  node.text = std::string(text);
  if (text.find('\n') == std::string_view::npos) {
    try {
      const Node parsed = read_scene_text("value = " + node.text, "--set");
      if (parsed.entries.size() == 1) node = parsed.entries.front().second;
    } catch (const InputError&) {
      // Not TOML: text. It has to be UTF-8 all the same, which the quoted form below tells.
      read_scene_text("value = " + toml_text(node.text), "--set");
    }
  }
  set_place(node, {"--set"});
  return node;
}

}  // namespace

flow::Node read_scene_file(const std::filesystem::path& file) {
  return read_scene_text(read_input(file, kSceneLimit, "a scene"), file.string());
}

flow::Node read_scene_text(const std::string& text, const std::string& name) {
  if (text.size() > kSceneLimit) throw InputError({name}, fmt::format("is too large for a scene: {} bytes", text.size()));
  check_nesting(text, name);
  try {
    const toml::table root = toml::parse(std::string_view(text), std::string_view(name));
    std::vector<Fault> faults;
    Node scene = converted(root, name, faults);
    scene.place = {name};
    if (!faults.empty()) throw InputError(std::move(faults));
    return scene;
  } catch (const toml::parse_error& error) {
    throw InputError(place_of(error.source(), name), printable(error.description()));
  }
}

void apply_override(flow::Node& scene, const std::string& assignment) {
  // The first '=' outside quotes ends the name.
  std::size_t equals = 0;
  for (bool in_quotes = false; equals < assignment.size() && (in_quotes || assignment[equals] != '='); ++equals)
    if (assignment[equals] == '"') in_quotes = !in_quotes;
  if (equals == assignment.size()) refuse(fmt::format("found {}, wanted key=value", quote(assignment)));
  const std::string_view name = trimmed(std::string_view(assignment).substr(0, equals));
  const std::string_view value = trimmed(std::string_view(assignment).substr(equals + 1));
  if (value.empty()) refuse(fmt::format("no value after {}=; for empty text write {}='\"\"'", name, name));
  const std::vector<Step> steps = parse_path(name);

  // Work on a copy: a path that turns out wrong half way leaves the scene as it was.
  Node changed = scene;
  Node* at = &changed;
  std::string walked;
  Node missing;
  missing.place = {"--set"};
  bool just_made = false;  // then it may become an array as well as a table
  for (const Step& step : steps) {
    if (step.index) {
      if (just_made) at->kind = Node::Kind::kArray;
      if (at->kind != Node::Kind::kArray) refuse(fmt::format("'{}' is {}, not an array", walked, flow::kind_name(at->kind)));
      if (*step.index > at->items.size())
        refuse(fmt::format("'{}' has {} items: the index may be 0 to {}", walked, at->items.size(), at->items.size()));
      just_made = *step.index == at->items.size();
      if (just_made) at->items.push_back(missing);
      at = &at->items[*step.index];
      walked += fmt::format("[{}]", *step.index);
    } else {
      if (at->kind != Node::Kind::kTable) refuse(fmt::format("'{}' is {}, not a table", walked, flow::kind_name(at->kind)));
      Node* next = nullptr;
      for (auto& [key, node] : at->entries)
        if (key == step.key) next = &node;
      just_made = !next;
      at = next ? next : &at->set(step.key, missing);
      walked += (walked.empty() ? "" : ".") + step.key;
    }
  }
  *at = override_value(value);
  scene = std::move(changed);
}

std::string to_toml(const flow::Node& scene) {
  std::string out;
  write_table(scene, "", out);
  return out;
}

}  // namespace effuse::importers
