#include "flow/effects/lava_rheology.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace effuse::flow {

namespace {

using sph::BubbleKind;
using sph::CrystalKind;
using sph::CrystalLaw;
using sph::LavaPreset;
using sph::MeltKind;
using sph::MeltLaw;
using sph::Oxides;
using sph::Rheology;
using sph::YieldKind;

template <std::size_t N>
std::vector<std::string> names(const std::string_view (&list)[N]) {
  return {std::begin(list), std::end(list)};
}

constexpr Parameters::Range kTemperature = {0, 5000, true};
constexpr Parameters::Range kFraction = {0, 1};
// Further apart than any melt is from any other; beyond them exp() leaves the numbers.
constexpr Parameters::Range kViscosity = {1e-6, 1e20};

void read_oxides(Parameters& p, const LavaPreset* preset, MeltLaw& melt) {
  Parameters table = p.table("oxides", "of law = \"grd08\": what the melt is made of, plain numbers in wt %");
  const Oxides usual = preset && preset->glass ? *preset->glass : Oxides{};
  struct Entry {
    const char* key;
    Real Oxides::*member;
    const char* what;
  };
  static constexpr Entry kEntries[] = {
      {"sio2", &Oxides::sio2, "silica, wt %"},
      {"tio2", &Oxides::tio2, "titania"},
      {"al2o3", &Oxides::al2o3, "alumina"},
      {"fe2o3", &Oxides::fe2o3, "ferric iron"},
      {"feo", &Oxides::feo, "ferrous iron, or all of it"},
      {"mno", &Oxides::mno, "manganese oxide"},
      {"mgo", &Oxides::mgo, "magnesia"},
      {"cao", &Oxides::cao, "lime"},
      {"na2o", &Oxides::na2o, "soda"},
      {"k2o", &Oxides::k2o, "potash"},
      {"p2o5", &Oxides::p2o5, "phosphate"},
      {"h2o", &Oxides::h2o, "water; 0.1 takes 40 % off a basalt's viscosity"},
      {"f2o_1", &Oxides::f2o_1, "fluorine, as F2O-1"},
  };
  Oxides wt;
  Real total = 0;
  for (const Entry& e : kEntries) {
    wt.*e.member = table.number(e.key, "", usual.*e.member, {0, 100}, e.what);
    total += wt.*e.member;
  }
  if (!(total >= 80 && total <= 120)) {
    table.fault("", fmt::format("the oxides add up to {:.4g}, wanted about 100: plain numbers in wt %", total));
  } else if (!sph::grd08_accepts(wt)) {
    table.fault("", "no melt grd08 knows: its viscosity would not fall with temperature; look at the water and the iron");
  } else {
    melt = sph::grd08_melt(wt);
  }
}

void read_melt(Parameters& p, const LavaPreset* preset, MeltLaw& melt) {
  const auto kind = static_cast<MeltKind>(p.choice("law", names(sph::kMeltNames), static_cast<std::size_t>(melt.kind),
                                                   "of the melt. constant: viscosity; exponential: hot, hot_temperature, cold, "
                                                   "cold_temperature; arrhenius: viscosity, temperature, activation_energy; "
                                                   "vft: a, b, c; grd08: oxides; dragoni: viscosity, temperature, rate"));
  const bool same = preset && kind == preset->rheology.melt.kind;
  // What is missing or out of range reads as 0 or the default; then the law stays what it was.
  switch (kind) {
    case MeltKind::kConstant: {
      const Real mu = p.number("viscosity", "Pa s", 1000, kViscosity, "at any temperature");
      melt = sph::constant_melt(mu);
      break;
    }
    case MeltKind::kExponential: {
      const Real hot =
          p.number("hot", "Pa s", std::nullopt, kViscosity, "viscosity at hot_temperature; ln of it falls linearly with temperature");
      const Real hot_T = p.number("hot_temperature", "K", std::nullopt, kTemperature, "");
      const Real cold = p.number("cold", "Pa s", std::nullopt, kViscosity, "viscosity at cold_temperature");
      const Real cold_T = p.number("cold_temperature", "K", std::nullopt, kTemperature, "");
      const bool read = hot > 0 && hot_T > 0 && cold > 0 && cold_T > 0;
      if (read && cold_T >= hot_T) p.fault("cold_temperature", "is not below hot_temperature");
      if (read && cold < hot) p.fault("cold", "is below hot: lava thickens as it cools");
      if (read && cold_T < hot_T && cold >= hot) melt = sph::exponential_melt(hot_T, hot, cold_T, cold);
      break;
    }
    case MeltKind::kArrhenius: {
      const Real mu = p.number("viscosity", "Pa s", std::nullopt, kViscosity, "at temperature");
      const Real T = p.number("temperature", "K", std::nullopt, kTemperature, "");
      const Real E =
          p.number("activation_energy", "J", std::nullopt, {0, 1e7}, "E of one mole: viscosity exp(E / R (1/T - 1/temperature))");
      if (mu > 0 && T > 0) melt = sph::arrhenius_melt(mu, T, E);
      break;
    }
    case MeltKind::kVft: {
      const auto usual = [&](Real sph::Vft::*member) { return same ? std::optional<Real>(preset->melt.*member) : std::nullopt; };
      const Real A = p.number("a", "", usual(&sph::Vft::A), {-30, 30}, "log10 of the viscosity in Pa s is a + b / (T - c)");
      const Real B = p.number("b", "K", usual(&sph::Vft::B), {0, 1e6}, "");
      const Real C = p.number("c", "K", usual(&sph::Vft::C), {0, 5000}, "no flow at and below this temperature");
      melt = sph::vft_melt(A, B, C);
      break;
    }
    case MeltKind::kGrd08:
      read_oxides(p, preset, melt);
      break;
    case MeltKind::kDragoni: {
      const Real mu = p.number("viscosity", "Pa s", std::nullopt, kViscosity, "at temperature");
      const Real T = p.number("temperature", "K", std::nullopt, kTemperature, "");
      const Real rate = p.number("rate", "1/K", 0.04, {0, 1}, "viscosity exp(rate (temperature - T))");
      if (mu > 0 && T > 0) melt = sph::dragoni_melt(mu, T, rate);
      break;
    }
  }
}

void read_crystals(Parameters p, const LavaPreset* preset, CrystalLaw& crystals) {
  const CrystalLaw usual = crystals;
  const auto kind = static_cast<CrystalKind>(
      p.choice("law", names(sph::kCrystalNames), static_cast<std::size_t>(usual.kind), "by which crystals stiffen the melt"));
  const CrystalLaw standard = preset && kind == usual.kind ? usual : sph::crystal_law(kind);
  crystals.kind = kind;
  crystals.erupted = p.number("erupted", "", usual.erupted, kFraction, "volume fraction of crystals as the lava comes out");
  crystals.grown = p.number("grown", "", usual.grown, kFraction, "volume fraction that grows from start to end");
  crystals.T_start = p.number("start", "K", usual.T_start, kTemperature, "temperature below which crystals grow");
  crystals.T_end = p.number("end", "K", usual.T_end, kTemperature, "temperature below which no more grow: the solidus");
  crystals.max = standard.max;
  crystals.intrinsic = standard.intrinsic;
  if (kind != CrystalKind::kNone) crystals.max = p.number("max", "", standard.max, {0, 1, true}, "volume fraction at which they jam");
  if (kind == CrystalKind::kKriegerDougherty)
    crystals.intrinsic = p.number("intrinsic", "", standard.intrinsic, {0, 100, true}, "B in (1 - phi/max)^(-B max)");
  // Rounding of the sum of two fractions that make 1 is no fault.
  if (crystals.erupted + crystals.grown > 1 + 1e-12) {
    p.fault("grown", fmt::format("with what is erupted {:g} of the lava would be crystals, at most 1", crystals.erupted + crystals.grown));
    crystals.erupted = usual.erupted;
    crystals.grown = usual.grown;
  }
  crystals.grown = std::min(crystals.grown, 1 - crystals.erupted);
  if (crystals.T_end >= crystals.T_start) {
    p.fault(p.has("end") ? "end" : "start",
            fmt::format("crystals would grow from {:g} K down to {:g} K, wanted an end below the start", crystals.T_start, crystals.T_end));
    crystals.T_start = usual.T_start;
    crystals.T_end = usual.T_end;
  }
}

void read_yield(Parameters p, Rheology& r) {
  auto& yield = r.yield;
  yield.kind = static_cast<YieldKind>(p.choice(
      "law", names(sph::kYieldNames), static_cast<std::size_t>(yield.kind),
      "strength below which lava stands. constant: strength; dragoni_ryerson: cold, rate, start; three_phase: from crystals and bubbles"));
  if (yield.kind == YieldKind::kConstant) yield.tau = p.number("strength", "Pa", std::nullopt, {0, sph::YieldLaw::kStrongest}, "");
  if (yield.kind == YieldKind::kDragoniRyerson) {
    yield.cold = p.number("cold", "Pa", yield.cold, {0, 1e9}, "strength is cold (exp(rate (start - T)) - 1) + 6500 Pa phi^2.85");
    yield.rate = p.number("rate", "1/K", yield.rate, {0, 1}, "");
    yield.T_start = p.number("start", "K", r.crystals.T_start, kTemperature, "no such strength above");
  }
  if (yield.kind == YieldKind::kNone) return;
  r.regularisation = p.number("regularisation", "s", r.regularisation, {0, 1e9, true},
                              "m of Papanastasiou: lava that stands creeps with viscosity m strength");
}

}  // namespace

