#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "flow/scene/joints.h"
#include "flow/scene/meeting.h"
#include "flow/scene/obstacles.h"
#include "flow/scene/parameters.h"
#include "flow/scene/rigid_bodies.h"
#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/mesh/points.h"
#include "geometry/mesh/volume.h"
#include "geometry/terrain/terrain.h"

namespace effuse::flow {

/// What effects live in.
struct World {
  const geometry::Terrain* terrain = nullptr;
  std::uint64_t seed = 1;
  const std::vector<PlacedObstacle>* obstacles = nullptr;  ///< null: none
  const std::vector<PlacedBody>* bodies = nullptr;         ///< null: none
  const std::vector<PlacedJoint>* joints = nullptr;        ///< null: none
  BodySettings body_settings = {};
  /// The mesh that a table's form names, in metres, z up; throws InputError at its place. Empty: there are no files.
  std::function<geometry::TriMesh(const PlannedForm&)> mesh = {};
};

/// A surface of one moment, for files (frames/NAME.####.ply) and pictures; "color" is linear light, "glow" what shines of itself.
struct NamedMesh {
  std::string name;
  geometry::TriMesh mesh;
  Real since = -1;  ///< it has been the same, bit for bit, from this time on [s]; negative: it may have changed just now
};

/// Particles of one moment that are drawn one by one.
///   radius, temperature, age, opacity  one a particle [m], [K], [s], 0..1 through its middle
///   color  linear light of what they are made of
struct NamedCloud {
  enum class Look {
    kGrains,  ///< flakes and grains: opaque specks
    kGlow,    ///< they shine as hot as they are
    kPuffs    ///< soft balls, one behind the other
  };
  std::string name;
  Look look = Look::kGrains;
  std::vector<Vec3> x, v;
  std::vector<Real> radius, temperature, age, opacity;
  std::vector<std::uint64_t> id;
  Vec3 color = Vec3::Ones();
  bool soft = false;  ///< kGlow: flames that one sees through, not clots
  bool points = true, spheres = false;  ///< files: frames/NAME.####.ply of points, or of small spheres

  geometry::Points view() const {
    geometry::Points p;
    p.position = x, p.velocity = v, p.radius = radius, p.temperature = temperature, p.age = age, p.opacity = opacity, p.id = id;
    return p;
  }
};

/// What an effect is expected to cost: for `effuse check`.
struct Estimate {
  double particles = 0;  ///< at the end
  double mean_particles = 0;  ///< over the film
  double drawn = 0;      ///< particles that are drawn one by one, at the end; no part of those above
  double cells = 0;      ///< of grids
  double bytes = 0;      ///< of memory, at the end
  double steps = 0;      ///< in all, at the largest stable size
  double seconds = 0;    ///< of two cores; a rough figure
};

/// A solid thing that came into the world after its beginning.
///   id    its number, never given again
///   body  of the scene's bodies that it broke off, or kNoBody
///   mesh  closed, its own frame, flat normals; "inner": 1 on faces that breaking has made, 0 on others
struct SolidPiece {
  static constexpr Index kNoBody = ~Index{0};
  Index id = 0, body = kNoBody;
  std::shared_ptr<const geometry::TriMesh> mesh;
  geometry::RigidPose pose;
  Real temperature = 0;  ///< of its surface [K]; 0: that of the air
};

/// Something that must be stepped, as the run loop sees it: one adapter an effect, over a solver that
/// knows nothing of scenes. Built only when a scene names it.
class Effect {
 public:
  virtual ~Effect() = default;
  virtual std::string_view name() const = 0;
  /// Time reached [s].
  virtual Real time() const = 0;
  /// One step of the effect's own choosing, not beyond t_end [s]. Throws UnstableError with the state as
  /// before the step.
  virtual void step(Real t_end) = 0;
  /// Particles to skin, and their volume [m^3]; none by default.
  virtual geometry::Points points() const { return {}; }
  virtual Real volume() const { return 0; }
  /// Spacing of the particles [m], 0 without any.
  virtual Real spacing() const { return 0; }
  /// Where the world's bodies are, in their order, as this effect moves them; empty: it moves none.
  virtual std::vector<geometry::RigidPose> body_poses() const { return {}; }
  /// What bodies that can break are made of now, a piece each (whole ones, too), and what else has come.
  virtual std::vector<SolidPiece> pieces() const { return {}; }
  /// Whether there ever may be pieces that belong to no body of the scene.
  virtual bool makes_pieces() const { return false; }

  /// Where it burns: middles and half heights of flames, their temperature, and the speed of what rises.
  virtual geometry::Points fires() const { return {}; }
  /// Surfaces of its own; their names do not change through a run.
  virtual std::vector<NamedMesh> meshes() const { return {}; }
  /// Particles to draw, not to skin, for files (frames/NAME.####.ply) and pictures. Names do not change through a run.
  virtual std::vector<NamedCloud> clouds() const { return {}; }
  /// Fields for files (frames/NAME.####.vdb); in pictures where draws_volumes(), of that colour (linear light).
  virtual std::vector<geometry::GridVolume> volumes() const { return {}; }
  virtual std::optional<Vec3> draws_volumes() const { return std::nullopt; }

  /// Once, when all effects of the scene are built; they outlive this one's steps. Of another effect it sees the last moment that
  /// it reached: those before it in the scene's order are at the end of the frame, those behind it at its beginning.
  virtual void meet(const std::vector<Effect*>& others) { static_cast<void>(others); }
  /// What others meet: its particles, where they come out, its water.
  virtual FlowView flow() const { return {}; }
  virtual std::vector<Opening> openings() const { return {}; }
  virtual const Water* water() const { return nullptr; }
  virtual SoftSolid soft() { return {}; }
  /// From now on another steps what soft() says: step() leaves it to step(), and time() is its own. Called by that one in its meet().
  virtual void led_by(Effect& leader) { static_cast<void>(leader); }
  /// What it chose by itself, a line each: for `effuse check`.
  virtual std::vector<std::string> remarks() const { return {}; }

  virtual std::size_t memory() const = 0;  ///< bytes held
  virtual void add_to(StateHash& hash) const = 0;
  virtual void save(StateWriter& out) const = 0;
  virtual void load(StateReader& in) = 0;
  /// Figures for the run's report: name and value, in a fixed order.
  virtual std::vector<std::pair<std::string, double>> figures() const = 0;
  /// One line for the progress display: "8,214 particles, dt 12 ms".
  virtual std::string status() const = 0;
};

/// An effect as a scene describes it, not yet built.
struct EffectPlan {
  std::string name;
  std::string kind;  ///< name of its table; read_scene() says it
  std::vector<Partner> partners;  ///< other effects that the scene must have
  Estimate estimate;
  /// What does not fit the world (a vent beside the terrain); may be asked of a plan whose table has faults.
  std::function<std::vector<Fault>(const World&)> misfits;
  /// Throws InputError with the misfits. Not to be asked of a plan whose table has faults.
  std::function<std::unique_ptr<Effect>(const World&)> build;
};

/// An effect there is: its name is the name of its table in a scene.
struct EffectKind {
  std::string name;
  std::string what;
  /// Reads the table; faults stay in parameters. duration: simulated time of the scene [s].
  EffectPlan (*read)(Parameters& parameters, Real duration);
  /// It steps the scene's bodies and obstacles where no other effect meets them; its table is then there without being written.
  bool of_solids = false;
  /// A scene may have several: [[name]]. Each plan's own name is then its table's.
  bool many = false;
};

}  // namespace effuse::flow
