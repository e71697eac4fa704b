#include "skin/detail/material.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {
constexpr Real kPlanar = 0.05;  // [spacings] sqrt(lambda)
}  // namespace

Material::Material(const geometry::Points& points, Real spacing, Real reach) : reach_(reach * spacing), spacing_(spacing) {
  ZONE("skin.material");
  CHECK(std::isfinite(spacing) && spacing > 0);
  CHECK_GE(reach, 1.0);
  const std::size_t n = points.size();
  const auto given = [&](std::size_t size) {
    if (size > 0) CHECK_EQ(size, n);
    return size > 0;
  };
  has_rest_[0] = given(points.rest.size());
  has_rest_[1] = given(points.rest2.size());
  has_velocity_ = given(points.velocity.size());
  has_temperature_ = given(points.temperature.size());
  has_crust_ = given(points.crust.size());
  std::vector<Particle> particles(n);
  for (std::size_t i = 0; i < n; ++i) {
    Particle& p = particles[i];
    p.x = points.position[i];
    p.rest[0] = has_rest_[0] ? points.rest[i] : p.x;
    p.rest[1] = has_rest_[1] ? points.rest2[i] : p.x;
    p.velocity = has_velocity_ ? points.velocity[i] : Vec3(Vec3::Zero());
    p.temperature = has_temperature_ ? points.temperature[i] : 0;
    p.crust = has_crust_ ? points.crust[i] : 0;
    p.place = static_cast<Index>(i);
  }
  grid_ = NearGrid<Particle>(std::move(particles), reach_);
  place_.resize(n);
  for (std::size_t s = 0; s < n; ++s) place_[grid_.sorted()[s].place] = static_cast<Index>(s);
}

Material::Sample Material::at(const Vec3& x) const {
  Sample out;
  for (int f = 0; f < 2; ++f) {
    out.rest[f] = x;
    out.slope[f] = Mat3::Identity();
  }
  // Moments about x: offsets are small, so nothing cancels far from the origin. Material coordinates about those of the first.
  Real weight = 0, temperature = 0, crust = 0;
  Vec3 d_sum = Vec3::Zero(), f_sum[3] = {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  Mat3 moment = Mat3::Zero(), cross[3] = {Mat3::Zero(), Mat3::Zero(), Mat3::Zero()};
  Vec3 origin[2];
  const bool fit[3] = {has_rest_[0], has_rest_[1], has_velocity_};
  grid_.each_near(x, reach_, [&](const Particle& p) {
    const Vec3 d = p.x - x;
    const Real t = 1 - d.squaredNorm() / (reach_ * reach_);
    if (t <= 0) return;
    const Real w = t * t * t;
    if (weight == 0)
      for (int f = 0; f < 2; ++f) origin[f] = p.rest[f];
    weight += w;
    temperature += w * p.temperature;
    crust += w * p.crust;
    const Vec3 wd = w * d;
    d_sum += wd;
    moment.noalias() += wd * d.transpose();
    for (int f = 0; f < 3; ++f) {
      if (!fit[f]) continue;
      const Vec3 value = f < 2 ? Vec3(p.rest[f] - origin[f]) : p.velocity;
      f_sum[f] += w * value;
      cross[f].noalias() += value * wd.transpose();
    }
  });
  if (!(weight > 0)) return out;

  out.any = true;
  out.weight = weight;
  out.temperature = temperature / weight;
  out.crust = crust / weight;
  const Vec3 d_mean = d_sum / weight;
  out.outward = -d_mean;
  const Mat3 spread = moment / weight - d_mean * d_mean.transpose() + std::pow(kPlanar * spacing_, 2) * Mat3::Identity();
  const Eigen::LLT<Mat3> solver(spread);
  for (int f = 0; f < 3; ++f) {
    if (!fit[f]) continue;
    const Vec3 mean = f_sum[f] / weight;
    const Mat3 together = cross[f] / weight - mean * d_mean.transpose();
    const Mat3 A = solver.solve(together.transpose()).transpose();
    if (f == 2) {
      out.strain_rate = 0.5 * (A + A.transpose());
      continue;
    }
    out.slope[f] = A;
    out.rest[f] = origin[f] + mean - A * d_mean;
  }
  return out;
}

}  // namespace effuse::skin
