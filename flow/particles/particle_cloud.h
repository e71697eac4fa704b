#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "flow/particles/emitter.h"
#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/base/types.h"
#include "geometry/collide/contact.h"
#include "geometry/procedural/curl_noise.h"

namespace effuse::flow::particles {

/// Pulls towards a point:  strength (at - x) / (|at - x|^2 + softening^2)^(3/2), strength [m^3/s^2], < 0 pushes.
struct Attractor {
  Vec3 at = Vec3::Zero();
  Real strength = 0;
  Real softening = 0.1;  ///< [m]
};

/// What acts on every particle between births and deaths:
///   v' = gravity (1 - buoyancy) + attractors - (v - wind - eddies(x, t)) / response
/// gravity points down z; buoyancy 1 floats, 2 rises as fast as it would fall. Eddies: the curl of gradient noise, so that they
/// have no sources (geometry's CurlNoise), about turbulence [m/s] strong and eddy_size [m] wide, changing over eddy_size / turbulence [s].
struct Forces {
  Real gravity = kGravity;
  Real buoyancy = 0;
  Real response = 0;  ///< [s] in which a particle takes on the air's speed; 0: no drag
  Vec3 wind = Vec3::Zero();
  Real turbulence = 0, eddy_size = 1;
  std::vector<Attractor> attractors;
};

/// When it meets something solid.
enum class OnContact { kBounce, kStick, kDie };

struct CloudOptions {
  Forces forces;
  OnContact on_contact = OnContact::kBounce;
  Real restitution = 0.3, friction = 0.5;  ///< of kBounce: share of the approaching speed given back; Coulomb's coefficient
  std::optional<Box3> room;                ///< particles that leave it die
  Real growth = 0;                         ///< radius = size (1 + growth age) [1/s]
  Real cooling = 0;                        ///< [s] in which the excess over the air's temperature falls to 1/e; 0: it does not cool
  Real air_temperature = 288;              ///< [K]
};

/// Particles that do not know of one another: snow, dust, sand, sparks, fire, smoke, steam.
///
/// Each step is exact for constant air and acceleration (the linear equation's own solution), so closed forms are met to
/// rounding at any step; attractors pull as in the middle of the step's way (second order), eddies as at its start (first). The same bits on any number of threads.
class ParticleCloud {
 public:
  /// contacts: nearest solid within reach of each point, as flow/sph's ContactSource; none: nothing solid is there.
  using Contacts = std::function<void(std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out)>;
  /// Moves x by dx past what must not be jumped over, and v with it (slide_all of geometry/collide); none: x += dx.
  using Move = std::function<void(std::span<Vec3> x, std::span<const Vec3> dx, std::span<Vec3> v)>;
  explicit ParticleCloud(const CloudOptions& options, std::vector<EmitterOptions> emitters, Contacts contacts = {}, Move move = {});

  /// What an emitter of kPoints is born from in a step: points and their velocities, of equal number; without any it rests.
  /// share: of its births that take place, 0..1, which ones being a function of their numbers.
  struct Sources {
    std::span<const Vec3> x, v;
    Real share = 1;
  };
  /// Births, motion, contacts and deaths of [time, time + dt], dt > 0. sources: one an emitter, read of those of kPoints; or none.
  void step(Real dt, std::span<const Sources> sources = {});

  Real time() const { return time_; }
  std::size_t size() const { return x_.size(); }
  std::span<const Vec3> positions() const { return x_; }
  std::span<const Vec3> velocities() const { return v_; }
  std::span<const std::uint64_t> ids() const { return id_; }  ///< emitter's number << 48 | particle's number
  Real age(std::size_t i) const { return time_ - born_[i]; }
  Real lifetime(std::size_t i) const { return lifetime_[i]; }
  Real radius(std::size_t i) const { return size_[i] * (1 + options_.growth * age(i)); }
  Real temperature(std::size_t i) const;

  struct Counts {
    std::uint64_t born = 0, aged = 0, left = 0, fallen = 0;  ///< fallen: died of a contact
  };
  const Counts& counts() const { return counts_; }
  /// Whether every position and velocity is finite.
  bool finite() const;

  std::size_t memory() const;
  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  void load(StateReader& in);

 private:
  void advance(std::size_t begin, std::size_t end, Real dt);
  void meet_solids();
  template <class Self, class Archive>
  static void arrays(Self& self, Archive& io);

  CloudOptions options_;
  geometry::CurlNoise noise_;  // of the eddies
  std::vector<Emitter> emitters_;
  Contacts contacts_;
  Move move_;
  Real time_ = 0;
  std::vector<std::uint64_t> let_out_;  // by each emitter
  Counts counts_;
  std::vector<Vec3> x_, v_, dx_;
  std::vector<Real> born_, lifetime_, size_, temperature_;
  std::vector<std::uint64_t> id_;
  std::vector<std::uint8_t> stuck_, dead_;
  // Of a step: those that do not lie, and theirs.
  std::vector<Index> moving_;
  std::vector<Vec3> moved_x_, moved_dx_, moved_v_;
  std::vector<geometry::Contact> found_;
};

}  // namespace effuse::flow::particles
