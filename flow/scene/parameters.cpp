#include "flow/scene/parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <tuple>
#include <unordered_set>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/units.h"

namespace effuse::flow {

/// One table of the scene as it is being read.
struct Parameters::Table {
  struct Entry {
    std::string key;
    bool present = false;                        // stands in the scene
    std::optional<Node> value;                   // a plain value or array, resolved
    std::vector<std::unique_ptr<Table>> tables;  // one for a table, any number for [[key]]
    bool array = false;                          // [[key]]
  };

  const Node* node = nullptr;  // nullptr: absent, or not a table
  Place place;                 // where a fault of the table itself is shown
  std::string doc_path;        // "lava.vents[]"
  std::vector<Entry> entries;  // in the order of reading

  Entry* find(const std::string& key) {
    const auto found = std::find_if(entries.begin(), entries.end(), [&](const Entry& e) { return e.key == key; });
    return found == entries.end() ? nullptr : &*found;
  }

  /// The entry of key, made on the first reading.
  Entry& entry(const std::string& key) {
    if (Entry* known = find(key)) return *known;
    Entry& added = entries.emplace_back();
    added.key = key;
    added.present = node && node->find(key);
    return added;
  }

  std::vector<std::string> keys() const {
    std::vector<std::string> names;
    for (const Entry& e : entries) names.push_back(e.key);
    return names;
  }
};

struct Parameters::Shared {
  std::unique_ptr<Table> root;
  std::vector<Fault> faults;
  std::vector<ParameterDoc> docs;
  std::unordered_set<std::string> documented, asked;

  void document(ParameterDoc doc) {
    // The tables of an array share their documentation.
    if (documented.insert(doc.path).second) docs.push_back(std::move(doc));
  }
};

namespace {

std::string joined(const std::string& path, const std::string& key) { return path.empty() ? key : path + "." + key; }

/// The value as it stands in the file, for messages; long text is cut.
std::string shown(const Node& node) {
  switch (node.kind) {
    case Node::Kind::kText:
      return node.text.size() > 60 ? fmt::format("'{}...'", node.text.substr(0, 57)) : fmt::format("'{}'", node.text);
    case Node::Kind::kInteger:
      return fmt::format("{}", node.integer);
    case Node::Kind::kReal:
      return fmt::format("{}", node.real);
    case Node::Kind::kFlag:
      return node.flag ? "true" : "false";
    case Node::Kind::kTable:
    case Node::Kind::kArray:
      break;
  }
  return kind_name(node.kind);
}

bool plain(std::string_view unit) { return unit.empty() || unit == "1"; }

std::string wanted_number(std::string_view unit) {
  return plain(unit) ? std::string("a number") : fmt::format("a number in {0}, as 2 or \"2 {0}\"", unit);
}

/// "> 0", ">= 0 K", "from 1 to 5 m".
std::string range_text(const Parameters::Range& range, std::string_view unit) {
  const auto quantity = [&](Real x) { return plain(unit) ? fmt::format("{}", x) : fmt::format("{} {}", x, unit); };
  const bool below = std::isfinite(range.high), above = std::isfinite(range.low);
  if (above && below && range.open_low) return fmt::format("above {} and at most {}", quantity(range.low), quantity(range.high));
  if (above && below) return fmt::format("from {} to {}", quantity(range.low), quantity(range.high));
  if (below) return fmt::format("at most {}", quantity(range.high));
  return fmt::format("{} {}", range.open_low ? ">" : ">=", quantity(range.low));
}

bool inside(Real value, const Parameters::Range& range) {
  return (range.open_low ? value > range.low : value >= range.low) && value <= range.high;
}

/// The number a node holds in SI. Throws std::invalid_argument that says what is wrong.
Real number_of(const Node& node, std::string_view unit) {
  Real value = 0;
  switch (node.kind) {
    case Node::Kind::kInteger:
      value = static_cast<Real>(node.integer);
      break;
    case Node::Kind::kReal:
      value = node.real;
      break;
    case Node::Kind::kText:
      value = parse_quantity(node.text, unit);
      break;
    default:
      throw std::invalid_argument(fmt::format("found {}, wanted {}", shown(node), wanted_number(unit)));
  }
  if (!std::isfinite(value)) throw std::invalid_argument(fmt::format("{} is not a finite number", shown(node)));
  return value;
}

Node number_node(Real value, std::string_view unit, const Place& place) {
  Node node;
  node.place = place;
  if (plain(unit)) {
    node.kind = Node::Kind::kReal;
    node.real = value;
  } else {
    node.kind = Node::Kind::kText;
    node.text = format_quantity(value, unit);
  }
  return node;
}

Node text_node(std::string text, const Place& place) {
  Node node;
  node.kind = Node::Kind::kText;
  node.place = place;
  node.text = std::move(text);
  return node;
}

ParameterDoc number_doc(std::string path, ParameterDoc::Kind kind, std::string_view unit, std::optional<Real> fallback, const Parameters::Range& range, std::string_view what) {
  const std::string si(plain(unit) ? "" : unit);
  return {std::move(path), si, fallback ? format_quantity(*fallback, si) : "", std::string(what), kind, si, range.low, range.high, range.open_low};
}

std::string list(const std::vector<std::string>& names, std::string_view between) { return fmt::format("{}", fmt::join(names, between)); }

/// "; did you mean 'rate'?", or the names there are.
std::string suggestion(const std::string& word, const std::vector<std::string>& names) {
  const std::string nearest = nearest_name(word, names);
  if (!nearest.empty()) return fmt::format("did you mean '{}'?", nearest);
  return "there are: " + list(names, ", ");
}

std::optional<std::size_t> index_of(const std::string& name, const std::vector<std::string>& names) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names.begin());
}

}  // namespace

