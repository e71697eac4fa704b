#pragma once

#include <algorithm>
#include <cmath>

#include "flow/fem/elastic_solid.h"
#include "flow/integrate/deformable.h"
#include "geometry/collide/obstacles.h"

/// A box of finite elements, for tests of lava beside solids that deform.
namespace effuse::flow::sph {

class SoftBlock final : public Deformable {
 public:
  SoftBlock(const Vec3& low, const Vec3& high, int cells, const fem::ElasticMaterial& material, Real longest_step = 0.01)
      : solid_(fem::box_of_tets(low, high, cells, cells, cells), material), longest_(longest_step) {
    const geometry::TriMesh faces = solid_.surface();
    std::vector<Index> first = {0}, point;
    for (Index i = 0; i < solid_.nodes(); ++i) {
      point.push_back(i);
      first.push_back(i + 1);
    }
    surface_ = hang(faces.positions, faces.triangles, first, point, std::vector<Real>(point.size(), 1));
  }

  fem::ElasticSolid& solid() { return solid_; }
  /// As an obstacle, of that number of surface.
  geometry::Obstacle obstacle(Index number) const {
    geometry::TriMesh mesh;
    surface_.gather(places(), mesh.positions);
    mesh.triangles = surface_.triangles;
    return {geometry::CollisionMesh(mesh), {}, 0, number};
  }
  /// With what it has been given and has not taken up yet.
  Vec3 momentum() const {
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 0; i < solid_.nodes(); ++i) sum += masses()[i] * velocities()[i];
    for (const Vec3& impulse : owed_.impulses()) sum += impulse;
    return sum;
  }

  std::span<const Vec3> places() const override { return solid_.state().x; }
  std::span<const Vec3> velocities() const override { return solid_.state().v; }
  std::span<const Real> masses() const override { return solid_.mass(); }
  std::span<const std::uint8_t> held() const override { return solid_.held(); }
  const HungSurface& surface() const override { return surface_; }
  std::uint64_t surface_version() const override { return version_; }
  /// Nothing of it is met any more, as of cloth that is torn to its last triangle.
  void lose_surface() {
    surface_ = {};
    ++version_;
  }
  void predict(Real dt, std::vector<Vec3>& velocity, BlockMatrix& answer) override {
    solid_.load = owed_.as_forces(dt);
    solid_.predict(dt, velocity, answer);
  }
  void go(Real to, std::span<const Vec3> forces) override {
    solid_.load = owed_.as_forces(to - time_, forces);
    owed_.clear();
    given = Vec3::Zero();
    for (const Vec3& force : solid_.load) given += (to - time_) * force;
    const Real left = to - time_, count = std::max(1.0, std::ceil(left / longest_ - 1e-9));
    for (int k = 0; k < static_cast<int>(count); ++k) solid_.step(left / count);
    solid_.load.clear();
    time_ = to;
    ++steps;
  }
  void push(Index point, const Vec3& impulse) override {
    if (!held()[point]) owed_.add(point, impulse, solid_.nodes());
  }

  int steps = 0;
  Vec3 given = Vec3::Zero();  ///< by lava in the last step [N s]

 private:
  fem::ElasticSolid solid_;
  HungSurface surface_;
  OwedImpulses owed_;
  std::uint64_t version_ = 0;
  Real longest_, time_ = 0;
};

}  // namespace effuse::flow::sph
