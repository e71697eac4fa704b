#pragma once

#include <algorithm>
#include <vector>

#include "flow/sph/heat.h"
#include "samples/study/study.h"

/// Heat alone, of particles that stand still.
namespace effuse::study {

/// A lattice of particles at rest, endless in x and y, its top layer first: layer k has its middle (k + 1/2) dx below the surface.
class Stack {
 public:
  static constexpr int kAcross = 6;       ///< particles in a period: two supports
  static constexpr Real kSupport = 3;

  Stack(int layers, Real dx);

  std::size_t size() const { return x_.size(); }
  int layers() const { return layers_; }
  Real dx() const { return dx_; }
  Real area() const { return kAcross * kAcross * dx_ * dx_; }
  Real depth_of_layer(int k) const { return (k + 0.5) * dx_; }
  void expose_top() { std::fill_n(sky_.begin(), kAcross * kAcross, dx_ * dx_); }

  flow::sph::HeatBudget step(flow::sph::Heat& heat, Real dt) const;
  /// Depth and temperature: the crust columns' cells of the top layer, where it has them, then the layers.
  Curve profile(const flow::sph::Heat& heat) const;

 private:
  int layers_;
  Real dx_;
  std::vector<Vec3> x_;
  Vec2 period_;
  flow::sph::Neighbors neighbors_;
  std::vector<Real> sky_;
};

}  // namespace effuse::study
