#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/base/state_io.h"
#include "geometry/base/types.h"
#include "geometry/mesh/points.h"
#include "geometry/terrain/terrain.h"

/// What people who study flows measure: maps of where particles have been, and how far and how wide they lie.
namespace effuse::flow::sph {

/// Cells of a map in the terrain's local frame: cell (i, j) covers corner + [i, i + 1] cell.x, [j, j + 1] cell.y,
/// j = 0 is the south row.
struct MapGrid {
  Vec2 corner = Vec2::Zero();  ///< south-west corner of cell (0, 0) [m]
  Vec2 cell = Vec2::Ones();    ///< [m], > 0
  int nx = 1, ny = 1;          ///< >= 1

  Real cell_area() const { return cell.x() * cell.y(); }
  std::size_t size() const { return static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny); }
};

/// The most cells a map may have: its rasters are floats in memory when they are written, 1 GB here.
inline constexpr double kMostMapCells = 2.5e8;

/// A map of the whole terrain. cell [m]: side of a cell; 0: as the terrain has it, that is the cells round the posts
/// of a height field (the pixels of its file, cell for cell), or two particle spacings over a mesh, on whole
/// multiples of them. With cell > 0 on a height field the south-west corner is that of its pixels.
/// cell >= 0 and spacing > 0 (checked). Throws InputError (without a place) above kMostMapCells.
MapGrid map_grid(const geometry::Terrain& terrain, Real cell, Real spacing);

/// Rasters gathered from particles, moment by moment. A particle lies, seen from above, on a square as wide as itself
/// (twice its radius, sides along x and y) as a slab of its volume:
///
///   thickness(cell) = sum_p V_p |square_p and cell| / |square_p| / |cell|      [m], measured vertically
///
/// so that  sum(thickness) |cell| = volume inside the map  to rounding; what lies beyond the map is not in it. V_p
/// are the given volume's shares, as radius^3. Everything is known at the moments add() was called, no finer: a
/// front that crosses a cell within one interval is not seen there.
///
/// Memory: 24 bytes a cell in the blocks of 32 x 32 cells that lava has touched; elsewhere 4 bytes a block. Time:
/// 40 to 90 ns a particle on one thread, for cells of ten to one particle widths: less than a tenth of a step, once a
/// frame. (A gather in parallel would first have to sort the particles by cell, which costs as much.) Not thread-safe
/// itself. The same bits on any number of threads.
class FlowMap {
 public:
  /// A cell counts as reached once its thickness exceeds arrival_thickness [m] >= 0 (checked).
  FlowMap(const MapGrid& grid, Real arrival_thickness);

  /// The flow at a moment [s], not before the last one (checked): points of volume [m^3] in all, which replace those
  /// of the last moment. Positions finite, radii > 0 (checked). surface_temperature [K]: one a particle, or none; it
  /// goes into the map of the hottest in place of points.temperature, which is there or not.
  void add(Real time, const geometry::Points& points, Real volume, std::span<const Real> surface_temperature = {});

  enum class Layer {
    kThickness,       ///< of the last moment [m]; 0 where lava came and left: the deposit when the flow has ended
    kMaxThickness,    ///< of any moment [m]
    kMaxTemperature,  ///< of any particle over any part of the cell, at any moment [K]
    kArrivalTime,     ///< first moment the thickness exceeds arrival_thickness [s]
  };
  /// nx * ny values, i fastest, south row first; NaN where nothing came (of kArrivalTime: not that thick).
  std::vector<float> layer(Layer which) const;

  const MapGrid& grid() const { return grid_; }
  Real arrival_thickness() const { return arrival_thickness_; }
  /// Thickness of the last moment [m], to the last bit; 0 where nothing is. (i, j) in the grid (checked).
  Real thickness(int i, int j) const;
  /// Volume inside the map, of the last moment [m^3].
  Real volume() const;
  /// Of the cells reached so far, whole cells [m^2]: with cells much wider than a particle high along the outline.
  Real inundated_area() const { return static_cast<Real>(reached_) * grid_.cell_area(); }
  std::size_t memory() const;

  void save(StateWriter& out) const;
  /// Throws InputError naming file when the bytes are of another grid or arrival_thickness, or not a map's.
  void load(StateReader& in, const std::string& file);

 private:
  static constexpr int kSide = 32;  // of a block
  struct Cell {
    Real thickness = 0;
    float max_thickness = 0, max_temperature = 0, arrival = 0;  // NaN: none yet
  };
  using Block = std::vector<Cell>;
  std::size_t block_number(int i, int j) const;
  Cell& touch(int i, int j);
  const Cell* find(int i, int j) const;
  template <class Visit>
  void visit(Visit&& visit) const;  // (i, j, cell) for the touched cells, in the grid's order of blocks

  MapGrid grid_;
  Real arrival_thickness_;
  int blocks_x_;
  std::vector<Index> block_of_;  // by place, kNone: untouched
  std::vector<Block> blocks_;
  std::uint64_t reached_ = 0;
  Real time_ = 0;
  bool any_ = false;  // whether add() was called
};

/// Area that the particles' squares cover now, seen from above [m^2]: of a grid as fine as the widest particle, each
/// cell counts with the area of the squares in it, at most its own. Flows of several layers read high by up to
/// half a particle along their outline. 60 to 80 ns a particle, one thread. Positions finite (checked).
Real covered_area(const geometry::Points& points);

/// A place lava comes out of, seen from above: a line, or a point when both ends are one [m].
struct PlanLine {
  Vec2 from = Vec2::Zero(), to = Vec2::Zero();
};

/// How far lava has come from where it comes out, seen from above: the distance within which all but kBeyondFront of its volume lies, and
/// the particle there. Unlike the farthest particle's, which may be one that fell ahead, it is a property of the flow: two spacings of
/// particles have it in common once they have the flow in common.
struct Front {
  Real distance = 0;       ///< from the nearest of the lines [m], straight: not along the flow's bends
  Vec2 at = Vec2::Zero();  ///< the particle's centre [m]
};
inline constexpr Real kBeyondFront = 0.005;  ///< of the volume; of fewer than 200 particles none
/// All particles count alike: they are of one volume (those of a lava are). nullopt without particles or without lines. The first of
/// equals. The same on any number of threads.
std::optional<Front> find_front(const geometry::Points& points, std::span<const PlanLine> vents);

}  // namespace effuse::flow::sph
