#include "flow/scene/node.h"

namespace effuse::flow {

std::string kind_name(Node::Kind kind) {
  switch (kind) {
    case Node::Kind::kTable:
      return "a table";
    case Node::Kind::kArray:
      return "an array";
    case Node::Kind::kText:
      return "text";
    case Node::Kind::kInteger:
      return "a whole number";
    case Node::Kind::kReal:
      return "a number";
    case Node::Kind::kFlag:
      return "true or false";
  }
  return "nothing";
}

}  // namespace effuse::flow