Rheology read_rheology(Parameters& lava, const LavaPreset* preset) {
  Rheology r = preset ? preset->rheology : Rheology{};
  Parameters p = lava.table("rheology", "how stiff the lava is; viscosities are dynamic");
  read_melt(p, preset, r.melt);
  r.mu_min = p.number("min", "Pa s", r.mu_min, kViscosity, "viscosity is never below");
  r.mu_max = p.number("max", "Pa s", r.mu_max, kViscosity, "viscosity is never above");
  r.exponent =
      p.number("exponent", "", r.exponent, {0.05, 5}, "n: stress grows with the n-th power of the shear rate; 1 Newtonian or Bingham");
  if (r.mu_max < r.mu_min) {
    p.fault(p.has("max") ? "max" : "min", fmt::format("max, {:g} Pa s, is below min, {:g} Pa s", r.mu_max, r.mu_min));
    r.mu_max = r.mu_min;
  }
  read_crystals(p.table("crystals", "how many there are, and what they do"), preset, r.crystals);
  Parameters bubbles = p.table("bubbles", "what they do to the viscosity");
  r.bubbles.kind = static_cast<BubbleKind>(bubbles.choice("law", names(sph::kBubbleNames), static_cast<std::size_t>(r.bubbles.kind),
                                                          "rigid ones stiffen slow lava, soft ones thin fast lava"));
  r.bubbles.fraction = bubbles.number("fraction", "", r.bubbles.fraction, {0, 0.99}, "of the volume");
  read_yield(p.table("yield", "what keeps lava standing"), r);
  r.check();
  return r;
}

}  // namespace effuse::flow