Parameters::Parameters(const Node& root) : shared_(std::make_shared<Shared>()) {
  shared_->root = std::make_unique<Table>();
  table_ = shared_->root.get();
  table_->place = root.place;
  if (root.kind == Node::Kind::kTable) {
    table_->node = &root;
  } else {
    shared_->faults.push_back({root.place, fmt::format("found {}, wanted a table", shown(root))});
  }
}

Parameters::Parameters(std::shared_ptr<Shared> shared, Table* table, std::string path)
    : shared_(std::move(shared)), table_(table), path_(std::move(path)) {}

bool Parameters::has(const std::string& key) const {
  shared_->asked.insert(joined(table_->doc_path, key));
  return table_->node && table_->node->find(key);
}

Place Parameters::place(const std::string& key) const {
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  return node ? node->place : table_->place;
}

void Parameters::fault(const std::string& key, const std::string& message) {
  const std::string name = key.empty() ? path_ : joined(path_, key);
  shared_->faults.push_back({place(key), name.empty() ? message : name + ": " + message});
}

void Parameters::fault_at(const Place& place, const std::string& message) { shared_->faults.push_back({place, message}); }

Real Parameters::number(const std::string& key, std::string_view unit, std::optional<Real> fallback, Range range, std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  shared_->document(number_doc(joined(table_->doc_path, key), ParameterDoc::Kind::kNumber, unit, fallback, range, what));
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  Real value = fallback.value_or(0);
  if (node) {
    try {
      const Real given = number_of(*node, unit);
      if (inside(given, range)) {
        value = given;
      } else {
        fault(key, fmt::format("{} is out of range, must be {}", shown(*node), range_text(range, unit)));
      }
    } catch (const std::invalid_argument& error) {
      fault(key, error.what());
    }
  } else if (!fallback) {
    fault(key, fmt::format("is missing ({}), wanted {}", what, wanted_number(unit)));
  }
  entry.value = number_node(value, unit, place(key));
  return value;
}

