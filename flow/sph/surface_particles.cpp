#include "flow/sph/surface_particles.h"

#include <Eigen/Eigenvalues>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

void find_surface(std::span<const Vec3> x, const Neighbors& neighbors, Real support, const SurfaceCriteria& criteria, std::span<std::uint8_t> surface,
                  std::span<Vec3> outward) {
  ZONE("sph.surface");
  CHECK_EQ(neighbors.size(), x.size());
  CHECK_EQ(surface.size(), x.size());
  CHECK_EQ(outward.size(), x.size());

  parallel_for(x.size(), [&](std::size_t i) {
    const auto near = neighbors[i];
    // Centre of mass of the neighbours, relative to i. Neighbours at the rim of the support weigh
    // less, so that one that enters or leaves does not turn the direction at once.
    Vec3 center = Vec3::Zero();
    for (const Index j : near) {
      const Vec3 d = x[j] - x[i];
      center += (support - d.norm()) * d;
    }
    const Real length = center.norm();
    // Neighbours all around cancel: inside, or in the middle of a sheet, there is no direction.
    const bool lopsided = length > 1e-3 * support * support;
    const Vec3 inward = lopsided ? Vec3(center / length) : Vec3(Vec3::Zero());

    // Mass on the outer side of the plane through i, with a margin of 5 % of the support: a layer of
    // neighbours in the plane itself belongs to neither side.
    std::size_t outer = 0;
    for (const Index j : near) outer += (x[j] - x[i]).dot(inward) < -0.05 * support;
    const Real quotient = near.empty() ? 0 : static_cast<Real>(outer) / static_cast<Real>(near.size());
    bool on_surface = near.size() < criteria.min_neighbors || (lopsided && quotient < criteria.mass_quotient);

    if (!on_surface) {
      Mat3 covariance = Mat3::Zero();
      Vec3 mean = Vec3::Zero();
      for (const Index j : near) mean += x[j] - x[i];
      mean /= static_cast<Real>(near.size() + 1);
      for (const Index j : near) {
        const Vec3 d = x[j] - x[i] - mean;
        covariance.noalias() += d * d.transpose();
      }
      covariance.noalias() += mean * mean.transpose();
      const Vec3 eigenvalues = Eigen::SelfAdjointEigenSolver<Mat3>().computeDirect(covariance, Eigen::EigenvaluesOnly).eigenvalues();
      on_surface = eigenvalues.x() < criteria.coplanarity * eigenvalues.z();
    }
    surface[i] = on_surface;
    outward[i] = -inward;
  });
}

}  // namespace effuse::flow::sph
