#include "flow/scene/breaking.h"

#include <fmt/format.h>

#include <limits>
#include <string>
#include <vector>

namespace effuse::flow {

namespace {
constexpr std::int64_t kMostCells = 5000;
}

PlannedBreaking read_breaking(Parameters& p, std::uint64_t seed) {
  PlannedBreaking plan;
  constexpr const char* kWith[] = {"cells", "cell_seed", "cell_layout", "cell_centre", "cell_reach", "cell_axis", "cell_flatness", "smallest_piece"};
  plan.strength = p.number("strength", "Pa", 0, Parameters::not_negative(), "at which it breaks, tension or shear: 0.3 MPa mortar, 2 MPa brick and concrete, 10 MPa granite; 0: it does not");
  plan.cells.cells = static_cast<std::size_t>(p.integer("cells", 40, 1, kMostCells, "it may break into so many"));
  plan.cells.seed = static_cast<std::uint64_t>(p.integer("cell_seed", static_cast<std::int64_t>(seed), 0, std::numeric_limits<std::int64_t>::max(), "of where they lie"));
  std::vector<std::string> layouts;
  for (const std::string_view name : geometry::kCellLayoutNames) layouts.emplace_back(name);
  using Layout = geometry::CellLayout;
  plan.cells.layout = static_cast<Layout>(p.choice("cell_layout", layouts, 0, "uniform; near: smaller about cell_centre; slabs: flat across cell_axis; bricks: courses of masonry"));
  const bool near = plan.cells.layout == Layout::kNear, flat = plan.cells.layout == Layout::kSlabs || plan.cells.layout == Layout::kBricks;
  const std::vector<Real> centre = p.numbers("cell_centre", "m", 3, near, "in the mesh's own frame: where cells are smallest");
  if (centre.size() == 3) plan.cells.centre = Vec3(centre[0], centre[1], centre[2]);
  plan.cells.reach = p.number("cell_reach", "m", 0, Parameters::not_negative(), "from there cells grow; 0: a quarter of the mesh's diagonal");
  plan.cells.axis = static_cast<int>(p.choice("cell_axis", {"x", "y", "z"}, 2, "of the mesh's own: slabs and courses lie square to it"));
  plan.cells.flatness = p.number("cell_flatness", "", plan.cells.flatness, {1, 100}, "slabs: width over thickness; bricks: length over height");
  plan.smallest = p.number("smallest_piece", "m3", 0, Parameters::not_negative(), "pieces of less volume break no further");
  if (!p.has("strength") || plan.strength == 0) {
    for (const char* key : kWith)
      if (p.has(key)) p.fault(key, "goes with a strength above 0");
    plan.strength = 0;
  }
  if (!near)
    for (const char* key : {"cell_centre", "cell_reach"})
      if (p.has(key)) p.fault(key, "goes with cell_layout = \"near\"");
  if (!flat)
    for (const char* key : {"cell_axis", "cell_flatness"})
      if (p.has(key)) p.fault(key, "goes with cell_layout = \"slabs\" or \"bricks\"");
  return plan;
}

std::shared_ptr<const geometry::FracturedBody> cut_cells(const PlannedBreaking& plan, const geometry::TriMesh& mesh) {
  return std::make_shared<const geometry::FracturedBody>(geometry::fracture(mesh, geometry::cell_regions(mesh, plan.cells)));
}

}  // namespace effuse::flow