std::int64_t Parameters::integer(const std::string& key, std::optional<std::int64_t> fallback, std::int64_t low, std::int64_t high,
                                 std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  ParameterDoc doc{joined(table_->doc_path, key), "whole number", fallback ? fmt::format("{}", *fallback) : "", std::string(what), ParameterDoc::Kind::kInteger};
  if (low != std::numeric_limits<std::int64_t>::min()) doc.low = static_cast<Real>(low);
  if (high != std::numeric_limits<std::int64_t>::max()) doc.high = static_cast<Real>(high);
  shared_->document(std::move(doc));
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  std::int64_t value = fallback.value_or(0);
  if (node) {
    std::optional<std::int64_t> given;
    if (node->kind == Node::Kind::kInteger) given = node->integer;
    // 240.0 is a whole number, too; beyond 2^53 a double no longer says which.
    if (node->kind == Node::Kind::kReal && std::abs(node->real) <= 9007199254740992.0 && std::trunc(node->real) == node->real)
      given = static_cast<std::int64_t>(node->real);
    if (!given) {
      fault(key, fmt::format("found {}, wanted a whole number", shown(*node)));
    } else if (*given < low || *given > high) {
      fault(key, fmt::format("{} is out of range, must be {}", *given,
                             high == std::numeric_limits<std::int64_t>::max()  ? fmt::format(">= {}", low)
                             : low == std::numeric_limits<std::int64_t>::min() ? fmt::format("at most {}", high)
                                                                               : fmt::format("from {} to {}", low, high)));
    } else {
      value = *given;
    }
  } else if (!fallback) {
    fault(key, fmt::format("is missing ({}), wanted a whole number", what));
  }
  Node resolved;
  resolved.kind = Node::Kind::kInteger;
  resolved.place = place(key);
  resolved.integer = value;
  entry.value = std::move(resolved);
  return value;
}

bool Parameters::flag(const std::string& key, bool fallback, std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  shared_->document({joined(table_->doc_path, key), "flag", fallback ? "true" : "false", std::string(what), ParameterDoc::Kind::kFlag});
  bool value = fallback;
  if (const Node* node = table_->node ? table_->node->find(key) : nullptr) {
    if (node->kind == Node::Kind::kFlag) {
      value = node->flag;
    } else {
      fault(key, fmt::format("found {}, wanted true or false", shown(*node)));
    }
  }
  Node resolved;
  resolved.kind = Node::Kind::kFlag;
  resolved.place = place(key);
  resolved.flag = value;
  entry.value = std::move(resolved);
  return value;
}

std::string Parameters::text(const std::string& key, std::optional<std::string> fallback, std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  shared_->document({joined(table_->doc_path, key), "text", !fallback ? "" : fallback->empty() ? "\"\"" : *fallback, std::string(what), ParameterDoc::Kind::kText});
  std::string value = fallback.value_or("");
  if (const Node* node = table_->node ? table_->node->find(key) : nullptr) {
    if (node->kind == Node::Kind::kText) {
      value = node->text;
    } else {
      fault(key, fmt::format("found {}, wanted text in quotes", shown(*node)));
    }
  } else if (!fallback) {
    fault(key, fmt::format("is missing ({}), wanted text in quotes", what));
  }
  entry.value = text_node(value, place(key));
  return value;
}

