#include "flow/particles/particle_cloud.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"

namespace effuse::flow::particles {

namespace {
constexpr std::size_t kGrain = 4096;
constexpr std::size_t kBlock = 128;   // particles whose eddies are asked for together
constexpr Real kEddyStrength = 1.6;   // of the noise's curl per unit of amplitude: its deviation is then about the turbulence
constexpr std::uint64_t kThinning = 20;  // stream of an emitter's seed, of none of its own numbers
constexpr std::array<std::uint64_t, 3> kEddySeeds = {0xed01, 0xed02, 0xed03};
constexpr std::size_t kEddyPoints = 4;   // of the noise's lattice a particle, at most, are kept in a table
enum Death : std::uint8_t { kAlive, kAged, kLeft, kFallen };

/// Where the eddies' noise is looked up: through its own pattern, drifting.
Vec3 in_noise(const Vec3& x, Real t, const Forces& f) { return x / f.eddy_size + Vec3(0.31, -0.17, 0.23) * (t * f.turbulence / f.eddy_size); }
}  // namespace

ParticleCloud::ParticleCloud(const CloudOptions& options, std::vector<EmitterOptions> emitters, Contacts contacts, Move move)
    : options_(options), noise_(kEddySeeds), contacts_(std::move(contacts)), move_(std::move(move)) {
  CHECK_GE(options.forces.response, 0);
  CHECK_GT(options.forces.eddy_size, 0);
  for (EmitterOptions& each : emitters) emitters_.emplace_back(each);
  let_out_.assign(emitters_.size(), 0);
}

Real ParticleCloud::temperature(std::size_t i) const {
  if (options_.cooling <= 0) return temperature_[i];
  return options_.air_temperature + (temperature_[i] - options_.air_temperature) * std::exp(-age(i) / options_.cooling);
}

void ParticleCloud::step(Real dt, std::span<const Sources> sources) {
  ZONE("particles");
  CHECK_GT(dt, 0);
  if (!sources.empty()) CHECK_EQ(sources.size(), emitters_.size());
  // Newborns join with their birth's position; their own step is from their birth to the step's end.
  const std::size_t old = size();
  const Real end = time_ + dt;
  for (std::size_t e = 0; e < emitters_.size(); ++e) {
    const std::uint64_t until = emitters_[e].born_by(end);
    const bool from_points = emitters_[e].options().shape == EmitterShape::kPoints;
    const Sources own = from_points && !sources.empty() ? sources[e] : Sources{};
    if (from_points && own.x.empty()) {
      let_out_[e] = until;
      continue;
    }
    for (std::uint64_t k = let_out_[e]; k < until; ++k) {
      if (own.share < 1 && random_uniform(emitters_[e].options().seed, kThinning, k) >= own.share) continue;
      const Newborn p = emitters_[e].particle(k, own.x, own.v);
      x_.push_back(p.x);
      v_.push_back(p.v);
      born_.push_back(p.born);
      lifetime_.push_back(p.lifetime);
      size_.push_back(p.size);
      temperature_.push_back(p.temperature);
      id_.push_back(static_cast<std::uint64_t>(e) << 48 | k);
      stuck_.push_back(0);
    }
    let_out_[e] = until;
  }
  counts_.born += size() - old;
  dx_.resize(size());
  dead_.assign(size(), kAlive);
  if (options_.forces.turbulence > 0) {
    const auto at = [&](std::size_t i) { return Box3(in_noise(x_[i], time_, options_.forces)); };
    noise_.cover(parallel_reduce(size(), Box3(), at, [](const Box3& a, const Box3& b) { return a.merged(b); }, kGrain), kEddyPoints * size());
  }
  parallel_ranges(size(), kGrain, [&](std::size_t begin, std::size_t stop) {
    for (std::size_t b = begin; b < stop; b += kBlock) advance(b, std::min(stop, b + kBlock), dt);
  });
  time_ = end;
  // Those that lie are asked for nothing.
  moving_.clear();
  for (std::size_t i = 0; i < size(); ++i)
    if (!stuck_[i]) moving_.push_back(static_cast<Index>(i));
  if (move_) {
    const auto gather = [&](const std::vector<Vec3>& from, std::vector<Vec3>& to) {
      to.resize(moving_.size());
      parallel_for(moving_.size(), [&](std::size_t q) { to[q] = from[moving_[q]]; }, kGrain);
    };
    gather(x_, moved_x_);
    gather(dx_, moved_dx_);
    gather(v_, moved_v_);
    move_(moved_x_, moved_dx_, moved_v_);
    parallel_for(moving_.size(), [&](std::size_t q) { x_[moving_[q]] = moved_x_[q], v_[moving_[q]] = moved_v_[q]; }, kGrain);
  } else {
    parallel_for(moving_.size(), [&](std::size_t q) { x_[moving_[q]] += dx_[moving_[q]]; }, kGrain);
  }
  if (contacts_) meet_solids();
  parallel_for(size(), [&](std::size_t i) {
    if (time_ - born_[i] >= lifetime_[i]) dead_[i] = kAged;
    if (options_.room && !options_.room->contains(x_[i])) dead_[i] = kLeft;
  }, kGrain);

  // The last one takes the place of each that died: order is by history, not by number.
  std::size_t n = size();
  for (std::size_t i = 0; i < n;) {
    if (dead_[i] == kAlive) {
      ++i;
      continue;
    }
    ++(dead_[i] == kAged ? counts_.aged : dead_[i] == kLeft ? counts_.left : counts_.fallen);
    --n;
    x_[i] = x_[n];
    v_[i] = v_[n];
    born_[i] = born_[n];
    lifetime_[i] = lifetime_[n];
    size_[i] = size_[n];
    temperature_[i] = temperature_[n];
    id_[i] = id_[n];
    stuck_[i] = stuck_[n];
    dead_[i] = dead_[n];
  }
  x_.resize(n);
  v_.resize(n);
  born_.resize(n);
  lifetime_.resize(n);
  size_.resize(n);
  temperature_.resize(n);
  id_.resize(n);
  stuck_.resize(n);
}

/// With a and air speed w held, over a time s:  u = v - w,  k = 1 / response,
///   u1 = u e^(-k s) + a (1 - e^(-k s)) / k,   dx = w s + (u - a / k) (1 - e^(-k s)) / k + a s / k.
void ParticleCloud::advance(std::size_t begin, std::size_t end, Real dt) {
  const Forces& f = options_.forces;
  const Vec3 weight(0, 0, -f.gravity * (1 - f.buoyancy));
  const Real k = f.response > 0 ? 1 / f.response : 0;
  const Real whole_fade = std::exp(-k * dt), whole_gone = -std::expm1(-k * dt);
  // The eddies about all that moves, in its order.
  DCHECK(end - begin <= kBlock);
  std::array<Vec3, kBlock> at, air;
  if (f.turbulence > 0 && k > 0) {
    std::size_t n = 0;
    for (std::size_t i = begin; i < end; ++i)
      if (!stuck_[i]) at[n++] = in_noise(x_[i], time_, f);
    noise_.sample(std::span(at).first(n), std::span(air).first(n));
  }
  std::size_t next = 0;
  for (std::size_t i = begin; i < end; ++i) {
    if (stuck_[i]) {
      dx_[i] = Vec3::Zero();
      continue;
    }
    const bool newborn = born_[i] > time_;
    const Real s = newborn ? time_ + dt - born_[i] : dt;
    Vec3 a = weight;
    for (const Attractor& pull : f.attractors) {
      const Vec3 d = pull.at - x_[i] - s / 2 * v_[i];
      const Real r2 = d.squaredNorm() + pull.softening * pull.softening;
      a += pull.strength / (r2 * std::sqrt(r2)) * d;
    }
    if (k == 0) {
      dx_[i] = s * v_[i] + s * s / 2 * a;
      v_[i] += s * a;
      continue;
    }
    Vec3 w = f.wind;
    if (f.turbulence > 0) w += f.turbulence / kEddyStrength * air[next++];
    const Real fade = newborn ? std::exp(-k * s) : whole_fade, gone = newborn ? -std::expm1(-k * s) : whole_gone;
    const Vec3 settled = a / k, u = v_[i] - w;
    dx_[i] = s * (w + settled) + gone / k * (u - settled);
    v_[i] = w + fade * u + gone * settled;
  }
}

/// Those that ended inside a solid, or nearer than their radius, are set on its surface.
void ParticleCloud::meet_solids() {
  ZONE("particles.contacts");
  const std::size_t n = moving_.size();
  const Real reach = parallel_max(n, 0.0, [&](std::size_t q) { return size_[moving_[q]]; });
  found_.resize(n);
  moved_x_.resize(n);
  parallel_for(n, [&](std::size_t q) { moved_x_[q] = x_[moving_[q]]; }, kGrain);
  contacts_(moved_x_, reach, found_);
  parallel_for(n, [&](std::size_t q) {
    const std::size_t i = moving_[q];
    const geometry::Contact& c = found_[q];
    if (!c.any() || c.distance >= size_[i]) return;
    x_[i] += (size_[i] - c.distance) * c.normal;
    if (options_.on_contact == OnContact::kDie) {
      dead_[i] = kFallen;
      return;
    }
    if (options_.on_contact == OnContact::kStick) {
      v_[i] = Vec3::Zero();
      stuck_[i] = 1;
      return;
    }
    const Vec3 v = v_[i] - c.surface_velocity;
    const Real approach = v.dot(c.normal);
    if (approach >= 0) return;
    const Vec3 slip = v - approach * c.normal;
    const Real speed = slip.norm(), brake = -options_.friction * (1 + options_.restitution) * approach;
    v_[i] = c.surface_velocity - options_.restitution * approach * c.normal;
    if (speed > brake) v_[i] += (1 - brake / speed) * slip;
  }, kGrain);
}

bool ParticleCloud::finite() const {
  return parallel_reduce(size(), true, [&](std::size_t i) { return x_[i].allFinite() && v_[i].allFinite(); }, [](bool a, bool b) { return a && b; }, kGrain);
}

template <class Self, class Archive>
void ParticleCloud::arrays(Self& self, Archive& io) {
  io.array("let out", self.let_out_);
  io.array("x", self.x_);
  io.array("v", self.v_);
  io.array("born", self.born_);
  io.array("lifetime", self.lifetime_);
  io.array("size", self.size_);
  io.array("temperature", self.temperature_);
  io.array("id", self.id_);
  io.array("stuck", self.stuck_);
  io.value("time", self.time_);
  io.value("born", self.counts_.born);
  io.value("aged", self.counts_.aged);
  io.value("left", self.counts_.left);
  io.value("fallen", self.counts_.fallen);
}

void ParticleCloud::save(StateWriter& out) const { arrays(*this, out); }

void ParticleCloud::load(StateReader& in) {
  arrays(*this, in);
  const std::size_t n = x_.size();
  if (let_out_.size() != emitters_.size() || v_.size() != n || born_.size() != n || lifetime_.size() != n || size_.size() != n || temperature_.size() != n ||
      id_.size() != n || stuck_.size() != n)
    throw InputError(Place{"particles"}, "the checkpoint's arrays do not agree with one another or with the scene's emitters");
}

void ParticleCloud::add_to(StateHash& hash) const {
  hash.add(time_);
  hash.add(std::span<const Vec3>(x_));
  hash.add(std::span<const Vec3>(v_));
  hash.add(std::span<const Real>(born_));
  hash.add(std::span<const std::uint64_t>(id_));
}

std::size_t ParticleCloud::memory() const {
  return (x_.capacity() + v_.capacity() + dx_.capacity()) * sizeof(Vec3) +
         (born_.capacity() + lifetime_.capacity() + size_.capacity() + temperature_.capacity()) * sizeof(Real) + id_.capacity() * sizeof(std::uint64_t) +
         (moved_x_.capacity() + moved_dx_.capacity() + moved_v_.capacity()) * sizeof(Vec3) + moving_.capacity() * sizeof(Index) + stuck_.capacity() + dead_.capacity() + found_.capacity() * sizeof(geometry::Contact) + noise_.memory();
}

}  // namespace effuse::flow::particles
