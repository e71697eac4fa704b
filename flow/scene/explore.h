#pragma once

#include <functional>
#include <string>
#include <vector>

#include "flow/scene/parameters.h"

namespace effuse::flow {

/// A key that a scene may have.
struct KeyDoc {
  std::string path;                    ///< "lava.vent[].rate"
  std::vector<ParameterDoc> variants;  ///< one, or several: limits are lengths of one joint and angles of another
  bool required = false;               ///< whatever else the scene says, wherever its table stands
  std::string with;                    ///< what makes the reader ask for it: "model = classic, heat.air"; "": it always does
};

/// All keys that read() can ask for, in the order of asking; those it always asks for come first. read() must be a function of its
/// scene alone, and bear faults.
///
/// How: read() is given an empty scene, and then one more for each key that it asked for, with that key set to something else, each value of
/// a choice, one table of an array; and so on with what it asks for then. What only two keys together call for is found where one
/// of them is asked for because of the other. 400 keys take about a second.
std::vector<KeyDoc> explore(const std::function<void(Parameters&)>& read);

}  // namespace effuse::flow