std::vector<std::string> Parameters::texts(const std::string& key, std::size_t count, std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  const std::string wanted = fmt::format("an array of {} texts in quotes", count);
  ParameterDoc doc{joined(table_->doc_path, key), wanted, "", std::string(what), ParameterDoc::Kind::kTexts};
  doc.count = count;
  shared_->document(std::move(doc));
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  if (!node) {
    fault(key, fmt::format("is missing ({}), wanted {}", what, wanted));
    return {};
  }
  Node resolved;
  resolved.kind = Node::Kind::kArray;
  resolved.place = node->place;
  std::vector<std::string> value;
  for (const Node& item : node->items) {
    if (item.kind == Node::Kind::kText) value.push_back(item.text);
    resolved.items.push_back(text_node(item.text, item.place));
  }
  if (node->kind != Node::Kind::kArray || node->items.size() != count || value.size() != count) {
    fault(key, fmt::format("found {}, wanted {}", node->kind != Node::Kind::kArray ? shown(*node) : value.size() < node->items.size() ? "an array of other things" : fmt::format("an array of {}", value.size()), wanted));
    return {};
  }
  entry.value = std::move(resolved);
  return value;
}

std::vector<std::string> Parameters::texts(const std::string& key, std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  shared_->document({joined(table_->doc_path, key), "text, or several: [\"a\", \"b\"]", "", std::string(what), ParameterDoc::Kind::kTextOrTexts});
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  if (!node) {
    fault(key, fmt::format("is missing ({}), wanted text in quotes", what));
    return {};
  }
  const std::vector<Node> items = node->kind == Node::Kind::kArray ? node->items : std::vector<Node>{*node};
  if (items.empty()) fault(key, "found an empty array, wanted at least one text in quotes");
  std::vector<std::string> values;
  for (const Node& item : items) {
    if (item.kind == Node::Kind::kText && !item.text.empty()) values.push_back(item.text);
    else shared_->faults.push_back({item.place, joined(path_, key) + ": " + fmt::format("found {}, wanted text in quotes", shown(item))});
  }
  entry.value = *node;
  return values.size() == items.size() ? values : std::vector<std::string>();
}

std::size_t Parameters::choice(const std::string& key, const std::vector<std::string>& names, std::size_t fallback, std::string_view what) {
  CHECK_LT(fallback, names.size());
  Table::Entry& entry = table_->entry(key);
  ParameterDoc doc{joined(table_->doc_path, key), "choice: " + list(names, " | "), names[fallback], std::string(what), ParameterDoc::Kind::kChoice};
  doc.names = names;
  shared_->document(std::move(doc));
  std::size_t value = fallback;
  if (const Node* node = table_->node ? table_->node->find(key) : nullptr) {
    if (node->kind != Node::Kind::kText) {
      fault(key, fmt::format("found {}, wanted one of: {}", shown(*node), list(names, ", ")));
    } else if (const auto index = index_of(node->text, names)) {
      value = *index;
    } else {
      fault(key, fmt::format("no such choice {}; {}", shown(*node), suggestion(node->text, names)));
    }
  }
  entry.value = text_node(names[value], place(key));
  return value;
}

std::vector<std::size_t> Parameters::choices(const std::string& key, const std::vector<std::string>& names,
                                             std::vector<std::size_t> fallback, std::string_view what) {
  for (std::size_t index : fallback) CHECK_LT(index, names.size());
  Table::Entry& entry = table_->entry(key);
  std::vector<std::string> defaults;
  for (std::size_t index : fallback) defaults.push_back(names[index]);
  ParameterDoc doc{joined(table_->doc_path, key), "choices: " + list(names, " | "), "[" + list(defaults, ", ") + "]", std::string(what), ParameterDoc::Kind::kChoices};
  doc.names = names;
  shared_->document(std::move(doc));

  std::vector<std::size_t> value = fallback;
  if (const Node* node = table_->node ? table_->node->find(key) : nullptr) {
    bool good = node->kind == Node::Kind::kArray;
    if (!good) fault(key, fmt::format("found {}, wanted an array of some of: {}", shown(*node), list(names, ", ")));
    std::vector<std::size_t> given;
    for (const Node& item : node->items) {
      std::string wrong;
      if (item.kind != Node::Kind::kText) {
        wrong = fmt::format("found {}, wanted one of: {}", shown(item), list(names, ", "));
      } else if (const auto index = index_of(item.text, names); !index) {
        wrong = fmt::format("no such choice {}; {}", shown(item), suggestion(item.text, names));
      } else if (std::find(given.begin(), given.end(), *index) != given.end()) {
        wrong = fmt::format("{} is given twice", shown(item));
      } else {
        given.push_back(*index);
      }
      if (wrong.empty()) continue;
      good = false;
      shared_->faults.push_back({item.place, joined(path_, key) + ": " + wrong});
    }
    if (good) value = given;
  }
  Node resolved;
  resolved.kind = Node::Kind::kArray;
  resolved.place = place(key);
  for (std::size_t index : value) resolved.items.push_back(text_node(names[index], resolved.place));
  entry.value = std::move(resolved);
  return value;
}

