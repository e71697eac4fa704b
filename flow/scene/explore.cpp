#include "flow/scene/explore.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <set>
#include <unordered_map>

#include "geometry/base/units.h"

namespace effuse::flow {

namespace {

using Kind = ParameterDoc::Kind;

Node text_of(std::string text) {
  Node node;
  node.kind = Node::Kind::kText;
  node.text = std::move(text);
  return node;
}

Node number_of(Real x) {
  Node node;
  node.kind = Node::Kind::kReal;
  node.real = x;
  return node;
}

Node array_of(std::vector<Node> items) {
  Node node;
  node.kind = Node::Kind::kArray;
  node.items = std::move(items);
  return node;
}

/// A number in range that is not the default, if there is one.
Real another(const ParameterDoc& doc) {
  Real usual = 0;
  if (!doc.default_value.empty()) usual = parse_quantity(doc.default_value, doc.si_unit);
  for (Real x : {usual + 1, usual / 2, (doc.low + doc.high) / 2, doc.high, doc.low, usual})
    if (std::isfinite(x) && x != usual && (doc.open_low ? x > doc.low : x >= doc.low) && x <= doc.high) return x;
  return usual;
}

/// Values of a key that may make its reader ask for more: each named, "" where any would do.
std::vector<std::pair<std::string, Node>> values_of(const ParameterDoc& doc) {
  std::vector<std::pair<std::string, Node>> all;
  switch (doc.kind) {
    case Kind::kNumber:
      all.emplace_back("", number_of(another(doc)));
      break;
    case Kind::kCurve:
      all.emplace_back("", number_of(another(doc)));
      all.emplace_back("keys", array_of({array_of({number_of(0), number_of(another(doc))}), array_of({number_of(1), number_of(another(doc))})}));
      break;
    case Kind::kInteger: {
      Node node;
      node.kind = Node::Kind::kInteger;
      const Real usual = doc.default_value.empty() ? 0 : std::stod(doc.default_value);
      node.integer = static_cast<std::int64_t>(usual + 1 <= doc.high ? std::max(usual + 1, doc.low) : std::max(usual - 1, doc.low));
      all.emplace_back("", std::move(node));
      break;
    }
    case Kind::kFlag: {
      Node node;
      node.kind = Node::Kind::kFlag;
      node.flag = doc.default_value != "true";
      all.emplace_back(node.flag ? "true" : "false", std::move(node));
      break;
    }
    case Kind::kText:
      all.emplace_back("", text_of("name"));
      break;
    case Kind::kTextOrTexts:
      all.emplace_back("", text_of("name"));
      break;
    case Kind::kTexts:
      all.emplace_back("", array_of(std::vector<Node>(doc.count, text_of("name"))));
      break;
    case Kind::kChoice:
      for (const std::string& name : doc.names) all.emplace_back(name, text_of(name));
      break;
    case Kind::kChoices:
      for (const std::string& name : doc.names) all.emplace_back(name, array_of({text_of(name)}));
      break;
    case Kind::kNumbers: {
      // Rising and above 0: as limits, regions and sizes want them.
      std::vector<Node> items;
      for (std::size_t k = 0; k < std::max<std::size_t>(1, doc.count); ++k) items.push_back(number_of(0.25 * static_cast<Real>(k + 1)));
      all.emplace_back("", array_of(std::move(items)));
      break;
    }
    case Kind::kNumberLists: {
      std::vector<Node> lists;
      for (int l = 0; l < 3; ++l) {
        std::vector<Node> items;
        for (std::size_t k = 0; k < std::max<std::size_t>(1, doc.count); ++k) items.push_back(number_of(l + 0.25 * static_cast<Real>(k + 1)));
        lists.push_back(array_of(std::move(items)));
      }
      all.emplace_back("", array_of(std::move(lists)));
      break;
    }
    case Kind::kTable:
      all.emplace_back("", Node{});
      break;
    case Kind::kTables:
      all.emplace_back("", array_of({Node{}}));
      break;
  }
  return all;
}

/// Sets what stands at "a.b[].c"; of an array, its first.
void set_at(Node& root, std::string_view path, Node value) {
  Node* table = &root;
  while (true) {
    const std::size_t dot = path.find('.');
    std::string key(path.substr(0, dot));
    const bool array = key.ends_with("[]");
    if (array) key.resize(key.size() - 2);
    const Node* there = table->find(key);
    if (dot == std::string_view::npos) {
      table->set(key, std::move(value));
      return;
    }
    if (!there || there->kind != (array ? Node::Kind::kArray : Node::Kind::kTable)) table->set(key, array ? array_of({Node{}}) : Node{});
    for (auto& [name, node] : table->entries)
      if (name == key) {
        table = array ? &node.items.front() : &node;
        break;
      }
    path.remove_prefix(dot + 1);
  }
}

/// What set_at() has set.
Node value_at(const Node& root, std::string_view path) {
  const Node* at = &root;
  while (true) {
    const std::size_t dot = path.find('.');
    std::string key(path.substr(0, dot));
    const bool array = key.ends_with("[]");
    if (array) key.resize(key.size() - 2);
    at = at->find(key);
    if (array) at = &at->items.front();
    if (dot == std::string_view::npos) return *at;
    path.remove_prefix(dot + 1);
  }
}

std::string table_of(const std::string& path) {
  const std::size_t dot = path.rfind('.');
  return dot == std::string::npos ? std::string() : path.substr(0, dot);
}

bool same(const ParameterDoc& a, const ParameterDoc& b) {
  return a.kind == b.kind && a.si_unit == b.si_unit && a.low == b.low && a.high == b.high && a.open_low == b.open_low && a.names == b.names && a.count == b.count;
}

/// Whether it is of the key itself, not of one in its table.
bool is_of(const Fault& fault, std::string path) {
  for (std::size_t b = 0; (b = path.find("[]", b)) != std::string::npos;) path.replace(b, 2, "[0]");
  if (!fault.message.starts_with(path)) return false;
  std::string_view rest = std::string_view(fault.message).substr(path.size());
  while (rest.starts_with('[') && rest.find(']') != std::string_view::npos) rest.remove_prefix(rest.find(']') + 1);
  return rest.starts_with(':');
}

struct Scene {
  Node root;
  std::string with;
  std::string set, value;  // the key that was set last, and to what
  bool certain = false;    // to what it surely may be
  bool again = false;      // it was tried elsewhere, and not wanted there
};

}  // namespace

std::vector<KeyDoc> explore(const std::function<void(Parameters&)>& read) {
  std::vector<KeyDoc> keys;
  std::vector<std::vector<ParameterDoc>> refused;  // variants that the reader did not want where it found them
  std::unordered_map<std::string, std::size_t> index;
  std::map<std::string, std::size_t> tables;                // times that a table was read
  std::unordered_map<std::string, std::size_t> asked_for;  // times that a key was, and was required
  std::set<std::string> tried;
  // What a key does not want beside one choice it may want beside another of the same table.
  struct Probe {
    std::string path, value, with;
    Node node;
  };
  std::map<std::string, std::vector<Probe>> unwanted_in;
  std::map<std::string, std::vector<Scene>> choices_of;
  std::deque<Scene> open(1);
  while (!open.empty()) {
    const Scene scene = std::move(open.front());
    open.pop_front();
    Parameters parameters(scene.root);
    read(parameters);
    const std::vector<ParameterDoc> docs = parameters.docs();
    const std::vector<Fault> faults = parameters.faults();
    std::set<std::string> read_tables;
    const auto go_on = [&](const Scene& from, const Probe& probe, bool certain, bool again) {
      Scene more = from;
      more.again = again;
      set_at(more.root, probe.path, probe.node);
      more.set = probe.path;
      more.value = probe.value;
      more.certain = certain;
      more.with += (more.with.empty() || probe.with.empty() ? "" : ", ") + probe.with;
      open.push_back(std::move(more));
    };
    const auto next = [&](const std::string& path, const std::string& value, const Node& node, std::string with, bool certain) {
      if (tried.insert(path + "=" + value).second) go_on(scene, {path, value, std::move(with), node}, certain, false);
    };
    // A key that goes with another is read where it does not, to be told of: what it would be there says nothing, nor what comes with it.
    const bool unwanted = !scene.certain && !scene.set.empty() && std::any_of(faults.begin(), faults.end(), [&](const Fault& fault) { return is_of(fault, scene.set); });
    if (unwanted && !scene.again) {
      const Probe probe{scene.set, scene.value, scene.set.substr(scene.set.rfind('.') + 1), value_at(scene.root, scene.set)};
      for (const Scene& choice : choices_of[table_of(scene.set)]) go_on(choice, probe, false, true);
      unwanted_in[table_of(scene.set)].push_back(probe);
    }
    if (scene.certain) {
      for (const Probe& probe : unwanted_in[table_of(scene.set)]) go_on(scene, probe, false, true);
      choices_of[table_of(scene.set)].push_back(scene);
    }
    for (const ParameterDoc& doc : docs) {
      const bool itself = doc.path == scene.set || doc.path == scene.set + "[]";
      if (unwanted && !itself) continue;
      const auto [at, added] = index.try_emplace(doc.path, keys.size());
      if (added) {
        keys.push_back({doc.path, {}, false, scene.with});
        refused.emplace_back();
      }
      std::vector<ParameterDoc>& variants = unwanted ? refused[at->second] : keys[at->second].variants;
      if (std::none_of(variants.begin(), variants.end(), [&](const ParameterDoc& known) { return same(known, doc); })) variants.push_back(doc);
      if (!unwanted) read_tables.insert(table_of(doc.path));
      if (!unwanted && doc.default_value.empty()) ++asked_for[doc.path];
      const bool table = doc.kind == Kind::kTables || doc.kind == Kind::kTable;
      const std::string path = doc.kind == Kind::kTables ? doc.path.substr(0, doc.path.size() - 2) : doc.path, key = path.substr(path.rfind('.') + 1);
      for (const auto& [value, node] : values_of(doc))
        if (value.empty() || value != doc.default_value) next(path, value, node, table ? "" : value.empty() || value == "keys" ? key : key + " = " + value, doc.kind == Kind::kChoice || doc.kind == Kind::kFlag);
    }
    if (unwanted) continue;
    for (const std::string& path : parameters.asked())
      if (!index.contains(path) && !index.contains(path + "[]")) next(path, "?", Node{}, "", false);
    for (const std::string& table : read_tables) ++tables[table];
  }
  std::vector<KeyDoc> all;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if (keys[k].variants.empty()) keys[k].variants = refused[k];
    const auto found = asked_for.find(keys[k].path);
    keys[k].required = found != asked_for.end() && found->second == tables[table_of(keys[k].path)];
    all.push_back(std::move(keys[k]));
  }
  return all;
}

}  // namespace effuse::flow
