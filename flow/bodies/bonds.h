#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "geometry/fracture/fractured_body.h"

/// Cells of a body and the bonds that hold them together: what a load does to them.
namespace effuse::flow::bodies {

/// Force and moment about a cell's centre of mass [N], [N m].
struct Wrench {
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
};

/// Loads less what they and the spin give every cell as one rigid body (d'Alembert): no net force and moment are left. That weight is
/// everywhere the same acceleration, so it loads nothing by itself: it comes in through what holds the body up.
///   which    cells that hang together, rising
///   density  [kg/m^3]
///   spin     of the body [rad/s]
///   loads    one a cell of `which`, in and out
void take_rigid_part(const geometry::FracturedBody& body, std::span<const Index> which, Real density, const Vec3& spin, std::span<Wrench> loads);

/// The stress [Pa] that one bond carries at its worst corner: the larger principal stress of normal stress s (tension > 0) and shear t,
///   s / 2 + sqrt(s^2 / 4 + t^2)     (Rankine: what a brittle solid breaks by). Pressed, it holds shear by much more.
struct BondStress {
  Index bond = 0;     ///< number of the interface
  Real stress = 0;
};

/// Quasi-static equilibrium of cells as rigid bodies with six degrees of freedom, joined across their interfaces by elastic layers of
/// stiffness E / l a square metre against opening and sliding alike, l the distance between the two centres along the normal. On
/// Voronoi cells such a network is elastically homogeneous, with no Poisson effect (rigid-body-spring network; Kawai 1978, Nucl. Eng.
/// Des. 48, 207-229; Bolander & Saito 1998, Eng. Fract. Mech. 61, 569-591). Loads being given, E cancels. A sparse LDL^T of 6 n
/// unknowns; its inner order is the graph's, so the same bits always.
///
/// Against beam theory (tests): a bar cut square to its length carries the bending stress exactly; Voronoi cells, five to the depth of
/// the bar, break it at 0.6 to 1.3 of the load.
///
/// Refers to the body. Immutable: a factorisation, for any number of loads.
class BondSolver {
 public:
  ///   which   cells that hang together by bonds that are not broken, rising, two or more
  ///   broken  a flag an interface
  BondSolver(const geometry::FracturedBody& body, std::span<const Index> which, std::span<const std::uint8_t> broken);
  ~BondSolver();
  BondSolver(BondSolver&&) noexcept;
  BondSolver& operator=(BondSolver&&) noexcept;
  /// Bonds among `which`, by number. loads: one a cell of `which`, in equilibrium (take_rigid_part). Empty when the numbers are not finite.
  std::vector<BondStress> stresses(std::span<const Wrench> loads) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What of `which` hangs together: groups by their lowest cell, rising.
std::vector<std::vector<Index>> bonded_groups(const geometry::FracturedBody& body, std::span<const Index> which, std::span<const std::uint8_t> broken);

/// Breaks bonds in turn, the worst first (and those within a hundredth of it; of a body loaded to twice its strength a tenth, and all beyond five
/// times it), with loads shared anew each time, until what is left holds below the strength. Groups that this leaves, which are loose from
/// each other.
///   loads     one a cell of `which`, not in equilibrium
///   smallest  [m^3]: groups of less volume do not break any further
///   broken    in and out
///   whole     for all of `which` and `broken` as it comes in, kept from call to call; made anew when empty, empty when bonds broke
std::vector<std::vector<Index>> break_bonds(const geometry::FracturedBody& body, std::span<const Index> which, Real density, const Vec3& spin, std::span<const Wrench> loads,
                                            Real strength, Real smallest, std::span<std::uint8_t> broken, std::optional<BondSolver>& whole);

}  // namespace effuse::flow::bodies
