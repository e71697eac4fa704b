#include "flow/reference/rigid_motion.h"

#include <gtest/gtest.h>

#include <cmath>

namespace effuse::flow::reference {
namespace {

TEST(JacobiElliptic, InvertsTheEllipticIntegralOfTheFirstKind) {
  for (const Real m : {0.0, 0.1, 0.5, 0.9, 0.999999})
    for (Real phi = -6; phi <= 6; phi += 0.37) {
      const JacobiElliptic j = jacobi_elliptic(std::ellint_1(std::sqrt(m), phi), m);
      // The library's integral is good to 1e-10 or so where it is steep.
      const Real good = m > 0.99 ? 1e-9 : 1e-11;
      EXPECT_NEAR(j.sn, std::sin(phi), good) << m << ' ' << phi;
      EXPECT_NEAR(j.cn, std::cos(phi), good) << m << ' ' << phi;
      EXPECT_NEAR(j.sn * j.sn + j.cn * j.cn, 1, 1e-14);
      EXPECT_NEAR(j.dn * j.dn + m * j.sn * j.sn, 1, 1e-14);
    }
}

TEST(Pendulum, KnowsThePeriodOfTextbooks) {
  EXPECT_NEAR((Pendulum{1, 1e-5}.period()) / (2 * kPi), 1, 1e-11);
  // 1.07318200714936 at 60 deg, 1.18034059901609 at 90 deg.
  EXPECT_NEAR((Pendulum{1, kPi / 3}.period()) / (2 * kPi), 1.0731820071493643, 1e-13);
  EXPECT_NEAR((Pendulum{2, kPi / 2}.period()) / kPi, 1.1803405990160964, 1e-13);
}

TEST(Pendulum, SolvesItsEquation) {
  const Pendulum p{1.7, 2.5};
  EXPECT_NEAR(p.angle(0), 2.5, 1e-12);
  EXPECT_NEAR(p.angle(p.period() / 2), -2.5, 1e-7);
  EXPECT_NEAR(p.angle(p.period() / 4), 0, 1e-10);
  const Real h = 1e-3;
  for (Real t = 0.1; t < 6; t += 0.5) {
    const Real second = (p.angle(t + h) - 2 * p.angle(t) + p.angle(t - h)) / (h * h);
    EXPECT_NEAR(second, -p.omega0 * p.omega0 * std::sin(p.angle(t)), 1e-5);  // of the difference: h^2 / 12 times the fourth derivative
  }
}

TEST(FreeTop, SolvesEulersEquationsFromAnyStart) {
  for (const Vec3& w0 : {Vec3(0.01, 5, 0.01), Vec3(1, 2, 3), Vec3(-3, 1, 0.5), Vec3(0.2, -1, -2), Vec3(-2, -0.3, 0.1), Vec3(2, 1, -0.1)}) {
    const FreeTop top{Vec3(1, 2, 3.5), w0};
    EXPECT_LT((top.spin(0) - w0).norm(), 1e-10 * w0.norm()) << w0.transpose();
    EXPECT_LT((top.spin(top.period()) - w0).norm(), 1e-8 * w0.norm()) << w0.transpose();
    const Real h = 1e-4;
    for (Real t = 0; t < 10; t += 0.31) {
      const Vec3 w = top.spin(t), rate = (top.spin(t + h) - top.spin(t - h)) / (2 * h);
      const Vec3 euler = (top.moments.cwiseProduct(w)).cross(w).cwiseQuotient(top.moments);
      EXPECT_LT((rate - euler).norm(), 1e-5 * w0.squaredNorm()) << w0.transpose() << " at " << t;
      EXPECT_NEAR(top.moments.dot(w.cwiseAbs2()) / 2, top.energy(), 1e-11 * top.energy());
      EXPECT_NEAR(top.moments.cwiseProduct(w).norm(), top.momentum(), 1e-11 * top.momentum());
    }
  }
}

}  // namespace
}  // namespace effuse::flow::reference
