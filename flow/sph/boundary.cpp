#include "flow/sph/boundary.h"

#include <Eigen/LU>

namespace effuse::flow::sph {

FilmFriction::FilmFriction(const BoundaryTable& table, Real spacing) : spacing_(spacing) {
  const ViscousWeight weight(table.support());
  const int reach = static_cast<int>(table.support() / spacing) + 1;
  // In units of spacing, nu and g sin(theta): pair coefficient between layers m apart, V sum w x^2 over the layer.
  std::vector<Real> pair(static_cast<std::size_t>(reach) + 1, 0.0);
  for (int m = 1; m <= reach; ++m) {
    for (int a = -reach; a <= reach; ++a) {
      for (int b = -reach; b <= reach; ++b) {
        const Real r2 = (a * a + b * b + m * m) * spacing * spacing;
        if (r2 < table.support() * table.support()) pair[static_cast<std::size_t>(m)] += weight(r2) * a * a * std::pow(spacing, 7);
      }
    }
  }
  for (std::size_t layers = 1; layers <= kLayers; ++layers) {
    const int n = static_cast<int>(layers);
    Eigen::MatrixXd inside = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd wall(n);
    for (int k = 0; k < n; ++k) {
      const Real d = (k + 0.5) * spacing;
      wall[k] = d < table.support() ? table.at(d).drag_t / d * spacing * spacing : 0;
      for (int l = std::max(0, k - reach); l <= std::min(n - 1, k + reach); ++l) {
        if (l == k) continue;
        inside(k, k) += pair[static_cast<std::size_t>(std::abs(l - k))];
        inside(k, l) -= pair[static_cast<std::size_t>(std::abs(l - k))];
      }
    }
    // Flux falls as the factor grows: bisection.
    const Real exact = std::pow(static_cast<Real>(n), 3) / 3;
    Real low = 0.1, high = 10;
    for (int iteration = 0; iteration < 60; ++iteration) {
      const Real f = std::sqrt(low * high);
      const Eigen::MatrixXd matrix = inside + Eigen::MatrixXd((f * wall).asDiagonal());
      const Real flux = matrix.partialPivLu().solve(Eigen::VectorXd::Ones(n)).sum();
      (flux > exact ? low : high) = f;
    }
    factor_[layers - 1] = std::sqrt(low * high);
  }
}

}  // namespace effuse::flow::sph
