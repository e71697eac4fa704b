#include "flow/sph/pair_kernels.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <ostream>
#include <string>

#include "flow/sph/pair_kernels_float.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

namespace effuse::flow::sph {
namespace {

constexpr Real kSpacing = 0.3, kSupport = 2.7 * kSpacing;
constexpr Real kRounding = 2e-15;  // of the sum of the terms' sizes: a few roundings a term, a hundred terms

struct Setup {
  const char* name;
  KernelKind kernel;
  Vec2 period;
  Vec3 origin;
};
void PrintTo(const Setup& setup, std::ostream* out) { *out << setup.name; }

const Setup kSetups[] = {
    {"wendland", KernelKind::kWendlandC2, Vec2(0, 0), Vec3(0, 0, 0)},
    {"cubic spline", KernelKind::kCubicSpline, Vec2(0, 0), Vec3(0, 0, 0)},
    {"spiky", KernelKind::kSpiky, Vec2(0, 0), Vec3(0, 0, 0)},
    {"far from the origin", KernelKind::kWendlandC2, Vec2(0, 0), Vec3(2667400, 6478700, -500)},
    {"periodic in x", KernelKind::kWendlandC2, Vec2(8 * kSpacing, 0), Vec3(0, 0, 0)},
    {"periodic in y", KernelKind::kCubicSpline, Vec2(0, 8 * kSpacing), Vec3(0, 0, 0)},
    {"periodic in both, far from the origin", KernelKind::kWendlandC2, Vec2(8 * kSpacing, 8 * kSpacing), Vec3(1e5, -1e5, 0)},
};

/// A jittered lattice of 8 x 8 x 7, two particles of it at one place; fields of random numbers on it, the viscosity's over nine orders.
struct Sample {
  std::vector<Vec3> x, v;
  std::vector<Real> q, mu, weight;
  ColumnGrid grid;
  Neighbors neighbors;
  ParticleSystem system;

