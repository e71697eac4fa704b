#include "flow/springs/spring_network.h"

#include "geometry/base/parallel.h"

namespace effuse::flow::springs {

Real kinetic_energy(const SpringNetwork& network, const SpringState& state) {
  return parallel_sum(network.size(), 0.0, [&](std::size_t i) { return network.held[i] ? 0 : network.mass[i] * state.v[i].squaredNorm() / 2; });
}

Real spring_energy(const SpringNetwork& network, const SpringState& state) {
  return parallel_sum(network.springs.size(), 0.0, [&](std::size_t s) {
    const Spring& spring = network.springs[s];
    const Real stretch = (state.x[spring.a] - state.x[spring.b]).norm() - spring.rest;
    return network.materials[spring.material].stiffness * stretch * stretch / 2;
  });
}

}  // namespace effuse::flow::springs
