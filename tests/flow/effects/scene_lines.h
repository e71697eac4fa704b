#pragma once

#include <algorithm>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "flow/scene/node.h"

/// Scenes written as lines "lava.vent[0].rate = 8 m3/s": effects know nothing of TOML.
namespace effuse::flow {

using Lines = std::vector<std::pair<std::string, std::string>>;

inline Node scene_value(const std::string& value, const Place& place) {
  Node node;
  node.place = place;
  if (value == "true" || value == "false") {
    node.kind = Node::Kind::kFlag;
    node.flag = value == "true";
    return node;
  }
  if (value.starts_with('[')) {  // of numbers
    node.kind = Node::Kind::kArray;
    for (std::size_t from = 1; from < value.size();) {
      const std::size_t to = std::min(value.find(',', from), value.size() - 1), first = value.find_first_not_of(' ', from);
      node.items.push_back(scene_value(value.substr(first, to - first), place));
      from = to + 1;
    }
    return node;
  }
  char* end = nullptr;
  node.real = std::strtod(value.c_str(), &end);
  node.kind = *end == '\0' ? Node::Kind::kReal : Node::Kind::kText;
  node.text = value;
  return node;
}

/// The root of the scene; what reads as a number is one. Each line has its place.
inline Node scene_of(const Lines& lines) {
  Node root;
  root.place = {"test.toml"};
  const auto existing = [](Node& table, const std::string& key) -> Node* {
    for (auto& [name, node] : table.entries)
      if (name == key) return &node;
    return nullptr;
  };
  int line = 0;
  for (const auto& [path, value] : lines) {
    const Place place{"test.toml", ++line, 8};
    Node* table = &root;
    std::string rest = path;
    for (std::size_t dot = rest.find('.'); dot != std::string::npos; dot = rest.find('.')) {
      std::string key = rest.substr(0, dot);
      std::size_t index = 0;
      const std::size_t bracket = key.find('[');
      if (bracket != std::string::npos) {
        index = static_cast<std::size_t>(std::atoi(key.c_str() + bracket + 1));
        key.resize(bracket);
      }
      Node* next = existing(*table, key);
      if (!next) {
        next = &table->set(key, Node{});
        next->place = place;
      }
      if (bracket != std::string::npos) {
        next->kind = Node::Kind::kArray;
        if (next->items.size() <= index) next->items.resize(index + 1);
        next = &next->items[index];
        next->place = place;
      }
      table = next;
      rest = rest.substr(dot + 1);
    }
    table->set(rest, scene_value(value, place));
  }
  return root;
}

/// The value at "lava.heat.on" in a resolved scene, as text; "" where there is none.
inline std::string resolved_text(const Node& root, const std::string& path) {
  const Node* node = &root;
  std::string rest = path + ".";
  for (std::size_t dot = rest.find('.'); dot != std::string::npos && node; dot = rest.find('.')) {
    node = node->find(rest.substr(0, dot));
    rest = rest.substr(dot + 1);
  }
  if (!node) return "";
  if (node->kind == Node::Kind::kFlag) return node->flag ? "true" : "false";
  if (node->kind == Node::Kind::kReal) return std::to_string(node->real);
  return node->text;
}

}  // namespace effuse::flow
