#include "samples/budget/front_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/scene/accuracy.h"

namespace effuse::budget {
namespace {

TEST(FrontLaw, RisesWithTheSpacingAndWithTheStep) {
  const FrontLaw law{1.3};
  Real last = 0;
  for (Real dx = 0.05; dx < 8; dx *= 1.1) {
    EXPECT_GT(law.error(dx, 0.4), last) << dx;
    EXPECT_LT(law.error(dx, 0.2), law.error(dx, 0.4)) << dx;
    last = law.error(dx, 0.4);
  }
}

TEST(FrontLaw, GivesTheSpacingOfTheErrorAskedFor) {
  const FrontLaw law{0.7};
  for (const Real wanted : {0.02, 0.03, 0.06, 0.1, 0.4, 2.0}) EXPECT_NEAR(law.error(law.spacing_for(wanted, 0.2), 0.2), wanted, 1e-9) << wanted;
  EXPECT_NEAR(FrontLaw{1.4}.spacing_for(0.05, 0.4), 2 * law.spacing_for(0.05, 0.4), 1e-9) << "a flow twice as deep takes particles twice as large";
}

TEST(FrontLaw, FollowsWhatWasMeasured) {
  // front's error at spacings over the depth, to a factor of two: the first minute's lava of Maunga Whau (0.83 m deep), the gully (0.54 m),
  // each against its finest run, of 0.72 and 0.56 depths.
  const FrontLaw mountain{0.83}, gully{0.54};
  for (const auto& [dx, error] : {std::pair{0.85, 0.074}, {1.2, 0.059}, {1.7, 0.106}, {2.4, 0.666}}) {
    EXPECT_LT(mountain.error(dx, 0.4), 2 * error) << dx;
    EXPECT_GT(mountain.error(dx, 0.4), error / 2) << dx;
  }
  for (const auto& [dx, error] : {std::pair{0.6, 0.056}, {0.85, 0.0412}, {1.2, 0.079}}) {
    EXPECT_LT(gully.error(dx, 0.4), 2 * error) << dx;
    EXPECT_GT(gully.error(dx, 0.4), error / 2) << dx;
  }
  // A stiff heap 1.9 m deep, oil 0.96 m deep on a plane of 15 degrees.
  EXPECT_LT(FrontLaw{1.9}.error(1.1, 0.4), 2 * 0.041);
  EXPECT_GT(FrontLaw{1.9}.error(1.1, 0.4), 0.041 / 2);
  EXPECT_LT(FrontLaw{0.96}.error(0.8, 0.4), 2 * 0.032);
  EXPECT_GT(FrontLaw{0.96}.error(0.8, 0.4), 0.032 / 2);
}

TEST(FrontLaw, EveryQualityCanBeHad) {
  const FrontLaw law{1};
  Real last = 1e9;
  for (const Real wanted : flow::quality_fronts()) {
    const Real dx = law.spacing_for(wanted, courant_for(wanted));
    EXPECT_GT(dx, 0.3) << wanted;
    EXPECT_LT(dx, last / 1.2) << "finer than the quality before";
    last = dx;
  }
  EXPECT_GT(law.spacing_for(flow::least_front_error(), courant_for(flow::least_front_error())), 0.1) << "the least a scene may ask for";
}

/// What is told of runs whose error is slow h + alone h^4, at h = 1, and what it is beside the run of h = 1/2.
std::pair<Real, Real> told_and_true(Real slow, Real alone) {
  const auto error = [&](Real h) { return slow * h + alone * std::pow(h, 4); };
  const Real root = std::sqrt(2.0), finer = error(1) - error(1 / root);
  return {refined_error({error(root) - error(1), finer, std::abs(finer)}, kUsualCourant), std::abs(error(1) - error(0.5))};
}

TEST(RefinedError, TellsErrorsThatSlowTheFlowAndErrorsThatMakeItRunAhead) {
  for (const auto& [slow, alone] : {std::pair{-0.1, 0.0}, {-0.3, 0.0}, {0.0, 0.05}, {0.0, 0.5}, {-0.1, 0.1}, {-0.1, 0.2}, {-0.2, 0.02}, {0.1, 0.1}}) {
    const auto [told, real] = told_and_true(slow, alone);
    EXPECT_LT(told, 2 * real) << slow << " " << alone;
    EXPECT_GT(told, real / 2) << slow << " " << alone;
  }
  // Where the two cancel, the same to within two per cent.
  const auto [told, real] = told_and_true(-0.1, 0.05);
  EXPECT_NEAR(told, real, 0.02);
}

TEST(RefinedError, IsNeverLessThanTheStepsAndRisesWithIt) {
  EXPECT_NEAR(refined_error({}, kUsualCourant), 0.01, 1e-12);
  EXPECT_GT(refined_error({0.1, 0.02, 0.02}, 0.4), refined_error({0.1, 0.02, 0.02}, 0.2));
}

TEST(FlowDepth, IsSaidByLayersWhereParticlesLieOnOneAnother) {
  EXPECT_NEAR(flow_depth(0.3, 1.61, 0.005), 0.48, 0.01);
  EXPECT_NEAR(flow_depth(0.425, 1.275, 0.05), 0.54, 0.01) << "the gully's";
  EXPECT_NEAR(flow_depth(0.6, 1.094, 0.03), 0.55, 0.01) << "and with larger particles";
}

TEST(FlowDepth, IsSaidByTheDifferenceWhereTheyLieAlone) {
  EXPECT_NEAR(flow_depth(1.2, 1.0, 0.166), 0.83, 0.01) << "the first minute's lava of Maunga Whau";
  EXPECT_NEAR(flow_depth(1.7, 1.0, 0.51), 0.80, 0.02) << "and with larger particles";
  EXPECT_LE(flow_depth(1, 1.0, 0), 1 / 1.2 + 1e-12);
}

TEST(Settings, AreTighterForLess) {
  EXPECT_EQ(courant_for(0.1), kUsualCourant);
  EXPECT_LT(courant_for(0.015), courant_for(0.02));
  EXPECT_EQ(tolerance_for(0.1), 1e-3);
  EXPECT_LT(tolerance_for(0.01), 1e-3);
  EXPECT_GE(tolerance_for(0.001), 1e-4);
}

}  // namespace
}  // namespace effuse::budget
