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
  using Layout = geometry::CellLayout;
  plan.strength = p.number("strength", "Pa", 0, Parameters::not_negative(), "at which it breaks, tension or shear: 0.3 MPa mortar, 2 MPa brick and concrete, 10 MPa granite; 0: it does not");
  // A key that does not apply is read where it is written, to be told of, and else not at all: a resolved scene holds what applies.
  const auto key = [&](const char* name, bool applies, const char* with, auto&& read) {
    if (applies || p.has(name)) read(name);
    if (!applies && p.has(name)) p.fault(name, fmt::format("goes with {}", with));
  };
  const bool breaks = plan.strength > 0;
  constexpr const char* kStrong = "a strength above 0";
  key("cells", breaks, kStrong, [&](const char* k) { plan.cells.cells = static_cast<std::size_t>(p.integer(k, 40, 1, kMostCells, "it may break into so many")); });
  key("cell_seed", breaks, kStrong, [&](const char* k) {
    plan.cells.seed = static_cast<std::uint64_t>(p.integer(k, static_cast<std::int64_t>(seed), 0, std::numeric_limits<std::int64_t>::max(), "of where they lie"));
  });
  key("cell_layout", breaks, kStrong, [&](const char* k) {
    const std::vector<std::string> layouts(std::begin(geometry::kCellLayoutNames), std::end(geometry::kCellLayoutNames));
    plan.cells.layout = static_cast<Layout>(p.choice(k, layouts, 0, "uniform; near: smaller about cell_centre; slabs: flat across cell_axis; bricks: courses of masonry"));
  });
  const bool near = breaks && plan.cells.layout == Layout::kNear, flat = breaks && (plan.cells.layout == Layout::kSlabs || plan.cells.layout == Layout::kBricks);
  const char* const near_with = breaks ? "cell_layout = \"near\"" : kStrong;
  const char* const flat_with = breaks ? "cell_layout = \"slabs\" or \"bricks\"" : kStrong;
  key("cell_centre", near, near_with, [&](const char* k) {
    if (const std::vector<Real> centre = p.numbers(k, "m", 3, near, "in the mesh's own frame: where cells are smallest"); centre.size() == 3) plan.cells.centre = Vec3(centre[0], centre[1], centre[2]);
  });
  key("cell_reach", near, near_with, [&](const char* k) { plan.cells.reach = p.number(k, "m", 0, Parameters::not_negative(), "from there cells grow; 0: a quarter of the mesh's diagonal"); });
  key("cell_axis", flat, flat_with, [&](const char* k) { plan.cells.axis = static_cast<int>(p.choice(k, {"x", "y", "z"}, 2, "of the mesh's own: slabs and courses lie square to it")); });
  key("cell_flatness", flat, flat_with, [&](const char* k) { plan.cells.flatness = p.number(k, "", plan.cells.flatness, {1, 100}, "slabs: width over thickness; bricks: length over height"); });
  key("smallest_piece", breaks, kStrong, [&](const char* k) { plan.smallest = p.number(k, "m3", 0, Parameters::not_negative(), "pieces of less volume break no further"); });
  return plan;
}

std::shared_ptr<const geometry::FracturedBody> cut_cells(const PlannedBreaking& plan, const geometry::TriMesh& mesh) {
  return std::make_shared<const geometry::FracturedBody>(geometry::fracture(mesh, geometry::cell_regions(mesh, plan.cells)));
}

}  // namespace effuse::flow
