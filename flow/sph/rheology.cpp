#include "flow/sph/rheology.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"

namespace effuse::flow::sph {

namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
constexpr Real kLn10 = 2.302585092994045684;
constexpr Real kGasConstant = 8.314462618;  // [J/(mol K)], CODATA 2018

/// Oxides in mol %, all iron as FeO; Fe2O3 is two of it.
struct Moles {
  Real si, ti, al, fe, mn, mg, ca, na, k, p, h, f;
};

Moles mole_percent(const Oxides& wt) {
  const Real dry = wt.sio2 + wt.tio2 + wt.al2o3 + wt.fe2o3 + wt.feo + wt.mno + wt.mgo + wt.cao + wt.na2o + wt.k2o + wt.p2o5 + wt.f2o_1;
  const Real s = (100 - wt.h2o) / dry;
  // Grams per mole, those of the authors' calculator; an F2O-1 counts half there.
  Moles n{s * wt.sio2 / 60.0843,  s * wt.tio2 / 79.8658,  s * wt.al2o3 / 101.961276, s * (wt.feo / 71.8444 + 2 * wt.fe2o3 / 159.6882),
          s * wt.mno / 70.937449, s * wt.mgo / 40.3044,   s * wt.cao / 56.0774,      s * wt.na2o / 61.97894,
          s * wt.k2o / 94.1960,   s * wt.p2o5 / 141.9446, wt.h2o / 18.01528,         s * 0.5 * wt.f2o_1 / 18.9984};
  const Real total = n.si + n.ti + n.al + n.fe + n.mn + n.mg + n.ca + n.na + n.k + n.p + n.h + n.f;
  for (Real* x : {&n.si, &n.ti, &n.al, &n.fe, &n.mn, &n.mg, &n.ca, &n.na, &n.k, &n.p, &n.h, &n.f}) *x *= 100 / total;
  return n;
}

/// (1 - exp(-m g)) / g, and its limit m at g = 0.
Real regularised_inverse(Real m, Real g) {
  const Real x = m * g;
  return x == 0 ? m : m * (-std::expm1(-x) / x);
}

}  // namespace

Real MeltLaw::log_viscosity(Real T) const {
  if (q > 0) return T <= C ? kInfinity : p + q / (T - C);
  return p - a * T;
}

MeltLaw constant_melt(Real mu) {
  CHECK_GT(mu, 0);
  return {MeltKind::kConstant, std::log(mu), 0, 0, 0};
}

MeltLaw exponential_melt(Real hot_T, Real hot_mu, Real cold_T, Real cold_mu) {
  CHECK_GT(cold_T, 0);
  CHECK_GT(hot_T, cold_T);
  CHECK_GT(hot_mu, 0);
  CHECK_GE(cold_mu, hot_mu);
  const Real a = std::log(cold_mu / hot_mu) / (hot_T - cold_T);
  return {MeltKind::kExponential, std::log(hot_mu) + a * hot_T, 0, 0, a};
}

MeltLaw arrhenius_melt(Real mu_ref, Real T_ref, Real E) {
  CHECK_GT(mu_ref, 0);
  CHECK_GT(T_ref, 0);
  CHECK_GE(E, 0);
  const Real q = E / kGasConstant;
  return {MeltKind::kArrhenius, std::log(mu_ref) - q / T_ref, q, 0, 0};
}

MeltLaw vft_melt(Real A, Real B, Real C) {
  CHECK_GE(B, 0);
  CHECK_GE(C, 0);
  return {MeltKind::kVft, A * kLn10, B * kLn10, C, 0};
}

Vft grd08(const Oxides& wt) {
  const Moles n = mole_percent(wt);
  const Real ta = n.ti + n.al, fm = n.fe + n.mn + n.mg, nk = n.na + n.k, v = n.h + n.f, ln_h = std::log1p(n.h), ln_v = std::log1p(v);
  Vft law;
  law.A = -4.55;
  law.B = 159.56 * (n.si + n.ti) - 173.34 * n.al + 72.13 * (n.fe + n.mn + n.p) + 75.69 * n.mg - 38.98 * n.ca - 84.08 * (n.na + v) +
          141.54 * (v + ln_h) - 2.43 * (n.si + n.ti) * fm - 0.91 * (n.si + ta + n.p) * (nk + n.h) + 17.62 * n.al * nk;
  law.C = 2.75 * n.si + 15.72 * ta + 8.32 * fm + 10.20 * n.ca - 12.29 * nk - 99.54 * ln_v + 0.30 * (n.al + fm + n.ca - n.p) * (nk + v);
  return law;
}

bool grd08_accepts(const Oxides& wt) {
  Real dry = 0;
  for (const Real x : {wt.sio2, wt.tio2, wt.al2o3, wt.fe2o3, wt.feo, wt.mno, wt.mgo, wt.cao, wt.na2o, wt.k2o, wt.p2o5, wt.f2o_1}) {
    if (!(x >= 0 && x <= 1e6)) return false;
    dry += x;
  }
  if (!(dry > 0 && wt.h2o >= 0 && wt.h2o < 100)) return false;
  const Vft law = grd08(wt);
  return law.B > 0 && law.C > 0;
}

