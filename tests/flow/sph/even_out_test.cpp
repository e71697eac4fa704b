#include "flow/sph/even_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "flow/sph/pressure.h"
#include "tests/flow/sph/sample_system.h"

namespace effuse::flow::sph {
namespace {

constexpr Real kStep = 0.02;

/// A block on a floor that belongs to a body at rest.
struct Block {
  SampleSystem sample;
  std::vector<Movable> bodies;
  std::vector<Real> off;
  std::vector<Vec3> v, shift;

  explicit Block(Real jitter) : sample(lattice_block(8, 8, 8, 1, jitter, 3), 1), bodies(1), off(sample.size(), 3.0), v(sample.size(), Vec3::Zero()), shift(v) {
    sample.solids = {plane_solid(Vec3::Zero(), Vec3::UnitZ())};
    find();
    // Sides and top are a free surface.
    for (std::size_t i = 0; i < sample.size(); ++i)
      if (!((sample.x[i] - Vec3(4, 4, 2.5)).cwiseAbs().maxCoeff() < 2.5 && sample.x[i].z() < 5)) off[i] = 0;
  }
  void find() {
    sample.find();
    for (Wall& wall : sample.walls.walls) wall.mirrors = true, wall.movable = 0;
  }
  void shear(Real rate) {
    for (std::size_t i = 0; i < sample.size(); ++i) v[i] = Vec3(rate * sample.x[i].z(), 0, 0);
  }
  ParticleSystem system() {
    ParticleSystem s = sample.system();
    s.movable = bodies;
    return s;
  }
  void even(bool with_bodies = true) {
    std::fill(shift.begin(), shift.end(), Vec3::Zero());
    ParticleSystem s = sample.system();
    if (with_bodies) s.movable = bodies;
    even_out(s, off, v, kStep, shift);
  }
  Real farthest() const {
    Real most = 0;
    for (const Vec3& way : shift) most = std::max(most, way.norm());
    return most;
  }
};

std::size_t nearest_to(const SampleSystem& s, const Vec3& at) {
  std::size_t best = 0;
  for (std::size_t i = 0; i < s.size(); ++i)
    if ((s.x[i] - at).norm() < (s.x[best] - at).norm()) best = i;
  return best;
}

// 40 strains of a step, three tenths at most, of the way back; on a cubic lattice c is 0.76 of k u.
TEST(EvenOut, AParticleOutOfItsPlaceGoesBackInPaceWithTheShear) {
  const Vec3 off_by(0.05, 0.03, -0.04);
  for (const Real share : {0.08, 0.16, 0.3}) {
    Block b(0);
    const std::size_t out = nearest_to(b.sample, Vec3(3.5, 3.5, 1.5));
    b.sample.x[out] += off_by;
    b.find();
    b.shear((share == 0.3 ? 100 : share) / (40 * kStep));
    b.even();
    EXPECT_LT((b.shift[out] + 0.76 * share * off_by).norm(), 0.05 * share * off_by.norm()) << b.shift[out].transpose() / share;
    for (std::size_t i = 0; i < b.sample.size(); ++i) {
      if (b.off[i] == 0) {
        EXPECT_TRUE(b.shift[i].isZero(0));
      }
    }
  }
}

TEST(EvenOut, LavaAtRestOrThatGoesWithItsBodyOrHasNoneStaysAsItIs) {
  Block b(0.2);
  b.even();
  EXPECT_EQ(b.farthest(), 0);
  for (Vec3& v : b.v) v = Vec3(1, -2, 3);
  b.bodies[0].velocity = Vec3(1, -2, 3);
  b.even();
  EXPECT_EQ(b.farthest(), 0);
  b.shear(1);
  b.even(false);
  EXPECT_EQ(b.farthest(), 0);
  b.even();
  EXPECT_GT(b.farthest(), 0.01);
  EXPECT_LE(b.farthest(), 0.1 + 1e-12);
}

// What pairs give each other by it adds up to nothing, with walls and disorder; and uniform pressure leaves less stress in one that is drawn out.
TEST(EvenPressure, KeepsMomentumAndMakesTheStressOfUniformPressureEven) {
  Block b(0.2);
  const ParticleSystem s = b.system();
  std::vector<Real> q(s.size());
  std::vector<Vec3> a(s.size()), even(s.size());
  const Vec3 slope(0.3, -0.2, 1);
  for (std::size_t i = 0; i < s.size(); ++i) q[i] = slope.dot(s.x[i] - s.x[0]);
  pressure_acceleration(s, q, a);
  even = a;
  even_pressure(s, b.off, q, even);
  Vec3 added = Vec3::Zero();
  Real size = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    // Walls take some where P is not 1: of what pairs give each other nothing is lost.
    const Vec3 change = mirrored(s, i).inverse() * (even[i] - a[i]);
    added += change;
    size += change.norm();
  }
  EXPECT_GT(size, 0.1);
  EXPECT_LT(added.norm(), 1e-12 * size);

  // The stress of uniform pressure on a particle: virial of what its pairs push, and its walls' part.
  const std::vector<Mat3> factors = even_pressure_factors(s, b.off);
  const WendlandC2 W(s.support);
  const auto uneven = [](const Mat3& m) { return Mat3(m - m.trace() / 3 * Mat3::Identity()).squaredNorm(); };
  Real before = 0, after = 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (factors[i].isZero(0)) continue;
    Mat3 plain = Mat3::Zero();
    for (const Wall& w : (*s.walls)[i]) {
      const BoundaryTable::Row row = s.boundary->at(w);
      plain += Vec3(row.moment_t, row.moment_t, row.moment_n).asDiagonal();
    }
    Mat3 corrected = plain;
    for (const Index j : (*s.neighbors)[i]) {
      const Vec3 d = s.x[i] - s.x[j], push = s.volume() * W.dW(d.norm()) / d.norm() * d;
      plain -= push * d.transpose();
      corrected -= (push + (factors[i] + factors[j]) / 2 * push) * d.transpose();
    }
    before += uneven(plain);
    after += uneven(corrected);
  }
  EXPECT_GT(before, 0);
  EXPECT_LT(std::sqrt(after / before), 0.7) << "rms of its uneven part: half is the particle's own, half its neighbours'";
}

}  // namespace
}  // namespace effuse::flow::sph
