#pragma once

#include <functional>
#include <span>
#include <vector>

#include "flow/sph/particle_arrays.h"
#include "geometry/base/check.h"
#include "geometry/base/types.h"
#include "geometry/base/zones.h"
#include "geometry/collide/contact.h"

namespace effuse::flow::sph {

struct Walls;

/// Fills out[i] with the nearest surface to x[i] of one solid (any() false: none within reach).
using ContactSource = std::function<void(std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out)>;

struct GroundOptions {
  Real reach = 0;      ///< [m] > 0: nearer surfaces are contacts
  Real look = 0;       ///< [m] >= reach: how far a question looks. A particle further away than reach is left in peace
                       ///< until it may have come within. 0: twice the reach, which on a flow ten spacings deep asks
                       ///< about half of the particles or less, and costs no more than any other
  Real clearance = 0;  ///< [m], 0 < clearance <= reach: nearer than this the projection lets no particle
  int rounds = 8;      ///< of the projection, at most. 1: pushed once by each source and not looked at again
};

/// The ground as particles meet it: contacts of those that may be near, and the hard projection that lets none inside.
///
/// Of every particle it holds a bound [m]: no ground is nearer than this. A question sets it; movement lowers it
/// by its path, for a distance is 1-Lipschitz. No particle is asked about again before its bound says that it
/// might be near. That leaves out ground that appears (an obstacle that jumps): tell moved() how far the ground itself went.
/// Beyond the ground's edge, where a source sees none and inside() is false, a particle is asked about every time.
///
/// Contacts are those of the positions asked about; between two questions a contact stands for its tangent plane.
/// The same bits on any number of threads, if the sources keep to that. Not thread-safe itself.
class Ground {
 public:
  /// Checks the options. inside: whether a point has ground above or below it; empty: everywhere.
  Ground(const GroundOptions& options, std::vector<ContactSource> sources, std::function<bool(const Vec3&)> inside = {});

  std::span<const ContactSource> sources() const { return sources_; }
  const GroundOptions& options() const { return options_; }
  bool has_edge() const { return inside_ != nullptr; }

  /// Finds the contacts of the particles that may be within reach and for which asked(i); all others have none.
  /// x: n positions [m]. asked: called once each at most, in parallel.
  template <class F>
  void find(std::span<const Vec3> x, F&& asked) {
    ZONE("sph.contacts");
    CHECK_EQ(x.size(), size());
    select(x.size(), [&](std::size_t i) { return bound_[i] <= options_.reach && asked(i); }, asked_);
    find_asked(x);
  }
  void find(std::span<const Vec3> x) {
    find(x, [](std::size_t) { return true; });
  }
  /// f(contact, d) for each source's contact of particle i, d < reach its distance [m] from the contact's tangent
  /// plane when it is at x. In the order of the sources.
  template <class F>
  void for_each_contact(std::size_t i, const Vec3& x, F&& f) const {
    const Index place = place_[i];
    if (place == kNone) return;
    for (std::size_t s = 0; s < sources_.size(); ++s) {
      const geometry::Contact& c = contacts_[s * asked_.size() + place];
      if (!c.any()) continue;
      const Real d = c.distance + c.normal.dot(x - query_[place]);
      if (d < options_.reach) f(c, d);
    }
  }
  /// All of them as lists for the implicit solvers, particles at x: distance and reach are d, curvature is 0.
  void list_walls(std::span<const Vec3> x, Walls& walls) const;

  /// Particles went from `before` to `after`, n each; the ground itself by at most ground_path [m]. On straight lines,
  /// or not further apart than they went.
  void moved(std::span<const Vec3> before, std::span<const Vec3> after, Real ground_path = 0);

  struct Projection {
    std::size_t pushed = 0;     ///< particles that were moved
    std::size_t unsettled = 0;  ///< of them, still pushed in the last of all rounds: in a cleft too narrow for them
  };
  /// Moves the particles with free(i) that are nearer than the clearance out to it, along the contact's normal, and takes
  /// away their speed into the surface. On curved ground, or between two solids, one push may lead into another wall:
  /// those pushed are asked about again, and pushed again while nearer than half the clearance.
  ///   x, v  n positions [m] and velocities [m/s]; changed
  template <class F>
  Projection project(std::span<Vec3> x, std::span<Vec3> v, F&& free) {
    ZONE("sph.contacts");
    CHECK_EQ(x.size(), size());
    CHECK_EQ(v.size(), size());
    select(x.size(), [&](std::size_t i) { return bound_[i] < options_.clearance && free(i); }, suspects_);
    return project_suspects(x, v);
  }

  /// The particles, rising, that have not left the ground: who lies on it has not, nor who is in the midst of others,
  /// nor who has ground above or below.
  ///   x        n positions [m]
  ///   surface  n flags
  ///   off      further than this from the ground a particle does not lie on it [m]
  std::vector<Index> who_stays(std::span<const Vec3> x, std::span<const std::uint8_t> surface, Real off) const;

  /// No ground is nearer to particle i than this [m]; -infinity: never asked.
  Real bound(std::size_t i) const { return bound_[i]; }

  std::size_t size() const { return bound_.size(); }
  void born(std::size_t count = 1);
  /// Contacts found before are forgotten.
  void keep(std::span<const Index> which);
  std::size_t memory() const;
  /// After loading. Contacts found before are forgotten.
  void check_loaded(std::size_t n) {
    check_loaded_sizes(n, {bound_.size()});
    forget_contacts();
  }
  template <class Self, class Archive>
  static void arrays(Self& self, Archive& io) {
    io.array("ground_bound", self.bound_);
  }

 private:
  static constexpr Index kNone = ~Index{0};
  void forget_contacts() {
    asked_.clear();
    place_.assign(size(), kNone);
  }
  void find_asked(std::span<const Vec3> x);
  Projection project_suspects(std::span<Vec3> x, std::span<Vec3> v);

  GroundOptions options_;
  std::vector<ContactSource> sources_;
  std::function<bool(const Vec3&)> inside_;
  std::vector<Real> bound_;  // the state, all of it saved

  std::vector<Index> asked_;                 // particles whose contacts were asked for, rising
  std::vector<Index> place_;                 // particle -> place in asked_, or kNone
  std::vector<Vec3> query_;                  // where they were
  std::vector<geometry::Contact> contacts_;  // sources one after another, each over asked_
  std::vector<Index> suspects_;              // of the projection
};

}  // namespace effuse::flow::sph
