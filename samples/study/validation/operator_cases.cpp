#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/sph/boundary.h"
#include "flow/sph/heat.h"
#include "flow/sph/pressure.h"
#include "flow/sph/viscosity.h"
#include "geometry/base/random.h"
#include "samples/study/study.h"
#include "samples/study/validation/setups.h"

/// The solver's sums alone, on fields whose answer is known, in the middle of a block of particles: before any flow.
namespace effuse::study {
namespace {

using namespace flow::sph;

constexpr int kSide = 15;         // particles a side of the block
constexpr int kInner = 5;         // of which so many, in the middle, are looked at: further than a support from the border
constexpr Real kJitter = 0.1;     // uniform in +-10 % of a spacing, along each axis
constexpr int kOrientations = 40;
constexpr std::uint64_t kSeed = 7;

/// A block of spacing 1 about the origin, its neighbours, and the particles that are looked at.
struct Sample {
  std::vector<Vec3> x;
  std::vector<Index> inner;
  Neighbors neighbors;
  Walls walls;
  BoundaryTable table;
  Real support;

  Sample(Real support_in, bool jittered) : x(block(Vec3::Constant(-kSide / 2.0), {kSide, kSide, kSide}, 1)), table(WendlandC2(support_in), 1), support(support_in) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (x[i].cwiseAbs().maxCoeff() < kInner / 2.0) inner.push_back(static_cast<Index>(i));
      if (!jittered) continue;
      for (int axis = 0; axis < 3; ++axis) x[i][axis] += kJitter * (2 * random_uniform(kSeed, static_cast<std::uint64_t>(axis), i) - 1);
    }
    ColumnGrid grid;
    grid.build(x, support);
    neighbors.find(grid, support);
    walls.first.assign(x.size() + 1, 0);
  }

  ParticleSystem system() const {
    ParticleSystem s;
    s.x = x;
    s.neighbors = &neighbors;
    s.walls = &walls;
    s.boundary = &table;
    s.support = support;
    s.spacing = 1;
    return s;
  }
};

/// Ratios of measured to exact values.
struct Ratios {
  std::vector<Real> of_orientation;  ///< mean over the particles looked at
  Real mean = 0, rms = 0;            ///< over particles and orientations; rms of (ratio - 1)
};
Ratios summarise(const std::vector<std::vector<Real>>& ratios) {
  Ratios r;
  Real n = 0, squares = 0;
  for (const std::vector<Real>& row : ratios) {
    Real sum = 0;
    for (Real q : row) {
      sum += q;
      squares += (q - 1) * (q - 1);
    }
    r.of_orientation.push_back(sum / static_cast<Real>(row.size()));
    r.mean += sum;
    n += static_cast<Real>(row.size());
  }
  r.mean /= n;
  r.rms = std::sqrt(squares / n);
  return r;
}

/// A direction uniform on the sphere, and one at right angles to it.
struct Shear {
  Vec3 a, b;
};
Shear random_shear(std::uint64_t k) {
  const auto direction = [&](std::uint64_t stream) {
    return Vec3(random_normal(kSeed, stream, k), random_normal(kSeed, stream + 1, k), random_normal(kSeed, stream + 2, k)).normalized();
  };
  const Vec3 b = direction(10), c = direction(20);
  return {(c - c.dot(b) * b).normalized(), b};
}

/// Shear v = a (b.x)^2: the viscous acceleration is 2 nu a.
Ratios shear(const Sample& sample) {
  const std::vector<Real> mu(sample.x.size(), 1);
  std::vector<Vec3> v(sample.x.size()), out(sample.x.size());
  std::vector<std::vector<Real>> ratios;
  for (std::uint64_t k = 0; k < kOrientations; ++k) {
    const Shear s = random_shear(k);
    for (std::size_t i = 0; i < v.size(); ++i) v[i] = std::pow(s.b.dot(sample.x[i]), 2) * s.a;
    viscous_acceleration(sample.system(), 1, mu, 0, v, out);
    ratios.emplace_back();
    for (Index i : sample.inner) ratios.back().push_back(out[i].dot(s.a) / 2);
  }
  return summarise(ratios);
}

