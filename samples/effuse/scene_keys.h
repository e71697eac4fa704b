#pragma once

#include <string>
#include <vector>

#include "flow/scene/explore.h"

namespace effuse {

/// Every key that a scene may have, as its readers ask for them: flow::explore() of what load_scene() reads.
std::vector<flow::KeyDoc> scene_keys();

/// A JSON schema (draft 2020-12) of scene files, for editors: tables, keys, what each is, its range and default. What it refuses, load_scene()
/// refuses; it does not know of what goes with what, nor whether "12 bananas" is a length. A number with a dimension may be a number, in SI,
/// or text with its unit; what that is to be stands under "x-unit".
std::string scene_schema(const std::vector<flow::KeyDoc>& keys);

/// A table at the top of a scene, with all that stands in it.
struct ScenePart {
  std::string name;  ///< "lava", "particles"; "": beside all tables
  std::string what;
  bool effect = false;
  std::vector<flow::KeyDoc> keys;  ///< in the order of asking
};
/// The keys by the tables they stand in: effects first, then the other tables.
std::vector<ScenePart> scene_parts(const std::vector<flow::KeyDoc>& keys);

/// Every key as a page of Markdown: of each part a table of key, value, default and meaning. samples/scene-reference.md is what it returns.
std::string scene_reference(const std::vector<flow::KeyDoc>& keys);

}  // namespace effuse