namespace {
/// What an array of numbers should look like: "an array of 3 numbers in m".
std::string wanted_numbers(std::string_view unit, std::size_t count) {
  return fmt::format("an array of {}numbers{}", count > 0 ? fmt::format("{} ", count) : "", plain(unit) ? "" : fmt::format(" in {}", unit));
}

/// The numbers of an array node; faults are added with the item's place. nullopt after a fault.
std::optional<std::vector<Real>> numbers_of(const Node& node, std::string_view unit, std::size_t count, const std::string& name,
                                            std::vector<Fault>& faults) {
  if (node.kind != Node::Kind::kArray) {
    faults.push_back({node.place, fmt::format("{}: found {}, wanted {}", name, shown(node), wanted_numbers(unit, count))});
    return std::nullopt;
  }
  if (count > 0 && node.items.size() != count) {
    faults.push_back(
        {node.place, fmt::format("{}: found an array of {}, wanted {}", name, node.items.size(), wanted_numbers(unit, count))});
    return std::nullopt;
  }
  std::vector<Real> values;
  const std::size_t before = faults.size();
  for (std::size_t i = 0; i < node.items.size(); ++i) {
    try {
      values.push_back(number_of(node.items[i], unit));
    } catch (const std::invalid_argument& error) {
      faults.push_back({node.items[i].place, fmt::format("{}[{}]: {}", name, i, error.what())});
    }
  }
  if (faults.size() > before) return std::nullopt;
  return values;
}

Node numbers_node(const std::vector<Real>& values, std::string_view unit, const Place& place) {
  Node node;
  node.kind = Node::Kind::kArray;
  node.place = place;
  for (Real value : values) node.items.push_back(number_node(value, unit, place));
  return node;
}
}  // namespace

std::vector<Real> Parameters::numbers(const std::string& key, std::string_view unit, std::size_t count, bool required,
                                      std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  ParameterDoc doc{joined(table_->doc_path, key), wanted_numbers(unit, count), required ? "" : "[]", std::string(what), ParameterDoc::Kind::kNumbers, plain(unit) ? "" : std::string(unit)};
  doc.count = count;
  shared_->document(std::move(doc));
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  if (!node) {
    if (!required) return {};
    fault(key, fmt::format("is missing ({}), wanted {}", what, wanted_numbers(unit, count)));
    return std::vector<Real>(count, 0);
  }
  const auto values = numbers_of(*node, unit, count, joined(path_, key), shared_->faults);
  if (!values) return std::vector<Real>(required ? count : 0, 0);
  entry.value = numbers_node(*values, unit, node->place);
  return *values;
}

