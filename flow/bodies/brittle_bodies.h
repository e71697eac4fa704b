#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "flow/bodies/bonds.h"
#include "flow/bodies/rigid_bodies.h"

namespace effuse::flow::bodies {

/// What a body that may break is made of. Geometry is in the frame its pose places.
struct BrittleMaterial {
  std::shared_ptr<const geometry::FracturedBody> cells;
  Real strength = 0;       ///< of the bonds [Pa], tension and shear by the largest principal stress; infinity: never breaks
  Real smallest = 0;       ///< [m^3]: pieces of less volume do not break any further
};

struct BrittleOptions {
  /// A blow's impulse acts for so long [s]: a few milliseconds for stones of a metre (Hertz). Force is the impulses of contacts
  /// averaged over the time before with weights exp(-t / blow_time), so that it does not hang on the step.
  Real blow_time = 2e-3;
  int rounds = 6;          ///< a step is made anew at most so often because something broke in it
};

struct BrittleReport {
  BodyReport bodies;
  std::size_t broken_bodies = 0;   ///< came apart in this step
  std::size_t new_pieces = 0;
  int redone = 0;                  ///< times the step was made anew
};

/// Rigid bodies that break along their cells. Beside a RigidBodies, which it refers to and steps.
///
/// In each step, for each substep: the forces of contacts (and those told by add_force) on each cell, and the body's own inertia; the
/// bonds' stresses by BondSolver; those beyond the strength break. A body that this leaves in several groups is replaced by one
/// piece a group: new bodies (numbers at the end; the old one's is never given again), each with the velocity field v + w x r that the
/// body had, so that mass and both momenta stay to rounding and no energy appears. Then the step is taken back and made anew with the
/// pieces: what hits a wall goes on through the gap with the momentum the pieces leave it, instead of stopping dead at what is no
/// longer there. What breaking takes in energy is left out: for stone some 100 J a square metre, little beside a blow.
///
/// Pieces share their faces to the last bit and do not overlap at birth. One cell is a hull, several convex ones are met in pairs
/// (Shape::parts), those of a body that is not convex as meshes. Joints go on holding the piece at their anchor.
///
/// Not seen: forces of joints, and loads on bodies that sleep (nothing changes there). Without contact and add_force a body breaks by
/// spin alone. The same bits on any number of threads.
class BrittleBodies {
 public:
  explicit BrittleBodies(RigidBodies& bodies, const BrittleOptions& options = {});

  /// As RigidBodies::add. Its mass is that of its cells. Throws InputError when a cell is too flat to be a solid.
  BodyId add(const BrittleMaterial& material, Real density, const geometry::RigidPose& pose, const Surface& surface = {}, const Vec3& velocity = Vec3::Zero(),
             const Vec3& spin = Vec3::Zero());

  /// f [N] at the point `at` of the world until the end of the next step, on the cell there. For a body that cannot break as
  /// RigidBodies::add_force.
  void add_force(BodyId id, const Vec3& f, const Vec3& at);

  /// RigidBodies::step(dt), and what breaks in it.
  BrittleReport step(Real dt);

  /// A body, or a piece of one: cells of the source it came from.
  struct Piece {
    Index source = 0;              ///< in the order of add()
    std::vector<Index> cells;      ///< rising
    std::optional<BondSolver> solver = {};  // its bonds as they are; made when wanted
  };
  bool any() const { return !sources_.empty(); }
  bool knows(BodyId id) const { return pieces_.count(id) > 0; }
  /// By body; those that broke are not there any more.
  const std::map<BodyId, Piece>& pieces() const { return pieces_; }
  const BrittleMaterial& material(Index source) const { return sources_[source].material; }
  /// The body that source was added as.
  BodyId first_body(Index source) const { return sources_[source].first; }
  /// Of a piece that came by breaking, also one that broke again: the body it was part of, and its source.
  struct Birth {
    BodyId parent;
    Index source;
    std::vector<Index> cells;
  };
  const Birth& birth(BodyId piece) const { return births_.at(piece); }
  std::size_t broken_bonds() const;

  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  /// Before the bodies' own load(): makes the pieces that were there, as bodies of the same numbers. Into one with the same add()s and
  /// nothing broken yet; every other body that was added later must be added by `other`, called when its number is next.
  /// Throws InputError where what was saved does not fit.
  void load(StateReader& in, const std::function<void(BodyId)>& other = {});

 private:
  struct Source {
    BrittleMaterial material;
    Real density = 0;
    Surface surface;
    BodyId first = 0;
    std::vector<geometry::ConvexHull> hulls;   // of convex cells
    std::vector<std::uint8_t> broken;          // a flag a bond
    std::vector<Wrench> felt;                  // by cell: the force on it now, averaged over blow_time
  };
  struct Given {
    BodyId body;
    Index cell;
    Vec3 force, at, local;   // in the world, in the world, where it is in the body
  };
  struct Split {
    BodyId body;
    std::vector<std::vector<Index>> groups;
  };
  std::shared_ptr<const Shape> shape_of(const Source& source, std::span<const Index> cells) const;
  BodyId add_piece(Index source, std::vector<Index> cells, const geometry::RigidPose& pose, const Vec3& velocity, const Vec3& spin);
  std::vector<Split> overloaded(Real dt, int substeps);
  void part(const Split& split);

  RigidBodies& bodies_;
  BrittleOptions options_;
  std::vector<Source> sources_;
  std::map<BodyId, Piece> pieces_;
  std::map<BodyId, Birth> births_;   // pieces that came by breaking, also those that broke again
  std::vector<Given> given_;
};

}  // namespace effuse::flow::bodies
