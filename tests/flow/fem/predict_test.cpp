#include <gtest/gtest.h>

#include <cmath>

#include "flow/fem/elastic_solid.h"

/// What a solid says of its next step, and the step.
namespace effuse::flow::fem {
namespace {

ElasticSolid beam(Real youngs_modulus) {
  ElasticSolid solid(box_of_tets(Vec3::Zero(), Vec3(1, 0.3, 0.3), 6, 2, 2), {youngs_modulus, 0.3, 1000, 0.01, 0});
  for (std::size_t i = 0; i < solid.nodes(); ++i)
    if (solid.state().x[i].x() < 0.01) solid.held()[i] = 1;
  return solid;
}

// Where forces are small the answer is the step's own, for soft and stiff ones: what is left falls with the square of the force.
TEST(PredictedStep, IsTheStepToFirstOrderOfTheForces) {
  for (const Real youngs : {1e4, 1e9}) {
    Real before = 0;
    for (const Real share : {1.0, 0.5, 0.25}) {
      const Real force = 2e-3 * share * youngs / 1e4;
      ElasticSolid predicted = beam(youngs), stepped = beam(youngs);
      for (ElasticSolid* each : {&predicted, &stepped}) each->gravity = Vec3(0, 0, -1e-3 * share);
      const Real dt = 0.05;
      std::vector<Vec3> velocity, change(predicted.nodes());
      BlockMatrix answer;
      predicted.predict(dt, velocity, answer);
      stepped.load.assign(stepped.nodes(), Vec3::Zero());
      std::vector<Vec3> impulse(stepped.nodes(), Vec3::Zero());
      for (std::size_t i = 0; i < stepped.nodes(); ++i) {
        if (stepped.state().x[i].x() < 0.99) continue;
        stepped.load[i] = Vec3(0, force, -force);
        impulse[i] = dt * stepped.load[i];
      }
      answer.solve(impulse, change);
      const std::vector<Vec3> start = stepped.state().x;
      stepped.step(dt);
      Real worst = 0, most = 0;
      for (std::size_t i = 0; i < start.size(); ++i) {
        const Vec3 gone = (stepped.state().x[i] - start[i]) / dt;
        worst = std::max(worst, (velocity[i] + change[i] - gone).norm());
        most = std::max(most, gone.norm());
      }
      EXPECT_LT(worst, 0.05 * most) << youngs << " " << share;
      EXPECT_GT(most, 0);
      EXPECT_TRUE(before == 0 || worst < 0.3 * before) << youngs << " " << share << ": " << before << " -> " << worst;
      before = worst;
    }
  }
}

TEST(PredictedStep, HeldNodesGoWithTheirOwnVelocityAndTheMatrixIsNoLessThanTheMass) {
  ElasticSolid solid = beam(1e5);
  for (std::size_t i = 0; i < solid.nodes(); ++i)
    if (solid.held()[i]) solid.state().v[i] = Vec3(0.1, 0, 0.2);
  std::vector<Vec3> velocity, out(solid.nodes());
  BlockMatrix answer;
  solid.predict(0.02, velocity, answer);
  std::vector<Vec3> in;
  for (std::size_t i = 0; i < solid.nodes(); ++i) {
    EXPECT_TRUE(!solid.held()[i] || velocity[i] == Vec3(0.1, 0, 0.2));
    in.push_back(solid.held()[i] ? Vec3(Vec3::Zero()) : Vec3(std::sin(3.0 * static_cast<Real>(i)), std::cos(7.0 * static_cast<Real>(i)), 0.3));
  }
  answer.multiply(in, out);
  Real energy = 0, kinetic = 0;
  for (std::size_t i = 0; i < in.size(); ++i) {
    energy += in[i].dot(out[i]);
    kinetic += solid.mass()[i] * in[i].squaredNorm();
  }
  EXPECT_GT(energy, kinetic);
  std::vector<Vec3> back(in.size());
  answer.solve(out, back);
  for (std::size_t i = 0; i < in.size(); ++i) EXPECT_LT((back[i] - in[i]).norm(), 1e-9);
}

}  // namespace
}  // namespace effuse::flow::fem
