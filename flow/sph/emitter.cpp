#include "flow/sph/emitter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "geometry/base/check.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {

using geometry::Contact;
constexpr std::uint64_t kPhaseStream = 1;  // random numbers: when a vent's sites start

struct OnGround {
  Vec3 at, up;
  Real off;  // from the ground, when last asked [m]
};

/// The points moved down (or up) onto the nearest ground by Newton's method on the signed distance along the
/// vertical; `off` of those that found none tells.
std::vector<OnGround> drop_onto_ground(std::span<const Vec3> points, Real spacing, std::span<const ContactSource> ground) {
  std::vector<OnGround> sites;
  std::vector<Index> open;  // not there yet
  for (const Vec3& p : points) {
    open.push_back(static_cast<Index>(sites.size()));
    sites.push_back({p, Vec3::UnitZ(), 0});
  }
  std::vector<Vec3> at;
  std::vector<Contact> contact, nearest;
  for (int iteration = 0; iteration < 20 && !open.empty(); ++iteration) {
    at.clear();
    for (const Index s : open) at.push_back(sites[s].at);
    contact.resize(open.size());
    nearest.assign(open.size(), Contact{});
    for (const ContactSource& source : ground) {
      source(at, std::numeric_limits<Real>::infinity(), contact);
      for (std::size_t q = 0; q < open.size(); ++q)
        if (contact[q].distance < nearest[q].distance) nearest[q] = contact[q];
    }
    std::vector<Index> still_open;
    for (std::size_t q = 0; q < open.size(); ++q) {
      const Contact& c = nearest[q];
      if (!c.any()) continue;
      OnGround& site = sites[open[q]];
      site.up = c.normal;
      site.off = std::abs(c.distance);
      site.at.z() -= c.distance / std::max(c.normal.z(), 0.2);
      if (site.off >= 1e-6 * spacing) still_open.push_back(open[q]);
    }
    open.swap(still_open);
  }
  return sites;
}

}  // namespace

Emitter::Emitter(std::vector<Vent> vents, Real spacing, std::uint64_t seed, std::span<const ContactSource> ground)
    : vents_(std::move(vents)), spacing_(spacing) {
  CHECK_GT(spacing, 0.0);
  for (std::size_t v = 0; v < vents_.size(); ++v) {
    CHECK(std::isfinite(vents_[v].rate) && vents_[v].rate >= 0);
    const std::vector<Vec3> lattice = vents_[v].lattice(spacing);
    const std::vector<OnGround> placed = drop_onto_ground(lattice, spacing, ground);
    const Real share = static_cast<Real>(lattice.size()) * std::pow(spacing, 3);
    for (std::size_t s = 0; s < lattice.size(); ++s) {
      const Real phase = random_uniform(seed, kPhaseStream, sites_.size());
      // Over a rim or beside a wall of a mesh it runs away: then the height of the vent has to do.
      const bool found = placed[s].off <= spacing;
      sites_.push_back({found ? placed[s].at : lattice[s], found ? placed[s].up : Vec3::UnitZ(), static_cast<Index>(v), share, phase});
    }
  }
}

std::vector<Real> Emitter::volumes(Real t) const {
  std::vector<Real> volume;
  for (const Vent& vent : vents_) volume.push_back(vent.volume(t));
  return volume;
}

std::span<const Emitter::Newborn> Emitter::emit(Real t0, Real t1) {
  CHECK_LT(t0, t1);
  newborn_.clear();
  const std::vector<Real> volume0 = volumes(t0), volume1 = volumes(t1);
  for (std::size_t s = 0; s < sites_.size(); ++s) {
    const Site& site = sites_[s];
    const Real risen0 = volume0[site.vent] / site.share + site.phase, risen1 = volume1[site.vent] / site.share + site.phase;
    for (Real k = std::floor(risen0) + 1; k <= std::floor(risen1); k += 1) {
      newborn_.push_back({site.at + site.up * ((risen1 - k) * spacing_), site.up * ((risen1 - risen0) * spacing_ / (t1 - t0)), vents_[site.vent].temperature,
                          static_cast<Index>(s)});
      site_.push_back(static_cast<Index>(s));
      number_.push_back(k);
    }
  }
  return newborn_;
}

void Emitter::add_free(std::size_t count) {
  site_.resize(site_.size() + count, kFree);
  number_.resize(number_.size() + count, 0);
}

Vec3 Emitter::rise(Index s, Real t0, Real t1) const {
  const Site& site = sites_[s];
  const Vent& vent = vents_[site.vent];
  const Real risen1 = vent.volume(t1) / site.share + site.phase;
  return site.up * ((risen1 - site.phase - vent.volume(t0) / site.share) * spacing_);
}

void Emitter::carry(Real t, Real dt, std::span<Vec3> v) {
  CHECK_EQ(v.size(), size());
  CHECK_GT(dt, 0.0);
  const std::vector<Real> volume0 = volumes(t), volume1 = volumes(t + dt);
  parallel_for(size(), [&](std::size_t i) {
    if (site_[i] == kFree) return;
    const Site& site = sites_[site_[i]];
    const Real volume = volume0[site.vent];
    if (t >= vents_[site.vent].stop || volume / site.share + site.phase - number_[i] >= 1) {
      site_[i] = kFree;
    } else {
      v[i] = site.up * ((volume1[site.vent] - volume) / site.share * spacing_ / dt);
    }
  }, 4096);
}

void Emitter::keep(std::span<const Index> which) {
  gather(site_, which);
  gather(number_, which);
}

std::size_t Emitter::memory() const {
  const auto bytes = [](const auto&... vectors) { return ((vectors.capacity() * sizeof(vectors[0])) + ...); };
  return bytes(sites_, site_, number_, newborn_);
}

void Emitter::check_loaded(std::size_t n) const {
  check_loaded_sizes(n, {site_.size(), number_.size()});
  for (const Index site : site_)
    if (site != kFree && site >= sites_.size())
      throw InputError(Place{}, "the checkpoint names vent site " + std::to_string(site) + " of " + std::to_string(sites_.size()));
}

}  // namespace effuse::flow::sph
