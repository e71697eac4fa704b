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
  // The factor at which `layers` of them, on one wall or between two, let through so much.
  const auto factor_for = [&](std::size_t layers, bool channel, Real exact) {
    const int n = static_cast<int>(layers);
    Eigen::MatrixXd inside = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd wall = Eigen::VectorXd::Zero(n);
    for (int k = 0; k < n; ++k) {
      const auto drag = [&](Real d) { return d < table.support() ? table.at(d).drag_t / d * spacing * spacing : 0; };
      wall[k] = drag((k + 0.5) * spacing);
      if (channel) wall[k] += drag((n - k - 0.5) * spacing);
      for (int l = std::max(0, k - reach); l <= std::min(n - 1, k + reach); ++l) {
        if (l == k) continue;
        inside(k, k) += pair[static_cast<std::size_t>(std::abs(l - k))];
        inside(k, l) -= pair[static_cast<std::size_t>(std::abs(l - k))];
      }
    }
    // Flux falls as the factor grows: bisection.
    Real low = 0.1, high = 10;
    for (int iteration = 0; iteration < 60; ++iteration) {
      const Real f = std::sqrt(low * high);
      const Eigen::MatrixXd matrix = inside + Eigen::MatrixXd((f * wall).asDiagonal());
      const Real flux = matrix.partialPivLu().solve(Eigen::VectorXd::Ones(n)).sum();
      (flux > exact ? low : high) = f;
    }
    return std::sqrt(low * high);
  };
  for (std::size_t n = 1; n <= kFilmLayers; ++n) film_[n - 1] = factor_for(n, false, std::pow(static_cast<Real>(n), 3) / 3);
  for (std::size_t n = 1; n <= kChannelLayers; ++n) channel_[n - 1] = factor_for(n, true, std::pow(static_cast<Real>(n), 3) / 12);
}

}  // namespace effuse::flow::sph
