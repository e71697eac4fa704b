#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "flow/sph/ground.h"
#include "flow/sph/particle_arrays.h"
#include "flow/sph/vent.h"
#include "geometry/base/types.h"

namespace effuse::flow::sph {

/// Lets particles out of vents, on time, and carries each until it has risen one spacing (see Vent).
///
/// A site s of a vent, one of n, has let out by time t
///   floor(risen),   risen = volume(t) / (n spacing^3) + phase,   phase uniform in [0, 1) of (seed, s)
/// particles; its particle number k is (risen - k) spacings above the ground. Both are functions of t alone: the
/// volume is right to within one particle a site whatever the steps were, and a run resumed goes on as it would have.
///
/// Holds for every particle of the solver which site carries it, none for most; keep() and add_free() go in step with
/// the solver's own arrays. Not thread-safe itself; the same bits on any number of threads.
class Emitter {
 public:
  /// Sites one spacing [m] apart over the vents (Vent::lattice), moved up or down onto the surface of all the sources'
  /// solids together. Where that is not found (over a rim, beside a wall) a site keeps the vent's height.
  /// Checks the vents: rate finite and >= 0.
  Emitter(std::vector<Vent> vents, Real spacing, std::uint64_t seed, std::span<const ContactSource> ground);

  struct Site {
    Vec3 at, up;  ///< on the ground [m], and its normal there
    Index vent;
    Real share;   ///< of the vent's volume that makes one particle come out here [m^3]
    Real phase;   ///< 0..1: how far its first particle is on its way
  };
  std::span<const Site> sites() const { return sites_; }
  std::span<const Vent> vents() const { return vents_; }

  struct Newborn {
    Vec3 x, v;         ///< [m], [m/s]
    Real temperature;  ///< [K]
    Index site;
  };
  /// The particles let out in (t0, t1], t0 < t1 [s], as they are at t1, by site and number. Their carriers are added
  /// here: the caller adds all of them to its own arrays, in this order. t0: the t1 of the call before, to the bit, lest
  /// one be let out twice or never. Valid until the next call.
  std::span<const Newborn> emit(Real t0, Real t1);
  /// Whether any vent lets lava out between t0 and t1 [s].
  bool emits(Real t0, Real t1) const { return volumes(t0) != volumes(t1); }
  /// Particles that no vent carries.
  void add_free(std::size_t count = 1);
  /// How far [m] the lava at a site rises from t0 to t1: what comes out at t1 was, at t0, that far down the conduit.
  Vec3 rise(Index site, Real t0, Real t1) const;

  /// Frees the particles that have risen one spacing by t, or whose vent has closed; the others get the
  /// mean speed of their vent over (t, t + dt), dt > 0. May be asked again with the same t and another dt.
  ///   v  [m/s], n; those of free particles are left alone
  void carry(Real t, Real dt, std::span<Vec3> v);

  /// Whether a vent carries particle i: it neither feels the ground (there is no floor under it) nor any force.
  bool held(std::size_t i) const { return site_[i] != kFree; }

  std::size_t size() const { return site_.size(); }
  void keep(std::span<const Index> which);
  std::size_t memory() const;
  /// Throws InputError unless what was loaded is of n particles and of these vents.
  void check_loaded(std::size_t n) const;
  template <class Self, class Archive>
  static void arrays(Self& self, Archive& io) {
    io.array("site", self.site_);
    io.array("number", self.number_);
  }

 private:
  static constexpr Index kFree = ~Index{0};
  std::vector<Real> volumes(Real t) const;  // let out by t, of each vent

  std::vector<Vent> vents_;
  Real spacing_;
  std::vector<Site> sites_;
  std::vector<Index> site_;   // that carries the particle; kFree: none
  std::vector<Real> number_;  // which of that site's particles it is
  std::vector<Newborn> newborn_;
};

}  // namespace effuse::flow::sph
