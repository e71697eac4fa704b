#include "flow/plants/plant_fire.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::plants {

namespace {
constexpr Real kStefanBoltzmann = 5.670374e-8;  // [W/(m^2 K^4)]
constexpr Real kEmissivity = 0.9;               // of leaves, flames and lava alike
constexpr Real kDryHeat = 581e3, kWetHeat = 2594e3;  // [J/kg]
constexpr Real kDownward = 0.25;                // of a flame's heat, to the band below it
constexpr Real kWarm = 20;                      // [K] above air: what is cooler looks as it did
constexpr std::size_t kGrain = 8;               // plants

Real disk(Real area, Real distance2) { return area / (area + kPi * distance2); }
}  // namespace

PlantFire::PlantFire(std::vector<Vec3> feet, std::vector<Real> heights, std::vector<Real> radii, const Fuel& fuel)
    : feet_(std::move(feet)), heights_(std::move(heights)), radii_(std::move(radii)), fuel_(fuel) {
  CHECK_EQ(heights_.size(), feet_.size());
  CHECK_EQ(radii_.size(), feet_.size());
  CHECK_GT(fuel.ignition, fuel.air);
  capacity_ = fuel.density * fuel.thickness * (kDryHeat + fuel.moisture * kWetHeat) / (fuel.ignition - fuel.air);
  temperature_.assign(kBands * feet_.size(), fuel.air);
  burnt_.assign(temperature_.size(), 0);
  flux_.assign(temperature_.size(), 0);
}

Real PlantFire::flame(std::size_t plant, int band) const {
  const Real b = burnt(plant, band);
  return b <= 0 || b >= 1 ? 0 : std::clamp(std::min(b / 0.1, (1 - b) / 0.3), 0.0, 1.0);
}

bool PlantFire::step(Real dt, std::span<const HotPatch> patches) {
  ZONE("plants.fire");
  CHECK(dt > 0 && dt <= kStep * (1 + 1e-12));
  // Flames of whole plants as others see them: the middle of the burning bands, and their area.
  struct Torch {
    Vec3 at;
    Real area;
    std::size_t plant;
  };
  std::vector<Torch> torches;
  for (std::size_t p = 0; p < size(); ++p) {
    Real sum = 0;
    Vec3 at = Vec3::Zero();
    for (int k = 0; k < kBands; ++k) {
      sum += flame(p, k);
      at += flame(p, k) * middle(p, k);
    }
    // A flame stands above what burns by about its own height.
    if (sum > 0) torches.push_back({at / sum + Vec3(0, 0, heights_[p] / kBands), 2 * radii_[p] * heights_[p] / kBands * (sum + 1), p});
  }
  const Real air4 = std::pow(fuel_.air, 4);
  parallel_for(size(), [&](std::size_t p) {
    for (int k = 0; k < kBands; ++k) {
      const std::size_t q = p * kBands + static_cast<std::size_t>(k);
      flux_[q] = 0;
      if (burnt_[q] > 0) continue;
      const Vec3 x = middle(p, k);
      Real seen = 0, sum = 0;
      for (const HotPatch& patch : patches) {
        const Real F = disk(patch.area, (patch.at - x).squaredNorm());
        seen += F;
        sum += F * kEmissivity * kStefanBoltzmann * std::pow(patch.temperature, 4);
      }
      flux_[q] = sum / std::max(seen, 1.0);
      for (const Torch& torch : torches)
        if (torch.plant != p) flux_[q] += fuel_.flame_flux * disk(torch.area, (torch.at - x).squaredNorm());
      if (k > 0) flux_[q] += fuel_.flame_flux * flame(p, k - 1);
      if (k + 1 < kBands) flux_[q] += kDownward * fuel_.flame_flux * flame(p, k + 1);
    }
  }, kGrain);
  return parallel_reduce(
      burnt_.size(), false, [&](std::size_t q) {
        if (burnt_[q] >= 1) return false;
        if (burnt_[q] > 0) {
          burnt_[q] = std::min(1.0, burnt_[q] + dt / fuel_.burn_time);
          return true;
        }
        Real& T = temperature_[q];
        const bool warm = T > fuel_.air + kWarm;
        T += dt / capacity_ * (flux_[q] - 2 * fuel_.convection * (T - fuel_.air) - 2 * kEmissivity * kStefanBoltzmann * (std::pow(T, 4) - air4));
        T = std::max(T, fuel_.air);
        if (T >= fuel_.ignition) burnt_[q] = 1e-9;
        return warm || T > fuel_.air + kWarm;
      }, [](bool a, bool b) { return a || b; });
}

std::size_t PlantFire::burning() const {
  std::size_t n = 0;
  for (std::size_t p = 0; p < size(); ++p) n += any_flame(p);
  return n;
}

bool PlantFire::any_flame(std::size_t plant) const {
  bool any = false;
  for (int k = 0; k < kBands; ++k) any |= flame(plant, k) > 0;
  return any;
}

std::size_t PlantFire::burnt_down() const {
  std::size_t n = 0;
  for (std::size_t p = 0; p < size(); ++p) n += std::all_of(burnt_.begin() + static_cast<std::ptrdiff_t>(p * kBands), burnt_.begin() + static_cast<std::ptrdiff_t>((p + 1) * kBands), [](Real b) { return b >= 1; });
  return n;
}

std::size_t PlantFire::memory() const { return feet_.capacity() * sizeof(Vec3) + (heights_.capacity() + radii_.capacity() + 3 * burnt_.capacity()) * sizeof(Real); }

void PlantFire::add_to(StateHash& hash) const {
  hash.add(std::span<const Real>(temperature_));
  hash.add(std::span<const Real>(burnt_));
}

void PlantFire::save(StateWriter& out) const {
  out.array("temperature", temperature_);
  out.array("burnt", burnt_);
}

void PlantFire::load(StateReader& in) {
  std::vector<Real> temperature, burnt;
  in.array("temperature", temperature);
  in.array("burnt", burnt);
  if (temperature.size() != temperature_.size() || burnt.size() != burnt_.size()) throw InputError(Place{"checkpoint"}, "holds other plants than the scene's");
  temperature_ = std::move(temperature);
  burnt_ = std::move(burnt);
}

std::vector<HotPatch> hot_patches(std::span<const Vec3> x, std::span<const Real> temperature, std::span<const std::uint8_t> surface, Real spacing, Real cell, Real coldest) {
  CHECK_EQ(temperature.size(), x.size());
  CHECK_GT(cell, 0);
  struct Sum {
    Vec3 at = Vec3::Zero();
    Real fourth = 0, count = 0;
  };
  std::map<std::array<std::int64_t, 3>, Sum> cells;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if ((!surface.empty() && !surface[i]) || temperature[i] < coldest) continue;
    Sum& sum = cells[{static_cast<std::int64_t>(std::floor(x[i].x() / cell)), static_cast<std::int64_t>(std::floor(x[i].y() / cell)), static_cast<std::int64_t>(std::floor(x[i].z() / cell))}];
    sum.at += x[i];
    sum.fourth += std::pow(temperature[i], 4);
    sum.count += 1;
  }
  std::vector<HotPatch> patches;
  for (const auto& [key, sum] : cells) patches.push_back({Vec3(sum.at / sum.count), sum.count * spacing * spacing, std::pow(sum.fourth / sum.count, 0.25)});
  return patches;
}

}  // namespace effuse::flow::plants
