#pragma once

#include <string>
#include <vector>

#include "geometry/terrain/terrain.h"
#include "skin/scene/skin_settings.h"
#include "skin/write/write_usda.h"

namespace effuse {

/// Camera and light of the film's frames 1 .. frames, those that differ from the one before: for programs that open the run.
std::vector<skin::UsdaView> film_views(const skin::SkinSettings& settings, const geometry::Terrain& terrain, int frames, Real fps);

/// As the JSON that manifest.json has of them, and back; views_of throws InputError where it is not as json_of writes it.
std::string json_of(const std::vector<skin::UsdaView>& views);
std::vector<skin::UsdaView> views_of(const std::string& json);

}  // namespace effuse
