#include "flow/particles/emitter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/random.h"

namespace effuse::flow::particles {

namespace {

/// What each random number is for: streams of one seed. The normal ones take two.
enum Stream : std::uint64_t { kPiece = 10, kAlongA, kAlongB, kCone, kTurn, kSpeed = 40, kLife, kSize, kHeat };

/// Direction within half_angle of axis, uniform over the cap:  cos of the angle to the axis uniform in [cos half_angle, 1].
Vec3 in_cone(const Vec3& axis, Real half_angle, Real u, Real turn) {
  if (half_angle <= 0) return axis;
  const Real c = 1 - u * (1 - std::cos(half_angle)), s = std::sqrt(std::max(0.0, 1 - c * c));
  const Vec3 a = axis.unitOrthogonal(), b = axis.cross(a);
  return c * axis + s * (std::cos(2 * kPi * turn) * a + std::sin(2 * kPi * turn) * b);
}

}  // namespace

Emitter::Emitter(const EmitterOptions& options) : options_(options) {
  const auto wrong = [](const std::string& what) { throw InputError(Place{"emitter"}, what); };
  if (!(options.rate >= 0) || !std::isfinite(options.rate)) wrong(fmt::format("a rate of {} 1/s", options.rate));
  if (!(options.lifetime > 0)) wrong(fmt::format("a lifetime of {} s", options.lifetime));
  if (!(options.direction.norm() > 0)) wrong("a direction without length");
  options_.direction.normalize();
  Real sum = 0;
  if (options.shape == EmitterShape::kMesh) {
    for (const geometry::Triangle& t : options.mesh.triangles) {
      const Vec3& a = options.mesh.positions[t[0]];
      sum += (options.mesh.positions[t[1]] - a).cross(options.mesh.positions[t[2]] - a).norm() / 2;
      measure_.push_back(sum);
    }
    if (!(sum > 0)) wrong("a mesh without area");
  }
  if (options.shape == EmitterShape::kCurve) {
    for (std::size_t k = 1; k < options.curve.size(); ++k) {
      sum += (options.curve[k] - options.curve[k - 1]).norm();
      measure_.push_back(sum);
    }
    if (!(sum > 0)) wrong("a curve without length");
  }
}

std::uint64_t Emitter::born_by(Real t) const {
  const Real open = std::clamp(t, options_.start, std::max(options_.start, options_.stop)) - options_.start;
  const Real count = std::ceil(open * options_.rate);
  return count > 0 ? static_cast<std::uint64_t>(std::min(count, 9e18)) : 0;
}

Newborn Emitter::particle(std::uint64_t k, std::span<const Vec3> points, std::span<const Vec3> velocities) const {
  const EmitterOptions& o = options_;
  const auto uniform = [&](Stream s) { return random_uniform(o.seed, s, k); };
  const auto about = [&](Real mean, Real spread, Stream s) {
    return spread > 0 ? mean * std::max(0.1, 1 + spread * std::clamp(random_normal(o.seed, s, k), -3.0, 3.0)) : mean;
  };
  Newborn p;
  p.born = o.start + static_cast<Real>(k) / o.rate;
  p.x = o.at;
  p.v = o.carried;
  Vec3 axis = o.direction;
  switch (o.shape) {
    case EmitterShape::kPoint: break;
    case EmitterShape::kDisk: {
      const Vec3 a = axis.unitOrthogonal(), b = axis.cross(a);
      const Real r = o.radius * std::sqrt(uniform(kAlongA)), turn = 2 * kPi * uniform(kAlongB);
      p.x += r * (std::cos(turn) * a + std::sin(turn) * b);
      break;
    }
    case EmitterShape::kMesh: {
      const std::size_t at = static_cast<std::size_t>(std::upper_bound(measure_.begin(), measure_.end(), uniform(kPiece) * measure_.back()) - measure_.begin());
      const geometry::Triangle& t = o.mesh.triangles[std::min(at, measure_.size() - 1)];
      const Vec3 &a = o.mesh.positions[t[0]], &b = o.mesh.positions[t[1]], &c = o.mesh.positions[t[2]];
      const Real u = std::sqrt(uniform(kAlongA)), w = uniform(kAlongB);
      p.x = (1 - u) * a + u * (1 - w) * b + u * w * c;
      axis = Quat::FromTwoVectors(Vec3::UnitZ(), (b - a).cross(c - a)) * axis;
      break;
    }
    case EmitterShape::kCurve: {
      const Real s = uniform(kPiece) * measure_.back();
      const std::size_t at = std::min(measure_.size() - 1, static_cast<std::size_t>(std::upper_bound(measure_.begin(), measure_.end(), s) - measure_.begin()));
      const Real before = at > 0 ? measure_[at - 1] : 0;
      p.x = o.curve[at] + (s - before) / (measure_[at] - before) * (o.curve[at + 1] - o.curve[at]);
      break;
    }
    case EmitterShape::kPoints: {
      CHECK_EQ(points.size(), velocities.size());
      CHECK(!points.empty());
      const std::size_t at = std::min(points.size() - 1, static_cast<std::size_t>(uniform(kPiece) * static_cast<Real>(points.size())));
      p.x = points[at];
      p.v += velocities[at];
      break;
    }
  }
  p.v += about(o.speed, o.speed_spread, kSpeed) * in_cone(axis, o.spread, uniform(kCone), uniform(kTurn));
  p.lifetime = about(o.lifetime, o.lifetime_spread, kLife);
  p.size = about(o.size, o.size_spread, kSize);
  p.temperature = about(o.temperature, o.temperature_spread, kHeat);
  return p;
}

}  // namespace effuse::flow::particles