/// Temperature T0 + (b.x)^2, in the direction of axis b: conduction warms at the rate 2 kappa.
Ratios conduction(const Sample& sample) {
  HeatOptions options;
  options.curve = {1000, 0, 1, 1};
  options.conductivity = 1e-3;
  options.crust = false;
  const Real density = 1, kappa = options.conductivity / (density * options.curve.heat_capacity);
  // So short that the temperatures the rates are made from have hardly changed.
  const Real dt = 1e-4 / kappa;
  options.longest_interval = dt;
  std::vector<std::vector<Real>> ratios;
  for (std::uint64_t k = 0; k < kOrientations; ++k) {
    const Vec3 b = random_shear(k).b;
    Heat heat(options, 1, density);
    for (const Vec3& x : sample.x) heat.born(500 + std::pow(b.dot(x), 2));
    const std::vector<Real> before(heat.enthalpy().begin(), heat.enthalpy().end());
    heat.step(dt, {.x = sample.x, .neighbors = sample.neighbors, .kernel = KernelKind::kWendlandC2, .support = sample.support, .period = Vec2::Zero(),
                   .sky_area = {}, .ground_area = {}, .ground_temperature = {}, .dissipation = {}});
    ratios.emplace_back();
    for (Index i : sample.inner) ratios.back().push_back((heat.enthalpy()[i] - before[i]) / (options.curve.heat_capacity * dt * 2 * kappa));
  }
  return summarise(ratios);
}

/// Compression of v = -x: 3.
Ratios compression(const Sample& sample) {
  std::vector<Vec3> v(sample.x.size());
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = -sample.x[i];
  std::vector<Real> out(v.size());
  compression_rate(sample.system(), v, out);
  std::vector<std::vector<Real>> ratios(1);
  for (Index i : sample.inner) ratios[0].push_back(out[i] / 3);
  return summarise(ratios);
}

CaseResult operators() {
  CaseResult result;
  const Sample lattice(3, false), jittered(3, true);
  Plot plot{"operators", "Operators in 40 orientations, support three spacings", "orientation", "measured over exact", false, false, {}};
  std::vector<Real> number;
  for (int k = 0; k < kOrientations; ++k) number.push_back(k + 1);
  plot.curves.push_back({"exact", {1, kOrientations}, {1, 1}, false, true});
  const auto add = [&](const std::string& what, const Ratios& even, const Ratios& uneven) {
    result.measures.push_back({what + ": bias on a lattice", "", even.mean, 1, std::abs(even.mean - 1), 0.02, ""});
    result.measures.push_back(bounded(what + ": rms at 10 % jitter", uneven.rms, 0.1));
    if (even.of_orientation.size() < 2) return;
    plot.curves.push_back({what + ", lattice", number, even.of_orientation, true, false});
    plot.curves.push_back({what + ", jitter", number, uneven.of_orientation, true, false});
  };
  const Ratios even = shear(lattice);
  add("shear", even, shear(jittered));
  const auto [least, most] = std::minmax_element(even.of_orientation.begin(), even.of_orientation.end());
  add("conduction, Laplacian of x^2", conduction(lattice), conduction(jittered));
  add("compression of -x", compression(lattice), compression(jittered));
  result.note = fmt::format("Wendland C2, support three spacings; single orientations of shear on the lattice lie between {:.3f} and {:.3f} of exact. ", *least, *most);
  for (Real support : {2.0, 2.6, 4.0}) {
    const Ratios a = shear(Sample(support, false)), b = shear(Sample(support, true));
    result.note += fmt::format("Support {}: shear off by {:+.1f} % (rms {:.0f} %) on the lattice, rms {:.0f} % jittered. ", support, 100 * (a.mean - 1), 100 * a.rms, 100 * b.rms);
  }
  result.plots = {plot};
  return result;
}

}  // namespace

void add_operator_cases(std::vector<Case>& cases) {
  cases.push_back({"operators", "Operators alone: shear, conduction, compression", "Taylor expansion", true, operators});
}

}  // namespace effuse::study