std::vector<std::vector<Real>> Parameters::number_lists(const std::string& key, std::string_view unit, std::size_t width, bool required,
                                                        std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  const std::string wanted = "an array of " + wanted_numbers(unit, width).substr(3) + " each";
  ParameterDoc doc{joined(table_->doc_path, key), wanted, required ? "" : "[]", std::string(what), ParameterDoc::Kind::kNumberLists, plain(unit) ? "" : std::string(unit)};
  doc.count = width;
  shared_->document(std::move(doc));
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  if (!node) {
    if (required) fault(key, fmt::format("is missing ({}), wanted {}", what, wanted));
    return {};
  }
  if (node->kind != Node::Kind::kArray || (required && node->items.empty())) {
    fault(key, fmt::format("found {}, wanted {}", node->kind == Node::Kind::kArray ? "an empty array" : shown(*node), wanted));
    return {};
  }
  std::vector<std::vector<Real>> lists;
  Node resolved;
  resolved.kind = Node::Kind::kArray;
  resolved.place = node->place;
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    const std::string name = fmt::format("{}[{}]", joined(path_, key), i);
    if (auto values = numbers_of(node->items[i], unit, width, name, shared_->faults)) {
      resolved.items.push_back(numbers_node(*values, unit, node->items[i].place));
      lists.push_back(std::move(*values));
    }
  }
  if (lists.size() != node->items.size()) return {};
  entry.value = std::move(resolved);
  return lists;
}

namespace {
const std::vector<std::string> kWays = {"linear", "hold", "smooth", "catmull_rom", "bezier"};
constexpr geometry::Between kWayBetween[] = {geometry::Between::kLinear, geometry::Between::kStep, geometry::Between::kCatmullRom, geometry::Between::kCatmullRom, geometry::Between::kBezier};
constexpr std::size_t kSmoothWay = 2, kBezierWay = 4;
}  // namespace

geometry::Curve<Real> Parameters::curve(const std::string& key, std::string_view unit, std::optional<Real> fallback, Range range, std::string_view what) {
  shared_->document(number_doc(joined(table_->doc_path, key), ParameterDoc::Kind::kCurve, unit, fallback, range, what));
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  if (!node || node->kind != Node::Kind::kArray) return geometry::Curve<Real>(number(key, unit, fallback, range, what));
  table_->entry(key);  // its place among the resolved
  const std::size_t usual = choice("motion", {"linear", "hold", "smooth", "catmull_rom"}, 0, "from key to key, of numbers given by keys");

  const std::string wanted = fmt::format("keys [[time, {}], ...], the times rising", plain(unit) ? std::string("number") : fmt::format("number in {}", unit));
  std::vector<geometry::Key<Real>> keys;
  std::vector<std::size_t> ways;
  Node resolved;
  resolved.kind = Node::Kind::kArray;
  resolved.place = node->place;
  const std::size_t faults_before = shared_->faults.size();
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    const Node& item = node->items[i];
    const auto wrong = [&](const Node& at, const std::string& message) { shared_->faults.push_back({at.place, fmt::format("{}[{}]: {}", joined(path_, key), i, message)}); };
    if (item.kind != Node::Kind::kArray || item.items.size() < 2) {
      wrong(item, fmt::format("found {}, wanted {}", item.kind == Node::Kind::kArray ? fmt::format("an array of {}", item.items.size()) : shown(item), wanted));
      continue;
    }
    geometry::Key<Real> k;
    std::size_t way = usual;
    const auto read = [&](std::size_t n, std::string_view of) {
      try {
        return number_of(item.items[n], of);
      } catch (const std::invalid_argument& error) {
        wrong(item.items[n], error.what());
        return Real{0};
      }
    };
    k.time = read(0, "s");
    k.value = read(1, unit);
    if (!inside(k.value, range)) wrong(item.items[1], fmt::format("{} is out of range, must be {}", shown(item.items[1]), range_text(range, unit)));
    if (!keys.empty() && !(k.time > keys.back().time)) wrong(item.items[0], fmt::format("{} does not come after the key before, at {} s", shown(item.items[0]), keys.back().time));
    if (item.items.size() > 2) {
      const auto named = item.items[2].kind == Node::Kind::kText ? index_of(item.items[2].text, kWays) : std::nullopt;
      if (!named) wrong(item.items[2], fmt::format("found {}, wanted how it goes to the next key; {}", shown(item.items[2]), item.items[2].kind == Node::Kind::kText ? suggestion(item.items[2].text, kWays) : "there are: " + list(kWays, ", ")));
      way = named.value_or(usual);
    }
    const std::size_t count = way == kBezierWay ? 5 : 3;
    if (item.items.size() > count || (way == kBezierWay && item.items.size() < count)) wrong(item, fmt::format("found {} entries, wanted [time, value, \"{}\"{}]", item.items.size(), kWays[way], way == kBezierWay ? ", slope leaving, slope arriving" : ""));
    k.between = kWayBetween[way];
    if (way == kBezierWay && item.items.size() == count) k.out = read(3, ""), k.in = read(4, "");
    Node of_key = item;
    of_key.items[0] = number_node(k.time, "s", item.items[0].place);
    of_key.items[1] = number_node(k.value, unit, item.items[1].place);
    resolved.items.push_back(std::move(of_key));
    keys.push_back(k);
    ways.push_back(way);
  }
  if (node->items.empty()) fault(key, "found an empty array, wanted " + wanted);
  const geometry::Curve<Real> nothing(fallback.value_or(0));
  if (shared_->faults.size() > faults_before || keys.empty()) return nothing;
  // A key says what arrives at the next; a curve's keys what arrives at them.
  for (std::size_t k = keys.size(); k-- > 0;) keys[k].in = k > 0 && ways[k - 1] == kBezierWay ? keys[k - 1].in : 0;
  std::vector<geometry::Key<Real>> smooth = geometry::without_overshoot(keys);
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if (ways[k] != kSmoothWay) continue;
    keys[k].between = smooth[k].between;
    keys[k].out = smooth[k].out;
    if (k + 1 < keys.size()) keys[k + 1].in = smooth[k + 1].in;
  }
  table_->entry(key).value = std::move(resolved);
  const geometry::Curve<Real> curve(std::move(keys));
  const auto [least, most] = geometry::extremes(curve);
  const Real slack = 1e-9 * (1 + std::max(std::abs(least), std::abs(most)));
  if (least < range.low - slack || most > range.high + slack) {
    fault(key, fmt::format("reaches {:g} between its keys, must be {}: \"smooth\" stays between them", least < range.low - slack ? least : most, range_text(range, unit)));
    return nothing;
  }
  return curve;
}

