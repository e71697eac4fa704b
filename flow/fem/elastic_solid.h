#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "flow/integrate/block_newton.h"
#include "flow/integrate/plane_contacts.h"
#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/mesh/tri_mesh.h"

/// Elastic solids by finite elements: soft, stiff, or brittle.
namespace effuse::flow::fem {

struct ElasticMaterial {
  Real youngs_modulus = 1e6;  ///< E [Pa], > 0
  Real poisson_ratio = 0.3;   ///< nu, -1 < nu < 0.5; linear tetrahedra lock towards 0.5
  Real density = 1000;        ///< [kg/m^3], > 0
  Real damping = 0;           ///< [s] of stiffness-proportional (Rayleigh) damping
  Real strength = 0;          ///< [Pa] of tension at which it breaks; 0: never
};

/// Tetrahedra on shared nodes, corners 1, 2, 3 counter-clockwise seen from corner 0's far side: positive volumes.
struct TetMesh {
  std::vector<Vec3> nodes;
  std::vector<std::array<Index, 4>> tets;
};

/// Each cube of a lattice cut into five tetrahedra, mirrored from cube to cube so that faces meet.
/// nx, ny, nz >= 1 cubes over the box (checked).
TetMesh box_of_tets(const Vec3& low, const Vec3& high, int nx, int ny, int nz);

/// What moves: position and velocity of each node.
struct SolidState {
  std::vector<Vec3> x, v;
};

/// A solid's tetrahedra, at rest where they were made, and what happens in a step.
struct StepReport {
  int iterations = 0;      ///< of Newton's method
  bool converged = true;
  std::size_t split = 0;   ///< nodes split by breaking
};

/// Corotational linear elasticity on linear tetrahedra: with F = R S the deformation gradient of one and R its rotation
///   energy = volume (mu |F - R|^2 + lambda / 2 tr(R^T F - 1)^2),   mu = E / (2 (1 + nu)), lambda = E nu / ((1 + nu) (1 - 2 nu))
/// so that no rotation makes a force. Masses are lumped at the nodes. A step is implicit Euler: it minimises its own energy
/// (block_newton.h), with the stiffness of the unturned element, turned, as Hessian: stable at any step and stiffness, also turned
/// inside out. First order in time, second in the elements' size. Breaking: after a step each node at which the mean stress of its
/// tetrahedra, weighted by volume, has a principal value above strength is split by the plane across that direction, if tetrahedra lie on
/// both sides; the strongest first, one at most about each tetrahedron. Mass and momentum are kept: they are the tetrahedra's.
/// Sources: Mueller & Gross 2004, Graphics Interface; McAdams et al. 2011; O'Brien & Hodgins 1999 (the splitting, without remeshing).
class ElasticSolid {
 public:
  /// Throws InputError where a material constant or a tetrahedron (volume not > 0, indices) cannot be.
  ElasticSolid(const TetMesh& mesh, const ElasticMaterial& material);
  ~ElasticSolid();
  ElasticSolid(ElasticSolid&&) noexcept;

  std::size_t nodes() const { return state_.x.size(); }
  const SolidState& state() const { return state_; }
  SolidState& state() { return state_; }
  const std::vector<Real>& mass() const { return mass_; }
  const std::vector<std::array<Index, 4>>& tets() const { return tets_; }
  /// 1: the node moves with its own velocity, whatever pulls.
  std::vector<std::uint8_t>& held() { return held_; }
  const std::vector<std::uint8_t>& held() const { return held_; }

  Vec3 gravity = Vec3(0, 0, -kGravity);
  std::vector<PlaneContact> contacts;
  PenaltyResponse response;
  std::vector<Vec3> load;  ///< forces on the nodes [N]; empty: none

  StepReport step(Real dt);

  /// The step of dt [s] that would follow, as Newton's method begins it: linearised about where the nodes are.
  ///   velocity  out: what each node goes over dt [m/s]; of held ones their own
  ///   answer    out: A = M + dt^2 K + dt C [kg], K of the turned elements and contacts, C of the dampers; impulses J [N s] through the step, on top
  ///             of load, change those by A^-1 J. Held nodes stand alone in it
  void predict(Real dt, std::vector<Vec3>& velocity, BlockMatrix& answer);

  /// Elastic energy [J], and forces on the nodes [N] at a state.
  Real elastic_energy(std::span<const Vec3> x) const;
  std::vector<Vec3> elastic_forces(std::span<const Vec3> x) const;
  /// Cauchy stress of each tetrahedron [Pa].
  std::vector<Mat3> stresses() const;
  Real volume() const;       ///< [m^3] now
  Real rest_volume() const;  ///< [m^3]

  /// The nodes' surface: faces of one tetrahedron, outward, on the nodes' positions.
  geometry::TriMesh surface() const;

  std::size_t memory() const;
  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  void load_state(StateReader& in);

 private:
  struct Element {
    Mat3 inverse;                ///< of the edges at rest
    Real volume;                 ///< at rest
    std::array<Vec3, 4> slope;   ///< of the shape functions
  };
  class StepEnergy;
  BlockNewton& newton();
  void measure();
  std::size_t split();
  Mat3 gradient(std::size_t e, std::span<const Vec3> x) const;

  ElasticMaterial material_;
  Real mu_ = 0, lambda_ = 0;
  std::vector<std::array<Index, 4>> tets_;
  std::vector<Vec3> rest_;
  std::vector<Element> elements_;
  std::vector<Real> mass_;
  std::vector<std::uint8_t> held_;
  SolidState state_;
  std::unique_ptr<BlockNewton> newton_;  // of the tetrahedra as they hang together now
};

}  // namespace effuse::flow::fem
