#pragma once

#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/procedural/l_system.h"

namespace effuse::geometry {

/// What a turtle does with a word's letters, numbers in brackets optional:
///   F(l)  a limb of length l      f(l)  goes on without one
///   +(a) -(a)  turns left, right  &(a) ^(a)  pitches down, up     \(a) /(a)  rolls left, right     |  turns round
///   [ ]   a branch                !(d)  thickness d from here on      ~(s)  a leaf of size s      $  rolls until its left is level
/// Angles are in degrees, as the notation has them; other letters are passed over.
struct TurtleOptions {
  Real step = 1;                 ///< [m] of F and f without a number
  Real angle = 25 * kPi / 180;   ///< [rad] of turns without a number
  Real thickness = 0.1;          ///< [m], diameter at the start
  Real thinning = 0.7;           ///< of a branch where ! says nothing: diameter at each [
  Real leaf = 0.2;               ///< [m] of ~ without a number
};

/// A limb between two points.
struct Limb {
  Vec3 from, to;
  Real thick_from, thick_to;  ///< diameters [m]; a branch thins evenly from limb to limb and ends at thinning times its last
  Index parent;               ///< limb it grows from; Plant::kNone: the ground
  Index branch;               ///< limbs of one branch follow one another
};
struct Leaf {
  Vec3 at, along, normal;  ///< unit directions
  Real size;
  Index limb;
};

/// Grown from the origin up along z.
struct Plant {
  static constexpr Index kNone = ~Index{0};
  std::vector<Limb> limbs;
  std::vector<Leaf> leaves;
  Real height() const;
};

Plant grow(const std::vector<LModule>& word, const TurtleOptions& options);

/// Where the wind bends it at time t [s]: each limb turns about its foot by
///   flexibility (wind / thickness) (1 + gust sin(2 pi t / period + its own phase)) rad at most a quarter turn,
/// and carries what grows on it. A function of time, no state.
struct Sway {
  Vec2 wind = Vec2::Zero();    ///< [m/s]
  Real flexibility = 1e-4;     ///< [rad m / (m/s)]
  Real gust = 0.5;             ///< share of the wind that comes and goes
  Real period = 3;             ///< [s]
};
Plant swayed(const Plant& plant, const Sway& sway, Real t);

/// Limbs as tapered tubes of so many sides (>= 3), each branch one closed tube; leaves as rhombs of two triangles.
/// Attributes: "part" 0 wood, 1 leaf; "limb" the limb's number; "color" linear light.
TriMesh plant_mesh(const Plant& plant, int sides = 6);

/// Plants by name: "tree", "bush", "conifer", "grass"; about 1 m high as they are, but for their seed's chances.
struct PlantKind {
  std::string name, what;
  LSystem system;
  TurtleOptions turtle;
  int generations;
};
const std::vector<PlantKind>& plant_kinds();

}  // namespace effuse::geometry
