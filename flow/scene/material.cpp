#include "flow/scene/material.h"

#include <array>
#include <string>
#include <vector>

namespace effuse::flow {

namespace {
struct Named {
  std::string_view name;
  Material material;
};
/// At room temperature. Source: Incropera & DeWitt, Fundamentals of Heat and Mass Transfer, tables A.1 and A.3; basalt: Robertson 1988,
/// USGS Open-File Report 88-441.
constexpr std::array<Named, 7> kMaterials = {{{"ground", {}},
                                              {"concrete", {1.4, 2300, 880}},
                                              {"brick", {0.72, 1920, 835}},
                                              {"wood", {0.12, 510, 1380}},
                                              {"granite", {2.79, 2630, 775}},
                                              {"basalt", {1.7, 2870, 840}},
                                              {"steel", {60.5, 7854, 434}}}};
}  // namespace

Material read_material(Parameters& p, Real own_density) {
  std::vector<std::string> names;
  for (const Named& each : kMaterials) names.emplace_back(each.name);
  Material m = kMaterials[p.choice("material", names, 0, "what takes up the lava's heat; ground: as the terrain does")].material;
  m.conductivity = p.number("conductivity", "W/(m K)", m.conductivity, {0, 1e4}, "of the material; 0: heat goes into it as into the ground");
  if (own_density > 0) m.density = own_density;
  else m.density = p.number("density", "kg/m3", m.density, {0, 1e5}, "of the material, for its heat");
  m.heat_capacity = p.number("heat_capacity", "J/(kg K)", m.heat_capacity, {0, 1e6}, "of the material");
  if (m.conductivity > 0 && !(m.density > 0 && m.heat_capacity > 0))
    p.fault("conductivity", "found without density and heat_capacity, which say with it how much heat goes into the solid: give these, or a material");
  return m;
}

}  // namespace effuse::flow