MeltLaw grd08_melt(const Oxides& wt) {
  CHECK(grd08_accepts(wt));
  const Vft law = grd08(wt);
  MeltLaw melt = vft_melt(law.A, law.B, law.C);
  melt.kind = MeltKind::kGrd08;
  return melt;
}

MeltLaw dragoni_melt(Real mu_ref, Real T_ref, Real c) {
  CHECK_GT(mu_ref, 0);
  CHECK_GT(T_ref, 0);
  CHECK_GE(c, 0);
  return {MeltKind::kDragoni, std::log(mu_ref) + c * T_ref, 0, 0, c};
}

Real CrystalLaw::crystallinity(Real T) const { return erupted + grown * std::clamp((T_start - T) / (T_start - T_end), Real{0}, Real{1}); }

Real CrystalLaw::factor(Real phi) const {
  if (kind == CrystalKind::kNone) return 1;
  const Real room = 1 - phi / max;
  if (!(room > 0)) return kInfinity;
  switch (kind) {
    case CrystalKind::kEinsteinRoscoe:
      return 1 / (room * room * std::sqrt(room));
    case CrystalKind::kKriegerDougherty:
      return std::pow(room, -intrinsic * max);
    default:
      return 1 / (room * room);
  }
}

CrystalLaw crystal_law(CrystalKind kind) {
  CrystalLaw law;
  law.kind = kind;
  if (kind == CrystalKind::kEinsteinRoscoe) law.max = 1 / 1.51;
  if (kind == CrystalKind::kMaronPierce) law.max = 0.633;
  return law;
}

Real BubbleLaw::factor() const {
  switch (kind) {
    case BubbleKind::kRigid:
      return 1 / (1 - fraction);
    case BubbleKind::kSoft:
      return std::pow(1 - fraction, Real{5} / 3);
    default:
      return 1;
  }
}

Real bulk_density(Real dense_density, Real bubble_fraction) { return dense_density * (1 - bubble_fraction); }

Real YieldLaw::strength(Real T, Real phi, Real bubble_fraction) const {
  Real tau_y = 0;
  switch (kind) {
    case YieldKind::kNone:
      return 0;
    case YieldKind::kConstant:
      tau_y = tau;
      break;
    case YieldKind::kDragoniRyerson:
      tau_y = cold * std::expm1(rate * std::max(T_start - T, Real{0})) + 6500 * std::pow(phi, 2.85);
      break;
    case YieldKind::kThreePhase:
      tau_y = std::exp(kLn10 * 80 * (phi - 0.35)) + std::exp(kLn10 * 1.98 * (phi + bubble_fraction - 0.35));
      break;
  }
  return std::min(tau_y, kStrongest);
}

Real Rheology::crystallinity(Real temperature) const { return crystals.crystallinity(temperature); }

Real Rheology::yield_strength(Real temperature) const {
  if (yield.kind == YieldKind::kNone) return 0;
  return yield.strength(temperature, crystallinity(temperature), bubbles.fraction);
}

Real Rheology::viscosity(Real temperature, Real strain_rate) const {
  Real mu = std::exp(melt.log_viscosity(temperature));
  if (crystals.kind != CrystalKind::kNone) mu *= crystals.factor(crystallinity(temperature));
  mu = std::max(mu * bubbles.factor(), mu_min);
  // Below the melt's pole or with jammed crystals there is no flow law left. Beyond this line infinity times 0, and
  // with the line before 0 times infinity, cannot arise.
  if (mu == kInfinity) return mu_max;
  if (exponent != 1) mu *= std::pow(strain_rate, exponent - 1);
  if (yield.kind != YieldKind::kNone) mu += yield_strength(temperature) * regularised_inverse(regularisation, strain_rate);
  return std::clamp(mu, mu_min, mu_max);
}

void Rheology::check() const {
  CHECK_GE(melt.q, 0);
  CHECK_GE(melt.a, 0);
  CHECK_GE(melt.C, 0);
  CHECK(std::isfinite(melt.p));
  CHECK_GE(crystals.erupted, 0);
  CHECK_GE(crystals.grown, 0);
  CHECK_LE(crystals.erupted + crystals.grown, 1);
  CHECK_GT(crystals.T_start, crystals.T_end);
  CHECK_GT(crystals.max, 0);
  CHECK_LE(crystals.max, 1);
  CHECK_GT(crystals.intrinsic, 0);
  CHECK_GE(bubbles.fraction, 0);
  CHECK_LT(bubbles.fraction, 1);
  CHECK_GE(yield.tau, 0);
  CHECK_GE(yield.cold, 0);
  CHECK_GE(yield.rate, 0);
  CHECK_GT(yield.T_start, 0);
  CHECK_GT(exponent, 0);
  CHECK_GT(regularisation, 0);
  CHECK_LT(regularisation, kInfinity);
  CHECK_GT(mu_min, 0);
  CHECK_GE(mu_max, mu_min);
  CHECK_LT(mu_max, kInfinity);
}

Rheology Rheology::newtonian(Real mu) {
  Rheology r;
  r.melt = constant_melt(mu);
  r.mu_min = std::min(r.mu_min, mu);
  r.mu_max = std::max(r.mu_max, mu);
  return r;
}

}  // namespace effuse::flow::sph
