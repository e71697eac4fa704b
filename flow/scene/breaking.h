#pragma once

#include <memory>

#include "flow/scene/parameters.h"
#include "geometry/fracture/fractured_body.h"

namespace effuse::flow {

/// How a body of a scene breaks, by the keys of its table.
struct PlannedBreaking {
  Real strength = 0;      ///< [Pa]; 0: the table has none, nothing breaks
  geometry::CellOptions cells;
  Real smallest = 0;      ///< [m^3]
  bool breaks() const { return strength > 0; }
};

/// The keys strength, cells, cell_seed, cell_layout, cell_centre, cell_reach, cell_axis, cell_flatness and smallest_piece. Without the first
/// the others are faults. seed: of cells that have none of their own.
PlannedBreaking read_breaking(Parameters& body, std::uint64_t seed);

/// The cells of a placed body's mesh. Throws InputError as geometry::fracture.
std::shared_ptr<const geometry::FracturedBody> cut_cells(const PlannedBreaking& plan, const geometry::TriMesh& mesh);

}  // namespace effuse::flow