  explicit Sample(const Setup& setup) {
    for (int k = 0; k < 7; ++k)
      for (int j = 0; j < 8; ++j)
        for (int i = 0; i < 8; ++i) {
          const std::uint64_t id = x.size();
          const Vec3 jitter(random_uniform(3, 0, id), random_uniform(3, 1, id), random_uniform(3, 2, id));
          x.push_back(setup.origin + kSpacing * (Vec3(i, j, k) + 0.5 * jitter));
          v.push_back(Vec3(random_normal(3, 3, id), random_normal(3, 4, id), random_normal(3, 5, id)));
          q.push_back(random_normal(3, 6, id));
          weight.push_back(id % 5 == 0 ? 0 : 1);
          mu.push_back(std::exp(std::log(1e9) * random_uniform(3, 7, id)));
        }
    x[100] = x[101];
    system.x = x;
    system.neighbors = &neighbors;
    system.kernel = setup.kernel;
    system.support = kSupport;
    system.spacing = kSpacing;
    system.period = setup.period;

    // Periodic: the eight images around, each neighbour renamed to the particle that it is an image of.
    std::vector<Vec3> all = x;
    for (int a = -1; a <= 1; ++a)
      for (int b = -1; b <= 1; ++b) {
        if ((a == 0 && b == 0) || (a != 0 && setup.period.x() == 0) || (b != 0 && setup.period.y() == 0)) continue;
        for (const Vec3& p : x) all.push_back(p + Vec3(a * setup.period.x(), b * setup.period.y(), 0));
      }
    grid.build(all, kSupport);
    neighbors.find(grid, kSupport);
    for (std::size_t i = 0; i < x.size(); ++i)
      for (const Index& j : neighbors[i]) const_cast<Index&>(j) %= static_cast<Index>(x.size());
  }
  std::size_t size() const { return x.size(); }
};

struct Results {
  std::vector<Real> sum, compression, power, squares;
  std::vector<Vec3> slope, viscous, gradient, own;
  std::vector<Mat3> block, velocity_gradient, moment;
  explicit Results(std::size_t n) : sum(n), compression(n), power(n), squares(n), slope(n), viscous(n), gradient(n), own(n), block(n), velocity_gradient(n), moment(n) {}
  bool operator==(const Results&) const = default;
};

Results run(const Sample& s, Simd simd, std::size_t grain = 64) {
  PairKernels pairs;
  pairs.build(s.system, simd);
  pairs.set_viscosity(s.mu);
  Results r(s.size());
  parallel_ranges(s.size(), grain, [&](std::size_t begin, std::size_t end) {
    pairs.density(begin, end, r.sum, r.slope);
    pairs.viscous(begin, end, s.v, r.viscous);
    const auto part = [&](std::vector<Mat3>& all) { return std::span(all).subspan(begin, end - begin); };
    pairs.viscous_block(begin, end, part(r.block));
    pairs.divergence(begin, end, s.v, r.compression);
    pairs.gradient(begin, end, s.q, r.gradient);
    pairs.friction_power(begin, end, s.v, r.power);
    pairs.velocity_gradient(begin, end, s.v, part(r.velocity_gradient), part(r.moment));
    pairs.compliance(begin, end, s.weight, r.own, r.squares);
  });
  return r;
}

std::vector<Simd> simds() {
  std::vector<Simd> all;
  for (const Simd simd : {Simd::kScalar, Simd::kAvx2, Simd::kAvx512})
    if (simd <= best_simd()) all.push_back(simd);
  return all;
}

class PairKernelsTest : public testing::TestWithParam<Setup> {};

TEST_P(PairKernelsTest, AgreesWithTheFormulasPairByPair) {
  const Sample s(GetParam());
  const Results got = run(s, best_simd());
  const Real V = s.system.volume();
  const ViscousWeight w(kSupport);
  // Coordinates' own rounding, seen from a pair: nothing at the origin.
  const Real blur = 4e-16 * GetParam().origin.cwiseAbs().maxCoeff() / kSpacing;
  with_kernel(s.system, [&](const auto& kernel, auto periodic) {
    for (std::size_t i = 0; i < s.size(); ++i) {
      Real sum = 0, compression = 0, power = 0, squares = 0, power_size = 0, velocity_size = 0, sum_size = 0, compression_size = 0, slope_size = 0, viscous_size = 0, gradient_size = 0;
      Vec3 slope = Vec3::Zero(), viscous = slope, gradient = slope;
      Mat3 block = Mat3::Zero(), velocity_gradient = block, moment = block;
      for (const Index j : s.neighbors[i]) {
        const Vec3 d = s.system.template separation<decltype(periodic)::value>(i, j);
        const Real r = d.norm(), F = r > 0 ? kernel.dW(r) / r : 0, c = V * w(r * r) * 2 * s.mu[i] * s.mu[j] / (s.mu[i] + s.mu[j]);
        const Vec3 dv = s.v[i] - s.v[j];
        sum += V * kernel.W(r);
        slope += V * F * d;
        viscous += c * dv.dot(d) * d;
        block += c * d * d.transpose();
        compression += V * F * dv.dot(d);
        gradient += V * (s.q[i] + s.q[j]) * F * d;
        power += c * std::pow(dv.dot(d), 2);
        velocity_gradient -= V * F * dv * d.transpose();
        moment -= V * F * d * d.transpose();
        squares += s.weight[j] * std::pow(V * F * r, 2);
        power_size += c * dv.squaredNorm() * r * r;
        velocity_size += V * std::abs(F) * dv.norm() * r;
        sum_size += V * kernel.W(r);
        slope_size += V * std::abs(F) * r;
        viscous_size += c * dv.norm() * r * r;
        compression_size += V * std::abs(F) * dv.norm() * r;
        gradient_size += V * std::abs(F) * r * (std::abs(s.q[i]) + std::abs(s.q[j]));
      }
      const Real bound = kRounding + 20 * blur;
      ASSERT_NEAR(got.sum[i], sum, bound * (sum_size + V * kernel.W(0) * 8)) << i;  // the last group's filling comes and goes
      ASSERT_LE((got.slope[i] - slope).norm(), bound * slope_size) << i;
      ASSERT_LE((got.viscous[i] - viscous).norm(), bound * viscous_size) << i;
      ASSERT_LE((got.block[i] - block).norm(), bound * block.trace()) << i;
      ASSERT_NEAR(got.compression[i], compression, bound * compression_size) << i;
      ASSERT_LE((got.gradient[i] - gradient).norm(), bound * gradient_size) << i;
      ASSERT_NEAR(got.power[i], power, bound * power_size) << i;
      ASSERT_LE((got.velocity_gradient[i] - velocity_gradient).norm(), bound * velocity_size) << i;
      ASSERT_LE((got.moment[i] - moment).norm(), bound * moment.trace()) << i;
      ASSERT_LE((got.own[i] - slope).norm(), bound * slope_size) << i;
      ASSERT_NEAR(got.squares[i], squares, 2 * bound * squares) << i;
      ASSERT_EQ(got.block[i], got.block[i].transpose());
    }
  });
}

TEST_P(PairKernelsTest, GivesTheSameBitsOnEveryInstructionSetRangeAndNumberOfThreads) {
  const Sample s(GetParam());
  const Results one = [&] {
    const ThreadLimit limit(1);
    return run(s, Simd::kScalar, s.size());
  }();
  for (const Simd simd : simds()) {
    for (const std::size_t grain : {1, 7, 100}) {
      EXPECT_TRUE(run(s, simd, grain) == one) << "simd " << static_cast<int>(simd) << ", ranges of " << grain;
    }
  }
}

TEST_P(PairKernelsTest, KeepsMomentumIsSymmetricAndFeelsNoRigidRotation) {
  Sample s(GetParam());
  PairKernels pairs;
  pairs.build(s.system);
  pairs.set_viscosity(s.mu);
  const std::size_t n = s.size();
  const auto viscous = [&](const std::vector<Vec3>& v) {
    std::vector<Vec3> out(n);
    pairs.viscous(0, n, v, out);
    return out;
  };
  const auto dot = [&](const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
    Real sum = 0;
    for (std::size_t i = 0; i < n; ++i) sum += a[i].dot(b[i]);
    return sum;
  };
  std::vector<Vec3> u(n), gradient(n);
  std::vector<Real> compression(n);
  for (std::size_t i = 0; i < n; ++i) u[i] = Vec3(random_normal(4, 0, i), random_normal(4, 1, i), random_normal(4, 2, i));
  const std::vector<Vec3> Av = viscous(s.v), Au = viscous(u);

  Vec3 momentum = Vec3::Zero();
  Real size = 0;
  for (const Vec3& a : Av) momentum += a, size += a.norm();
  EXPECT_LT(momentum.norm(), 1e-15 * size);
  EXPECT_NEAR(dot(u, Av), dot(s.v, Au), 1e-14 * std::abs(dot(s.v, Av)) + 1e-14 * std::abs(dot(u, Au)));
  EXPECT_GT(dot(s.v, Av), 0) << "friction takes energy";

  // q . D v = v . G q
  pairs.divergence(0, n, s.v, compression);
  pairs.gradient(0, n, s.q, gradient);
  Real work = 0, work_size = 0;
  for (std::size_t i = 0; i < n; ++i) work += s.q[i] * compression[i], work_size += std::abs(s.q[i] * compression[i]);
  EXPECT_NEAR(work, dot(s.v, gradient), 1e-14 * work_size);

  if (GetParam().period.isZero()) {
    std::vector<Vec3> turning(n);
    const Vec3 omega(0.3, -0.7, 1.1);
    for (std::size_t i = 0; i < n; ++i) turning[i] = omega.cross(s.x[i] - GetParam().origin);
    Real turned = 0, sheared = 0;
    for (const Vec3& a : viscous(turning)) turned = std::max(turned, a.norm());
    for (std::size_t i = 0; i < n; ++i) turning[i] = Vec3(omega.norm() * (s.x[i] - GetParam().origin).z(), 0, 0);
    for (const Vec3& a : viscous(turning)) sheared = std::max(sheared, a.norm());
    EXPECT_LT(turned, 2e-14 * sheared + 4e-16 * GetParam().origin.cwiseAbs().maxCoeff() / kSpacing * sheared);
  }
}
/// What FloatPairs makes of a sample.
struct FloatResults {
  std::vector<FloatPairs::Vector> gradient, own;
  std::vector<float> compression, squares;
  std::vector<std::uint32_t> bits() const {
    std::vector<std::uint32_t> all;
    for (const auto* vectors : {&gradient, &own})
      for (const auto& a : *vectors)
        for (const float value : {a.x, a.y, a.z}) all.push_back(std::bit_cast<std::uint32_t>(value));
    for (const auto* values : {&compression, &squares})
      for (const float value : *values) all.push_back(std::bit_cast<std::uint32_t>(value));
    return all;
  }
};
FloatResults run_float(const Sample& s, Simd simd, std::size_t grain = 64) {
  const std::size_t n = s.size();
  FloatPairs pairs;
  pairs.build(s.system, simd);
  std::vector<FloatPairs::Vector> v(n);
  for (std::size_t i = 0; i < n; ++i) v[i] = {static_cast<float>(s.v[i].x()), static_cast<float>(s.v[i].y()), static_cast<float>(s.v[i].z()), 0};
  FloatResults r{std::vector<FloatPairs::Vector>(n), std::vector<FloatPairs::Vector>(n), std::vector<float>(n), std::vector<float>(n)};
  for (std::size_t i = 0; i < n; ++i) pairs.set(i, static_cast<float>(s.q[i]));
  parallel_ranges(n, grain, [&](std::size_t begin, std::size_t end) {
    pairs.gradient(begin, end, r.gradient);
    pairs.divergence(begin, end, v, r.compression);
  });
  for (std::size_t i = 0; i < n; ++i) pairs.set(i, static_cast<float>(s.weight[i]));
  parallel_ranges(n, grain, [&](std::size_t begin, std::size_t end) { pairs.compliance(begin, end, r.own, r.squares); });
  return r;
}

TEST_P(PairKernelsTest, InSinglePrecisionAgreesWithDoubleToSixDigits) {
  const Sample s(GetParam());
  const Results exact = run(s, best_simd());
  const FloatResults got = run_float(s, best_simd());
  const Real V = s.system.volume();
  with_kernel(s.system, [&](const auto& kernel, auto periodic) {
    for (std::size_t i = 0; i < s.size(); ++i) {
      Real compression_size = 0, slope_size = 0, gradient_size = 0;
      for (const Index j : s.neighbors[i]) {
        const Real r = s.system.template separation<decltype(periodic)::value>(i, j).norm(), F = r > 0 ? std::abs(kernel.dW(r) / r) : 0;
        // A position off by 2^-22 supports counts by its share of a distance, and of the way to the support.
        const Real size = V * F * (r + kSupport);
        compression_size += size * (s.v[i] - s.v[j]).norm();
        slope_size += size;
        gradient_size += size * (std::abs(s.q[i]) + std::abs(s.q[j]));
      }
      constexpr Real kSix = 1e-6;
      const auto vec = [](const FloatPairs::Vector& a) { return Vec3(a.x, a.y, a.z); };
      ASSERT_LE((vec(got.gradient[i]) - exact.gradient[i]).norm(), kSix * gradient_size) << i;
      ASSERT_LE((vec(got.own[i]) - exact.own[i]).norm(), kSix * slope_size) << i;
      ASSERT_NEAR(got.compression[i], exact.compression[i], kSix * compression_size) << i;
      ASSERT_NEAR(got.squares[i], exact.squares[i], 1e-5 * exact.squares[i]) << i;
    }
  });
}

TEST_P(PairKernelsTest, InSinglePrecisionGivesTheSameBitsOnEveryInstructionSetRangeAndNumberOfThreads) {
  const Sample s(GetParam());
  const auto one = [&] {
    const ThreadLimit limit(1);
    return run_float(s, Simd::kScalar, s.size()).bits();
  }();
  for (const Simd simd : simds())
    for (const std::size_t grain : {1, 7, 100}) EXPECT_EQ(run_float(s, simd, grain).bits(), one) << "simd " << static_cast<int>(simd) << ", ranges of " << grain;
}

TEST_P(PairKernelsTest, InSinglePrecisionTwoParticlesPushOneAnotherEquallyHard) {
  // To the last bit: the system's operators stay transposes of one another.
  const Sample s(GetParam());
  for (const std::size_t a : {0, 60, 200}) {
    for (const Index b : s.neighbors[a]) {
      Sample two(GetParam());
      two.x = {s.x[a], s.x[b]};
      two.system.x = two.x;
      // Each is the other's only neighbour, whatever image is the nearest.
      std::vector<Vec3> near = two.x;
      two.grid.build(near, 10 * kSupport + (near[0] - near[1]).norm());
      two.neighbors.find(two.grid, two.grid.cell());
      FloatPairs pairs;
      pairs.build(two.system);
      pairs.set(0, 3.7f);
      pairs.set(1, 1.3f);
      std::vector<FloatPairs::Vector> out(2);
      pairs.gradient(0, 2, out);
      EXPECT_EQ(out[0].x, -out[1].x);
      EXPECT_EQ(out[0].y, -out[1].y);
      EXPECT_EQ(out[0].z, -out[1].z);
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Setups, PairKernelsTest, testing::ValuesIn(kSetups));

TEST(PairKernels, TakesNoParticlesAndOneAlone) {
  for (const std::size_t n : {0, 1}) {
    const std::vector<Vec3> x(n, Vec3(1, 2, 3)), v(n, Vec3(4, 5, 6));
    std::vector<Vec3> out(n, Vec3(7, 7, 7));
    ColumnGrid grid;
    Neighbors neighbors;
    grid.build(x, 1);
    neighbors.find(grid, 1);
    ParticleSystem system;
    system.x = x;
    system.neighbors = &neighbors;
    system.support = 1;
    system.spacing = 0.5;
    PairKernels pairs;
    pairs.build(system);
    pairs.set_viscosity(std::vector<Real>(n, 1e-3));
    pairs.viscous(0, n, v, out);
    for (const Vec3& a : out) EXPECT_EQ(a, Vec3(0, 0, 0));
  }
}

TEST(PairKernelsDeathTest, StopsAtAPeriodThatIsTooShortAndAtViscosityThatIsNone) {
  const Sample s(kSetups[0]);
  ParticleSystem narrow = s.system;
  narrow.period = Vec2(1.9 * kSupport, 0);
  PairKernels pairs;
  EXPECT_DEATH(pairs.build(narrow), "CHECK failed");
  pairs.build(s.system);
  std::vector<Real> mu = s.mu;
  mu[5] = 0;
  EXPECT_DEATH(pairs.set_viscosity(mu), "CHECK failed");
  std::vector<Vec3> out(s.size());
  EXPECT_DEATH(pairs.viscous(0, s.size(), s.v, out), "CHECK failed") << "before set_viscosity";
}

}  // namespace
}  // namespace effuse::flow::sph
