#include "geometry/procedural/ocean.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {

namespace {
constexpr Real kMostFold = 0.9;  // sum of k a steepness; at 1 crests become cusps, beyond they loop
constexpr std::uint64_t kDirection = 0x0cea, kPhase = 0x0ceb;
}  // namespace

Ocean::Ocean(const OceanOptions& options, std::vector<OceanWave> waves) : options_(options), waves_(std::move(waves)) {
  const auto wrong = [](const std::string& what) { throw InputError(Place{"ocean"}, what); };
  if (!(options.depth > 0)) wrong(fmt::format("a depth of {:g} m, wanted more than 0", options.depth));
  if (!(options.steepness >= 0 && options.steepness <= 1)) wrong(fmt::format("a steepness of {:g}, wanted 0 to 1", options.steepness));
  Real fold = 0;
  for (const OceanWave& w : waves_) {
    if (!(w.wavelength > 0) || !std::isfinite(w.wavelength)) wrong(fmt::format("a wavelength of {:g} m, wanted more than 0", w.wavelength));
    if (!std::isfinite(w.amplitude) || !std::isfinite(w.direction) || !std::isfinite(w.phase)) wrong("a wave with an amplitude, direction or phase that is no number");
    const Real k = 2 * kPi / w.wavelength;
    k_.push_back(k * Vec2(std::cos(w.direction), std::sin(w.direction)));
    omega_.push_back(std::sqrt(kGravity * k * std::tanh(k * options.depth)));
    fold += k * std::abs(w.amplitude);
  }
  options_.steepness = std::min(options.steepness, fold > 0 ? kMostFold / fold : 1);
}

Ocean::Sample Ocean::at_rest_point(const Vec2& rest, Real t) const {
  Sample s{Vec3(rest.x(), rest.y(), options_.level), Vec3::Zero(), Vec3::UnitZ()};
  Vec3 along_x = Vec3::UnitX(), along_y = Vec3::UnitY();
  const Real steep = options_.steepness;
  for (std::size_t w = 0; w < waves_.size(); ++w) {
    const Real a = waves_[w].amplitude, p = k_[w].dot(rest) - omega_[w] * t + waves_[w].phase, sine = std::sin(p), cosine = std::cos(p);
    const Vec2 d = k_[w].normalized();
    s.position += a * Vec3(-steep * sine * d.x(), -steep * sine * d.y(), cosine);
    s.velocity += a * omega_[w] * Vec3(steep * cosine * d.x(), steep * cosine * d.y(), sine);
    const Vec3 slope = -a * Vec3(steep * cosine * d.x(), steep * cosine * d.y(), sine);
    along_x += k_[w].x() * slope;
    along_y += k_[w].y() * slope;
  }
  s.normal = along_x.cross(along_y).normalized();
  return s;
}

Real Ocean::height(const Vec2& place, Real t) const {
  Vec2 rest = place;
  Real shortest = 1;
  for (const OceanWave& w : waves_) shortest = std::min(shortest, w.wavelength);
  for (int round = 0; round < 50; ++round) {
    Vec2 off = rest - place;
    Eigen::Matrix2d slope = Eigen::Matrix2d::Identity();
    for (std::size_t w = 0; w < waves_.size(); ++w) {
      const Real a = options_.steepness * waves_[w].amplitude, p = k_[w].dot(rest) - omega_[w] * t + waves_[w].phase;
      const Vec2 d = k_[w].normalized();
      off -= a * std::sin(p) * d;
      slope -= a * std::cos(p) * d * k_[w].transpose();
    }
    if (off.norm() < 1e-9 * shortest) break;
    rest -= slope.inverse() * off;  // never singular: the fold is below 1
  }
  return at_rest_point(rest, t).position.z();
}

std::vector<OceanWave> wind_sea(Real wind_speed, Real wind_direction, int count, std::uint64_t seed) {
  CHECK_GE(count, 1);
  std::vector<OceanWave> waves;
  if (!(wind_speed > 0)) return waves;
  // The share of energy above omega is 1 - exp(-0.74 (g / (omega U))^4): bands of equal energy in closed form.
  const Real m0 = 8.1e-3 * std::pow(wind_speed, 4) / (4 * 0.74 * kGravity * kGravity);
  for (int k = 0; k < count; ++k) {
    const Real share = (k + 0.5) / count;  // of the energy below the band's middle: exp(-0.74 x^4) = share
    const Real omega = kGravity / wind_speed * std::pow(-std::log(share) / 0.74, -0.25);
    const auto index = static_cast<std::uint64_t>(k);
    // cos^2 over (-pi/2, pi/2): the cumulative a / pi + sin(2 a) / (2 pi) + 1/2, turned round by bisection.
    const Real u = random_uniform(seed, kDirection, index);
    Real low = -kPi / 2, high = kPi / 2;
    for (int round = 0; round < 60; ++round) {
      const Real a = (low + high) / 2;
      (a / kPi + std::sin(2 * a) / (2 * kPi) + 0.5 < u ? low : high) = a;
    }
    waves.push_back({std::sqrt(2 * m0 / count), 2 * kPi * kGravity / (omega * omega), wind_direction + low, 2 * kPi * random_uniform(seed, kPhase, index)});
  }
  return waves;
}

TriMesh ocean_mesh(const Ocean& ocean, const Vec2& low, const Vec2& high, int nx, int ny, Real t) {
  TriMesh mesh = make_grid(Vec3(low.x(), low.y(), 0), (high - low).cwiseQuotient(Vec2(nx, ny)), nx, ny);
  mesh.normals.resize(mesh.positions.size());
  VertexAttribute& velocity = mesh.attributes["velocity"];
  velocity.width = 3;
  velocity.values.resize(3 * mesh.positions.size());
  parallel_for(mesh.positions.size(), [&](std::size_t i) {
    const Ocean::Sample s = ocean.at_rest_point(mesh.positions[i].head<2>(), t);
    mesh.positions[i] = s.position;
    mesh.normals[i] = s.normal;
    for (std::size_t c = 0; c < 3; ++c) velocity.values[3 * i + c] = static_cast<float>(s.velocity[static_cast<Eigen::Index>(c)]);
  });
  return mesh;
}

}  // namespace effuse::geometry