Parameters Parameters::table(const std::string& key, std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  const std::string doc_path = joined(table_->doc_path, key);
  shared_->document({doc_path, "table", "{}", std::string(what), ParameterDoc::Kind::kTable});
  if (entry.tables.empty()) {
    auto child = std::make_unique<Table>();
    child->place = place(key);
    child->doc_path = doc_path;
    const Node* node = table_->node ? table_->node->find(key) : nullptr;
    if (node && node->kind == Node::Kind::kTable) {
      child->node = node;
    } else if (node) {
      fault(key, fmt::format("found {}, wanted a table: [{}]", shown(*node), joined(path_, key)));
    }
    entry.tables.push_back(std::move(child));
  }
  return Parameters(shared_, entry.tables.front().get(), joined(path_, key));
}

std::vector<Parameters> Parameters::tables(const std::string& key, std::string_view what) {
  Table::Entry& entry = table_->entry(key);
  const std::string doc_path = joined(table_->doc_path, key) + "[]";
  shared_->document({doc_path, "tables", "[]", std::string(what), ParameterDoc::Kind::kTables});
  const Node* node = table_->node ? table_->node->find(key) : nullptr;
  if (!entry.array) {
    entry.array = true;
    if (node && node->kind != Node::Kind::kArray) {
      fault(key, fmt::format("found {}, wanted tables: [[{}]]", shown(*node), joined(path_, key)));
    } else if (node) {
      for (const Node& item : node->items) {
        auto child = std::make_unique<Table>();
        child->place = item.place;
        child->doc_path = doc_path;
        if (item.kind == Node::Kind::kTable) {
          child->node = &item;
          entry.tables.push_back(std::move(child));
        } else {
          shared_->faults.push_back({item.place, fmt::format("{0}: found {1}, wanted a table: [[{0}]]", joined(path_, key), shown(item))});
        }
      }
    }
  }
  std::vector<Parameters> all;
  for (std::size_t i = 0; i < entry.tables.size(); ++i)
    all.push_back(Parameters(shared_, entry.tables[i].get(), fmt::format("{}[{}]", joined(path_, key), i)));
  return all;
}

