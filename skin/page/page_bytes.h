#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "skin/page/pack_mesh.h"

namespace effuse::skin {

/// A mesh's attributes as the page has them, and what their bytes mean.
struct PageBytes {
  std::vector<BytePlane> planes;
  std::map<std::string, std::pair<float, float>> ranges;  ///< of "temperature" [K], "speed" [m/s], "thickness" [m]: what 0 and 255 stand for
  Real fast = 0, thick = 0;                               ///< what 99.5 % of the vertices stay below
};

/// "red green blue": what the surface reflects, sRGB (its "color" less its display_emission); "glow": the black body that emits as much as its "glow",
/// by glow_of_byte(); then those of "temperature", "speed", "crust", "thickness" that the mesh has. A mesh of lava that has a temperature but no "glow" or no "color"
/// is coloured by color_lava. Sizes must agree (checked).
PageBytes lava_bytes(const geometry::TriMesh& lava);
/// "red green blue" alone; grey without "color".
PageBytes other_bytes(const geometry::TriMesh& mesh);

/// What byte b of "glow" emits, linear: nothing for 0, else as a black body of 800 K to 1800 K.
Vec3 glow_of_byte(int b);

}  // namespace effuse::skin
