#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "flow/sph/rheology.h"

/// Real lavas: numbers to start from, each with where it was found.
namespace effuse::flow::sph {

/// One lava. Temperatures [K]; all of it as it leaves the vent, bubbles included, unless said otherwise.
///
/// Where a source gives no figure, one of another basalt stands in, and `sources` says so. Figures that come from
/// memory and could not be read in a source are marked [M] there; no preset's rheology rests on one.
struct LavaPreset {
  std::string_view name;     ///< "kilauea-mauna-ulu"
  std::string_view what;     ///< one line
  std::string_view sources;  ///< what comes from where

  Rheology rheology;              ///< checked
  Vft melt;                       ///< the melt's law in rheology, as published
  std::optional<Oxides> glass;    ///< composition of the melt [wt %], where known: for grd08
  Real dense_density = 0;         ///< [kg/m^3], without bubbles
  Real vesicularity = 0;          ///< volume fraction of bubbles
  Real density = 0;               ///< [kg/m^3] = bulk_density(dense_density, vesicularity)
  Real eruption_temperature = 0;  ///< here crystals begin to grow: rheology.crystals.T_start
  Real solidus = 0;               ///< rheology.crystals.T_end
  Real liquidus = 0;              ///< >= eruption_temperature: lavas come out with crystals
  Real heat_capacity = 0;         ///< [J/(kg K)]
  Real latent_heat = 0;           ///< [J per kg that crystallises]
  Real emissivity = 0;
  Real conductivity = 0;  ///< of the bubbly lava, (1.929 - 1.554 vesicularity)^2 [W/(m K)]
  Real convection = 0;    ///< heat transfer to the air [W/(m^2 K)]

  /// Heat set free from eruption to solidus [J/kg]: only what grows then counts.
  Real latent_heat_released() const { return latent_heat * rheology.crystals.grown; }
};

/// All presets: etna, kilauea-mauna-ulu, kilauea-fissure8, piton-de-la-fournaise.
std::span<const LavaPreset> lava_presets();
/// nullptr: none of that name.
const LavaPreset* find_lava_preset(std::string_view name);
/// Their names, in order.
std::vector<std::string> lava_preset_names();

/// Mean glass of Kilauea's fissure 8, 2018 [wt %], dry. Source: U.S. Geological Survey (Lee et al. 2019).
/// grd08 gives 1474, 500, 192, 82 Pa s at 1100, 1150, 1200, 1250 degC.
Oxides fissure8_glass();

}  // namespace effuse::flow::sph
