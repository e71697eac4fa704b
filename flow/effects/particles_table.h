#pragma once

#include <string>
#include <vector>

#include "flow/particles/particle_cloud.h"
#include "flow/scene/effect.h"

namespace effuse::flow {

/// Where particles of a scene come from.
enum class ParticleSource { kPoint, kDisk, kMesh, kCurve, kLava, kVent, kWater };

/// A table [[particles.emitter]], in the terrain file's coordinates.
struct PlannedEmitter {
  ParticleSource from = ParticleSource::kPoint;
  particles::EmitterOptions options;
  bool on_ground = false;
  PlannedForm form;          ///< kMesh
  geometry::RigidPose pose;  ///< kMesh
  std::string water;         ///< kWater: name of the effect; "": any
  Real hotter_than = 0;      ///< kLava, kWater: particles of lava that are [K]
  Real deepest = 0;          ///< kWater: lava no deeper under it [m]
  Real full_area = 0;        ///< [m^2] of such lava that lets out the whole rate; 0: any
  Place place;
};

/// A table [[particles]], read.
struct ParticlesSettings {
  std::string name;
  particles::CloudOptions cloud;
  std::vector<PlannedEmitter> emitters;
  bool meets = true;          ///< ground and obstacles
  Real thickness = 0;
  Real step = 0, warm_up = 0; ///< [s]
  NamedCloud::Look look = NamedCloud::Look::kGrains;
  Vec3 color = Vec3::Ones();  ///< linear light
  Real opacity = 1;
  bool soft = false;
  Real fade_in = 0, fade_out = 0;  ///< shares of a lifetime
  bool points = true, spheres = false, volume = false;
  Real voxel = 0;
  std::uint64_t seed = 0;
  std::vector<Partner> partners;
};

/// Faults stay in the table.
ParticlesSettings read_particles_table(Parameters& p);

}  // namespace effuse::flow
