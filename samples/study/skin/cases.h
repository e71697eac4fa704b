#pragma once

#include <vector>

#include "samples/study/study.h"

/// Parts of skin_cases(), each in its own file.
namespace effuse::study {

void add_surface_cases(std::vector<Case>& cases);       // solids of particles: volume, distances, seconds
void add_tessellation_cases(std::vector<Case>& cases);  // closed, good triangles, regions
void add_volume_cases(std::vector<Case>& cases);        // of a flow's skin
void add_coherence_cases(std::vector<Case>& cases);     // detail that goes with the lava
void add_relief_cases(std::vector<Case>& cases);        // no kinks, no direction
void add_temperature_cases(std::vector<Case>& cases);   // height, roughness, glow
void add_picture_cases(std::vector<Case>& cases);       // close-ups

}  // namespace effuse::study
