#include "flow/sph/rheology.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "flow/sph/lava_presets.h"

namespace effuse::flow::sph {
namespace {

Real kelvin(Real celsius) { return celsius + kZeroCelsius; }
Real melt_at(const MeltLaw& law, Real celsius) { return std::exp(law.log_viscosity(kelvin(celsius))); }

/// A printed value of so many digits says no more than half of its last one.
void expect_printed(Real value, Real printed, Real half_digit) {
  EXPECT_NEAR(value, printed, half_digit * 1.0001) << "printed " << printed;
}

// ---- Melt.

TEST(MeltViscosity, Grd08MeetsThePublishedFiguresOfFissure8Glass) {
  // Found in a public repository that states them for this glass; the bar is the issue's.
  const MeltLaw law = grd08_melt(fissure8_glass());
  for (const auto& [celsius, mu] : {std::pair{1100.0, 1477.0}, {1150.0, 501.0}, {1200.0, 193.0}, {1250.0, 82.0}})
    EXPECT_NEAR(melt_at(law, celsius) / mu, 1, 0.005) << celsius << " degC";
}

struct Composition {
  const char* name;
  Oxides wt;
  Real B, C, glass_transition;
};

/// What the authors' own calculator (grd08.js, T. M. Gordon & J. K. Russell 2008) gives, as recorded to full precision by a
/// public repository. Together they exercise every coefficient, water and fluorine.
class Grd08Calculator : public testing::TestWithParam<Composition> {};

TEST_P(Grd08Calculator, IsMetToRounding) {
  const Composition& c = GetParam();
  const Vft law = grd08(c.wt);
  EXPECT_EQ(law.A, -4.55);
  EXPECT_NEAR(law.B / c.B, 1, 1e-12);
  EXPECT_NEAR(law.C / c.C, 1, 1e-12);
  EXPECT_NEAR(law.glass_transition() / c.glass_transition, 1, 1e-12);
}

Oxides oxides(std::initializer_list<Real> v) {
  const Real* w = v.begin();
  return {.sio2 = w[0],
          .tio2 = w[1],
          .al2o3 = w[2],
          .feo = w[3],
          .mno = w[4],
          .mgo = w[5],
          .cao = w[6],
          .na2o = w[7],
          .k2o = w[8],
          .p2o5 = w[9],
          .h2o = w[10],
          .f2o_1 = w[11]};
}

INSTANTIATE_TEST_SUITE_P(
    , Grd08Calculator,
    testing::Values(
        Composition{"andesite", oxides({62.40, 0.55, 20.01, 0.03, 0.02, 3.22, 9.08, 3.52, 0.93, 0.12, 2.00, 0}), 7720.814579088871,
                    334.4288856944594, 800.9433617723369},
        Composition{"fissure8", oxides({51.22, 3.03, 13.10, 11.89, 0.17, 5.96, 9.99, 2.58, 0.57, 0.30, 0, 0}), 5962.045153152694,
                    600.699623102623, 960.9440432326951},
        Composition{"rhyolite", oxides({74, 0.2, 13, 1.5, 0.05, 0.3, 1.0, 4.0, 4.5, 0.05, 3.0, 1.5}), 10277.502336243548, 57.69566447509983,
                    678.6927844898157},
        Composition{"random0", oxides({63.2718, 2.7532, 20.0595, 10.8579, 0.067, 1.3481, 0.8798, 9.9341, 1.0453, 0.0395, 5.8589, 0.4543}),
                    7002.952954614999, 159.76019370453744, 582.8993450407911},
        Composition{"random3", oxides({49.8684, 2.772, 8.6765, 3.8087, 0.1847, 11.4591, 13.1399, 3.0015, 2.3293, 0.6669, 0, 2.4458}),
                    5970.599967659781, 449.06434798808715, 809.8256753391313},
        Composition{"random8", oxides({76.0298, 1.948, 4.7661, 3.3861, 0.2848, 16.2466, 21.5187, 1.6496, 7.7127, 0.3536, 7.2517, 0}),
                    6447.141766897445, 300.0459353537018, 689.6013291239401},
        Composition{"random17", oxides({69.7052, 1.8161, 20.818, 10.0242, 0.1082, 27.7493, 22.9652, 7.0362, 1.4875, 0.8909, 0, 0}),
                    4169.396861467059, 661.3929312532181, 913.3202340608954}),
    [](const testing::TestParamInfo<Composition>& i) { return std::string(i.param.name); });

TEST(MeltViscosity, FerricIronCountsAsTwoFerrousOnes) {
  Oxides ferrous = fissure8_glass(), ferric = ferrous;
  // The same moles of iron; the oxygen it brings changes the total, which is 100 again afterwards, and moves no moles.
  ferric.feo = 0;
  ferric.fe2o3 = ferrous.feo * 159.6882 / (2 * 71.8444);
  EXPECT_NEAR(grd08(ferric).B, grd08(ferrous).B, 1e-8);
  EXPECT_NEAR(grd08(ferric).C, grd08(ferrous).C, 1e-8);
}

TEST(MeltViscosity, Grd08DoesNotDependOnTheTotalAndFallsWithWater) {
  Oxides wt = fissure8_glass(), twice = wt;
  for (Real* x :
       {&twice.sio2, &twice.tio2, &twice.al2o3, &twice.feo, &twice.mno, &twice.mgo, &twice.cao, &twice.na2o, &twice.k2o, &twice.p2o5})
    *x *= 2;
  EXPECT_NEAR(grd08(twice).B, grd08(wt).B, 1e-8);
  Real before = melt_at(grd08_melt(wt), 1150);
  for (const Real water : {0.1, 0.3, 1.0, 3.0}) {
    wt.h2o = water;
    const Real mu = melt_at(grd08_melt(wt), 1150);
    EXPECT_LT(mu, before) << water;
    before = mu;
  }
}

TEST(MeltViscosity, Grd08RefusesWhatIsNoMelt) {
  EXPECT_TRUE(grd08_accepts(fissure8_glass()));
  EXPECT_FALSE(grd08_accepts({})) << "nothing at all";
  Oxides wt = fissure8_glass();
  wt.h2o = 100;
  EXPECT_FALSE(grd08_accepts(wt));
  wt.h2o = 0;
  wt.mgo = -1;
  EXPECT_FALSE(grd08_accepts(wt));
  wt.mgo = std::nan("");
  EXPECT_FALSE(grd08_accepts(wt));
  EXPECT_FALSE(grd08_accepts({.al2o3 = 100})) << "B = -173 * 100: it would thicken when heated";
}

TEST(MeltViscosity, VftMeetsTheTables) {
  // Mauna Ulu and Piton de la Fournaise: computed for the reference page from the same constants, three digits or fewer;
  // 191.51 is cut off there, not rounded.
  const MeltLaw mauna_ulu = vft_melt(-4.7, 5429.7, 595.5), piton = vft_melt(-4.52, 5558, 582.9);
  struct Row {
    Real celsius, mauna_ulu, half_a, piton, half_b;
  };
  for (const Row& r : {Row{1200, 30.7, 0.05, 52.9, 0.05},
                       {1150, 72.5, 0.05, 124, 0.5},
                       {1100, 191, 1, 326, 0.5},
                       {1087, 252, 0.5, 427, 0.5},
                       {1000, 2.1e3, 50, 3.4e3, 50},
                       {900, 5.0e4, 500, 7.9e4, 500}}) {
    expect_printed(melt_at(mauna_ulu, r.celsius), r.mauna_ulu, r.half_a);
    expect_printed(melt_at(piton, r.celsius), r.piton, r.half_b);
  }
}

TEST(MeltViscosity, DragoniMeetsTheTable) {
  const MeltLaw law = dragoni_melt(1000, kelvin(1137), 0.04);
  expect_printed(melt_at(law, 1200), 80.5, 0.05);
  expect_printed(melt_at(law, 1150), 594, 1);  // 594.52, cut off
  expect_printed(melt_at(law, 1100), 4.4e3, 50);
  expect_printed(melt_at(law, 1087), 7.4e3, 50);
  expect_printed(melt_at(law, 1000), 2.4e5, 5e3);
  expect_printed(melt_at(law, 900), 1.3e7, 5e5);
}

TEST(MeltViscosity, ExponentialGoesThroughItsTwoPoints) {
  const MeltLaw law = exponential_melt(1473.15, 100, 1173.15, 1e6);
  EXPECT_NEAR(std::exp(law.log_viscosity(1473.15)), 100, 1e-10);
  EXPECT_NEAR(std::exp(law.log_viscosity(1173.15)), 1e6, 1e-6);
  EXPECT_NEAR(std::exp(law.log_viscosity(1323.15)), 1e4, 1e-8) << "halfway: the geometric mean";
}

TEST(MeltViscosity, ArrheniusSlopeIsItsEnergyOverR) {
  const MeltLaw law = arrhenius_melt(100, 1400, 250e3);
  EXPECT_NEAR(std::exp(law.log_viscosity(1400)), 100, 1e-10);
  const Real slope = (law.log_viscosity(1300) - law.log_viscosity(1400)) / (1 / 1300.0 - 1 / 1400.0);
  EXPECT_NEAR(slope * 8.314462618, 250e3, 1e-6);
  EXPECT_EQ(std::exp(arrhenius_melt(100, 1400, 0).log_viscosity(300)), std::exp(arrhenius_melt(100, 1400, 0).log_viscosity(2000)));
}

TEST(MeltViscosity, IsInfiniteAtAndBelowThePole) {
  const MeltLaw law = vft_melt(-4.7, 5429.7, 595.5);
  for (const Real T : {1e-300, 300.0, 595.5}) EXPECT_EQ(law.log_viscosity(T), std::numeric_limits<Real>::infinity()) << T;
  EXPECT_TRUE(std::isfinite(law.log_viscosity(600)));
}

// ---- Crystals, bubbles, yield strength.

TEST(CrystalFactor, MeetsTheTable) {
  const CrystalLaw er = crystal_law(CrystalKind::kEinsteinRoscoe), kd = crystal_law(CrystalKind::kKriegerDougherty),
                   mp = crystal_law(CrystalKind::kMaronPierce);
  struct Row {
    Real phi, er, kd, mp, half_digit;
  };
  for (const Row& r : {Row{0.1, 1.506, 1.427, 1.410, 5e-4},
                       {0.2, 2.457, 2.190, 2.137, 5e-4},
                       {0.3, 4.519, 3.754, 3.613, 5e-4},
                       {0.4, 10.13, 7.771, 7.381, 5e-3},
                       {0.5, 33.66, 23.90, 22.65, 5e-3}}) {
    expect_printed(er.factor(r.phi), r.er, r.half_digit);
    expect_printed(kd.factor(r.phi), r.kd, r.half_digit);
    expect_printed(mp.factor(r.phi), r.mp, r.half_digit);
  }
}

TEST(CrystalFactor, BeginsWithTheIntrinsicViscosityAndEndsAtThePacking) {
  for (const CrystalKind kind : {CrystalKind::kEinsteinRoscoe, CrystalKind::kKriegerDougherty, CrystalKind::kMaronPierce}) {
    const CrystalLaw law = crystal_law(kind);
    EXPECT_EQ(law.factor(0), 1);
    EXPECT_EQ(law.factor(law.max), std::numeric_limits<Real>::infinity());
    EXPECT_EQ(law.factor(1), std::numeric_limits<Real>::infinity());
    EXPECT_GT(law.factor(law.max * (1 - 1e-6)), 1e8);
  }
  const Real phi = 1e-6;
  EXPECT_NEAR((crystal_law(CrystalKind::kEinsteinRoscoe).factor(phi) - 1) / phi, 2.5 * 1.51, 1e-4);
  EXPECT_NEAR((crystal_law(CrystalKind::kKriegerDougherty).factor(phi) - 1) / phi, 3.27, 1e-4);
  EXPECT_NEAR((crystal_law(CrystalKind::kMaronPierce).factor(phi) - 1) / phi, 2 / 0.633, 1e-4);
  EXPECT_EQ(crystal_law(CrystalKind::kNone).factor(0.9), 1);
}

TEST(Crystallinity, GrowsLinearlyBetweenItsTemperatures) {
  CrystalLaw law;
  law.erupted = 0.1;
  law.grown = 0.6;
  law.T_start = 1400;
  law.T_end = 1200;
  EXPECT_DOUBLE_EQ(law.crystallinity(2000), 0.1);
  EXPECT_DOUBLE_EQ(law.crystallinity(1400), 0.1);
  EXPECT_DOUBLE_EQ(law.crystallinity(1350), 0.25);
  EXPECT_DOUBLE_EQ(law.crystallinity(1200), 0.7);
  EXPECT_DOUBLE_EQ(law.crystallinity(300), 0.7);
}

TEST(Bubbles, StiffenWhenRigidAndThinWhenSoft) {
  BubbleLaw law{BubbleKind::kNone, 0.4};
  EXPECT_EQ(law.factor(), 1);
  law.kind = BubbleKind::kRigid;
  EXPECT_DOUBLE_EQ(law.factor(), 1 / 0.6);
  law.kind = BubbleKind::kSoft;
  EXPECT_DOUBLE_EQ(law.factor(), std::pow(0.6, 5.0 / 3));
  EXPECT_DOUBLE_EQ(bulk_density(2900, 0.4866), 2900 * 0.5134);
}

TEST(YieldStrength, DragoniAndRyersonMeetTheTables) {
  YieldLaw law;
  law.kind = YieldKind::kDragoniRyerson;
  law.T_start = kelvin(1137);
  const auto cold = [&](Real celsius) { return law.strength(kelvin(celsius), 0, 0); };
  expect_printed(cold(1100), 0.18, 0.005);
  expect_printed(cold(1050), 10.5, 0.05);
  expect_printed(cold(1000), 575, 0.5);
  expect_printed(cold(900), 1.7e6, 5e4);
  EXPECT_EQ(cold(1137), 0) << "the paper's exp(..) - 1, not FLOWGO's exp(.. - 1)";
  EXPECT_EQ(cold(1300), 0);
  const auto crystals = [&](Real phi) { return law.strength(kelvin(1200), phi, 0); };
  expect_printed(crystals(0.2), 66, 0.5);
  expect_printed(crystals(0.3), 210, 0.5);
  expect_printed(crystals(0.4), 477, 0.5);
  expect_printed(crystals(0.5), 901, 1);  // 901.6, cut off
}

TEST(YieldStrength, OfThreePhasesJumpsAtTheCriticalCrystallinity) {
  YieldLaw law;
  law.kind = YieldKind::kThreePhase;
  EXPECT_NEAR(law.strength(1400, 0.35, 0), 2, 1e-12) << "both powers are 10^0";
  EXPECT_NEAR(law.strength(1400, 0, 0), std::pow(10, -1.98 * 0.35), 1e-12);
  EXPECT_NEAR(law.strength(1400, 0.4, 0.2), 1e4 + std::pow(10, 1.98 * 0.25), 1e-8);
  EXPECT_EQ(law.strength(1400, 1, 0), YieldLaw::kStrongest);
}

// ---- All of it.

/// One of each kind, mixed: 6 melts x 4 crystals x 3 bubbles x 4 yields, exponents in turn.
std::vector<Rheology> every_mixture() {
  const MeltLaw melts[] = {constant_melt(1e3),
                           exponential_melt(1473.15, 100, 1173.15, 1e6),
                           arrhenius_melt(100, 1400, 250e3),
                           vft_melt(-4.7, 5429.7, 595.5),
                           grd08_melt(fissure8_glass()),
                           dragoni_melt(1000, kelvin(1137), 0.04)};
  std::vector<Rheology> all;
  for (const MeltLaw& melt : melts)
    for (int c = 0; c < 4; ++c)
      for (int b = 0; b < 3; ++b)
        for (int y = 0; y < 4; ++y) {
          Rheology r;
          r.melt = melt;
          r.crystals = crystal_law(static_cast<CrystalKind>(c));
          r.crystals.erupted = 0.1;
          r.crystals.grown = 0.9;
          r.bubbles = {static_cast<BubbleKind>(b), 0.4};
          r.yield.kind = static_cast<YieldKind>(y);
          r.yield.tau = 1e4;
          r.exponent = std::array{1.0, 0.5, 1.4}[all.size() % 3];
          all.push_back(r);
        }
  return all;
}

TEST(Rheology, NeverRisesWithTemperature) {
  for (const Rheology& r : every_mixture())
    for (const Real g : {0.0, 1e-3, 1.0}) {
      Real mu = std::numeric_limits<Real>::infinity(), tau = mu, phi = 1;
      for (Real T = 600; T <= 1700; T += 4) {
        const Real mu_next = r.viscosity(T, g);
        // Equal to rounding where a sum of constants stands: neighbouring doubles.
        ASSERT_LE(mu_next, mu * (1 + 1e-14)) << T << " K, " << g << "/s";
        ASSERT_LE(r.yield_strength(T), tau);
        ASSERT_LE(r.crystallinity(T), phi);
        mu = mu_next;
        tau = r.yield_strength(T);
        phi = r.crystallinity(T);
      }
    }
}

TEST(Rheology, IsFiniteAndWithinItsBoundsEverywhere) {
  for (Rheology r : every_mixture()) {
    r.mu_min = 1e-2;
    r.mu_max = 1e9;
    r.check();
    for (const Real T : {5e-324, 1e-3, 200.0, 595.5, 600.69, 1200.0, 5000.0, 1e6, 1e300})
      for (const Real g : {0.0, 5e-324, 1e-12, 1e-3, 1.0, 1e3, 1e12, 1e300}) {
        const Real mu = r.viscosity(T, g);
        ASSERT_TRUE(mu >= r.mu_min && mu <= r.mu_max) << mu << " Pa s at " << T << " K, " << g << "/s";
        ASSERT_TRUE(r.yield_strength(T) >= 0 && r.yield_strength(T) <= YieldLaw::kStrongest) << T;
        ASSERT_TRUE(r.crystallinity(T) >= 0 && r.crystallinity(T) <= 1) << T;
      }
  }
}

TEST(Rheology, HidesNoNotANumber) {
  const Real nan = std::nan("");
  for (const Rheology& r : every_mixture()) {
    EXPECT_TRUE(std::isnan(r.viscosity(nan, 1)));
    EXPECT_EQ(std::isnan(r.viscosity(1400, nan)), r.needs_strain_rate());
  }
}

TEST(Rheology, JammedCrystalsAndGlassAreCutToTheMaximum) {
  Rheology r;
  r.melt = vft_melt(-4.7, 5429.7, 595.5);
  r.crystals = crystal_law(CrystalKind::kMaronPierce);
  r.crystals.grown = 1;
  EXPECT_EQ(r.viscosity(r.crystals.T_end, 1), r.mu_max);
  EXPECT_EQ(r.viscosity(500, 1), r.mu_max);
  EXPECT_EQ(r.viscosity(500, 1e300), r.mu_max) << "no shear thins a solid";
  EXPECT_LT(r.viscosity(r.crystals.T_start, 1), r.mu_max);
}

TEST(Rheology, NewtonianIsItsViscosityBeyondTheUsualBounds) {
  for (const Real mu : {1e-6, 1.0, 3.704 * 2700, 1e15}) {
    const Rheology r = Rheology::newtonian(mu);
    r.check();
    EXPECT_FALSE(r.needs_strain_rate());
    for (const Real T : {200.0, 1400.0})
      for (const Real g : {0.0, 10.0}) EXPECT_NEAR(r.viscosity(T, g) / mu, 1, 1e-15 * 20) << "exp(log(mu)) rounds by |log mu| units";
    EXPECT_EQ(r.yield_strength(1400), 0);
    EXPECT_EQ(r.crystallinity(1400), 0);
  }
}

TEST(Rheology, NeedsTheStrainRateOnlyWhenItMatters) {
  for (Rheology r : every_mixture()) {
    const bool matters = r.viscosity(1400, 1e-2) != r.viscosity(1400, 1e2);
    EXPECT_TRUE(r.needs_strain_rate() || !matters);
    EXPECT_EQ(r.needs_strain_rate(), r.yield.kind != YieldKind::kNone || r.exponent != 1);
  }
}

struct Flow {
  const char* name;
  Real K, n, tau;
};
class ShearCurve : public testing::TestWithParam<Flow> {};

Rheology of(const Flow& f) {
  Rheology r = Rheology::newtonian(f.K);
  r.exponent = f.n;
  r.mu_min = 1e-6;
  if (f.tau > 0) {
    r.yield.kind = YieldKind::kConstant;
    r.yield.tau = f.tau;
  }
  return r;
}

TEST_P(ShearCurve, StressIsThatOfTheFlowLawOnceYielded) {
  const Flow f = GetParam();
  const Rheology r = of(f);
  for (const Real g : {4.6, 10.0, 100.0, 1e4, 1e6}) {
    const Real rate = g / r.regularisation, exact = f.tau + f.K * std::pow(rate, f.n);
    // Papanastasiou's exp(-m g) is all that is missing.
    EXPECT_NEAR(rate * r.viscosity(1400, rate), exact - f.tau * std::exp(-g), 1e-12 * exact) << rate;
    EXPECT_NEAR(rate * r.viscosity(1400, rate) / exact, 1, std::exp(-4.6)) << rate;
  }
}

TEST_P(ShearCurve, RisesWithTheShearRate) {
  const Rheology r = of(GetParam());
  Real stress = 0;
  for (Real g = 1e-9; g < 1e4; g *= 1.5) {
    EXPECT_GT(g * r.viscosity(1400, g), stress) << g;
    stress = g * r.viscosity(1400, g);
  }
}

TEST_P(ShearCurve, AtRestCreepsWithTheRegularisedViscosity) {
  const Flow f = GetParam();
  const Rheology r = of(f);
  // K g^(n-1) at g = 0: K, or without end for a thinning lava, or 0 for a thickening one.
  const Real mu = f.n < 1 ? r.mu_max : (f.n == 1 ? f.K : 0) + r.regularisation * f.tau;
  EXPECT_NEAR(r.viscosity(1400, 0) / mu, 1, 1e-13);
  if (f.n == 1) {
    EXPECT_NEAR(r.viscosity(1400, 1e-14) / mu, 1, 1e-10) << "no jump at rest";
  }
}

INSTANTIATE_TEST_SUITE_P(, ShearCurve,
                         testing::Values(Flow{"newtonian", 500, 1, 0}, Flow{"bingham", 500, 1, 2000}, Flow{"thinning", 500, 0.6, 2000},
                                         Flow{"thickening", 500, 1.5, 2000}, Flow{"power_law", 500, 0.6, 0}),
                         [](const testing::TestParamInfo<Flow>& i) { return std::string(i.param.name); });

TEST(YieldStrength, ALongerRegularisationComesNearerToStandingStill) {
  const Flow f{"bingham", 500, 1, 2000};
  Rheology r = of(f);
  const Real g = 1e-3, exact = f.tau + f.K * std::pow(g, f.n);
  Real error = std::numeric_limits<Real>::infinity();
  for (const Real m : {10.0, 100.0, 1e3, 1e4}) {
    r.regularisation = m;
    const Real next = std::abs(g * r.viscosity(1400, g) - exact);
    EXPECT_LT(next, error) << m;
    error = next;
  }
  EXPECT_LT(error, 1e-4 * exact);
}

TEST(RheologyDeathTest, BrokenPromisesStop) {
  EXPECT_DEATH(constant_melt(0), "mu > 0");
  EXPECT_DEATH(exponential_melt(1200, 10, 1300, 100), "hot_T > cold_T");
  EXPECT_DEATH(grd08_melt({}), "grd08_accepts");
  Rheology r;
  r.crystals.erupted = 0.5;
  r.crystals.grown = 0.6;
  EXPECT_DEATH(r.check(), "<= 1");
  r = {};
  r.mu_max = r.mu_min / 2;
  EXPECT_DEATH(r.check(), "mu_max >= mu_min");
}

// ---- Presets.

TEST(LavaPresets, AreFoundByTheirNames) {
  EXPECT_EQ(lava_preset_names(), (std::vector<std::string>{"etna", "kilauea-mauna-ulu", "kilauea-fissure8", "piton-de-la-fournaise"}));
  for (const LavaPreset& p : lava_presets()) EXPECT_EQ(find_lava_preset(p.name), &p);
  EXPECT_EQ(find_lava_preset("mordor"), nullptr);
}

TEST(LavaPresets, AreSoundAndSaySomethingOfThemselves) {
  for (const LavaPreset& p : lava_presets()) {
    p.rheology.check();
    EXPECT_FALSE(p.what.empty());
    EXPECT_FALSE(p.sources.empty());
    EXPECT_LT(p.solidus, p.eruption_temperature) << p.name;
    EXPECT_LE(p.eruption_temperature, p.liquidus) << p.name;
    EXPECT_EQ(p.density, bulk_density(p.dense_density, p.vesicularity));
    EXPECT_TRUE(p.density > 500 && p.density < 3000) << p.name;
    EXPECT_TRUE(p.emissivity > 0.5 && p.emissivity <= 1) << p.name;
    EXPECT_TRUE(p.conductivity > 0.3 && p.conductivity < 4) << p.name;
    EXPECT_LE(p.latent_heat_released(), p.latent_heat) << p.name;
    EXPECT_GT(p.rheology.viscosity(p.solidus, 1), 100 * p.rheology.viscosity(p.eruption_temperature, 1)) << p.name;
  }
  EXPECT_NEAR(find_lava_preset("etna")->density, 2600, 1e-9);
  EXPECT_NEAR(find_lava_preset("piton-de-la-fournaise")->convection, 8.73, 0.005) << "as the reference page derives it";
}

TEST(LavaPresets, AreAsStiffAtTheVentAsTheySay) {
  const auto at_vent = [](std::string_view name) {
    const LavaPreset& p = *find_lava_preset(name);
    return p.rheology.viscosity(p.eruption_temperature, 100);  // so fast that the yield strength does not count
  };
  EXPECT_NEAR(at_vent("etna"), 2000, 100);
  EXPECT_NEAR(at_vent("kilauea-mauna-ulu"), 90, 5);
  EXPECT_NEAR(at_vent("kilauea-fissure8"), 150, 5);
  EXPECT_NEAR(at_vent("piton-de-la-fournaise"), 380, 10);
}

TEST(LavaPresets, ComeNearTheMeasuredBulk) {
  // Fissure 8: 116 Pa s at 1150 degC (Halverson & Whittington 2024). grd08's own error is 0.4 in log10: so much is allowed.
  const Rheology& fissure8 = find_lava_preset("kilauea-fissure8")->rheology;
  EXPECT_LT(std::abs(std::log10(fissure8.viscosity(kelvin(1150), 100) / 116)), 0.4);
  // Etna, January 1974: 10^3 Pa s at 1080 degC, known to an order of magnitude: half a decade either way.
  const Rheology& etna = find_lava_preset("etna")->rheology;
  EXPECT_LT(std::abs(std::log10(etna.viscosity(kelvin(1080), 100) / 1e3)), 0.5);
}

}  // namespace
}  // namespace effuse::flow::sph
