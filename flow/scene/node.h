#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "geometry/base/error.h"

namespace effuse::flow {

/// A scene as it was written: tables, arrays and plain values, each with its place in the file.
/// Independent of the file's format (TOML now). The order of entries is the file's.
struct Node {
  enum class Kind { kTable, kArray, kText, kInteger, kReal, kFlag };

  Kind kind = Kind::kTable;
  Place place;  ///< of the value
  std::vector<std::pair<std::string, Node>> entries;  ///< kTable
  std::vector<Place> key_places;                      ///< kTable: of the keys, one an entry
  std::vector<Node> items;                            ///< kArray
  std::string text;                                   ///< kText
  std::int64_t integer = 0;
  double real = 0;
  bool flag = false;

  const Node* find(const std::string& key) const {
    for (const auto& [name, node] : entries)
      if (name == key) return &node;
    return nullptr;
  }
  /// Adds or replaces.
  Node& set(const std::string& key, Node value) {
    for (auto& [name, node] : entries)
      if (name == key) return node = std::move(value);
    entries.emplace_back(key, std::move(value));
    key_places.push_back(entries.back().second.place);
    return entries.back().second;
  }
};

/// "a table", "an array", "text", "a whole number", "a number", "true or false".
std::string kind_name(Node::Kind kind);

}  // namespace effuse::flow