std::vector<Fault> Parameters::faults() const { return shared_->faults; }

void Parameters::finish() {
  std::vector<Fault> faults = shared_->faults;

  // Keys nobody asked for, in every table that was read.
  const auto unread = [&](auto& self, Table& table, const std::string& path) -> void {
    if (table.node) {
      const std::vector<std::string> known = table.keys();
      for (std::size_t i = 0; i < table.node->entries.size(); ++i) {
        const std::string& key = table.node->entries[i].first;
        if (table.find(key)) continue;
        const Place where = i < table.node->key_places.size() ? table.node->key_places[i] : table.node->entries[i].second.place;
        std::string advice = nearest_name(key, known);
        if (!advice.empty()) {
          advice = fmt::format("did you mean '{}'?", advice);
        } else {
          // The right name in the wrong table.
          for (const ParameterDoc& doc : shared_->docs)
            if (advice.empty() && doc.path.size() > key.size() && doc.path.ends_with("." + key))
              advice = fmt::format("there is '{}'", doc.path);
          if (advice.empty()) advice = known.empty() ? "nothing is read here" : "known here: " + list(known, ", ");
        }
        faults.push_back({where, fmt::format("{}: unknown key; {}", joined(path, key), advice)});
      }
    }
    for (Table::Entry& entry : table.entries)
      for (std::size_t i = 0; i < entry.tables.size(); ++i)
        self(self, *entry.tables[i], joined(path, entry.key) + (entry.array ? fmt::format("[{}]", i) : ""));
  };
  unread(unread, *shared_->root, "");
  if (faults.empty()) return;

  // In the order of the file; what has no line (--set) comes last.
  std::stable_sort(faults.begin(), faults.end(), [](const Fault& a, const Fault& b) {
    const auto rank = [](const Place& p) { return std::tuple(p.line == 0, p.line, p.column); };
    return rank(a.place) < rank(b.place);
  });
  throw InputError(std::move(faults));
}

Node Parameters::resolved() const {
  const auto tree = [](auto& self, const Table& table) -> Node {
    Node node;
    node.kind = Node::Kind::kTable;
    node.place = table.place;
    for (const Table::Entry& entry : table.entries) {
      if (entry.value) node.set(entry.key, *entry.value);
      if (entry.array && (entry.present || !entry.tables.empty())) {
        Node array;
        array.kind = Node::Kind::kArray;
        for (const auto& child : entry.tables) array.items.push_back(self(self, *child));
        node.set(entry.key, std::move(array));
      } else if (!entry.array && !entry.tables.empty()) {
        Node child = self(self, *entry.tables.front());
        // An absent table whose reader asked for nothing stays absent.
        if (entry.present || !child.entries.empty()) node.set(entry.key, std::move(child));
      }
    }
    return node;
  };
  return tree(tree, *table_);
}

std::vector<ParameterDoc> Parameters::docs() const { return shared_->docs; }

std::vector<std::string> Parameters::asked() const {
  std::vector<std::string> paths(shared_->asked.begin(), shared_->asked.end());
  std::sort(paths.begin(), paths.end());
  return paths;
}

std::string range_of(const ParameterDoc& doc) {
  const bool all = !std::isfinite(doc.low) && !std::isfinite(doc.high);
  return all ? std::string() : range_text({doc.low, doc.high, doc.open_low}, doc.si_unit);
}

}  // namespace effuse::flow
