#include <gtest/gtest.h>

#include <cmath>

#include "flow/springs/builders.h"
#include "flow/springs/spring_system.h"

/// What springs say of their next step, and the step.
namespace effuse::flow::springs {
namespace {

/// A cube held at one face, damped.
SpringBody held_cube(Real stiffness) {
  SpringBody body = jello_cube(5, Vec3::Zero(), 1, 0.4, {stiffness, 0.002 * stiffness, 0});
  for (std::size_t i = 0; i < body.state.x.size(); ++i) body.network.held[i] = body.state.x[i].x() < 0.01;
  return body;
}

// Where forces are small the answer is the implicit step's own, for soft and stiff ones: what is left falls with the square of the force.
TEST(PredictedSprings, AreTheStepToFirstOrderOfTheForces) {
  for (const Real stiffness : {100.0, 1e6}) {
    Real before = 0;
    for (const Real share : {1.0, 0.5, 0.25}) {
      const SpringBody body = held_cube(stiffness);
      SpringSystem system(body.network);
      system.surroundings.gravity = Vec3(0, 0, -1e-3 * share * stiffness / 100);
      const Real dt = 0.05, force = 1e-3 * share * stiffness;
      std::vector<Vec3> velocity, impulse(body.network.size(), Vec3::Zero()), load(impulse), change(impulse);
      BlockMatrix answer;
      system.predict(dt, body.state, velocity, answer);
      for (std::size_t i = 0; i < load.size(); ++i) {
        if (body.state.x[i].x() < 0.99) continue;
        load[i] = Vec3(0, force, -force);
        impulse[i] = dt * load[i];
      }
      answer.solve(impulse, change);
      system.surroundings.load = load;
      SpringState stepped = body.state;
      system.implicit_euler(0, dt, stepped);
      Real worst = 0, most = 0;
      for (std::size_t i = 0; i < load.size(); ++i) {
        const Vec3 gone = (stepped.x[i] - body.state.x[i]) / dt;
        worst = std::max(worst, (velocity[i] + change[i] - gone).norm());
        most = std::max(most, gone.norm());
      }
      EXPECT_GT(most, 0);
      EXPECT_LT(worst, 0.05 * most) << stiffness << " " << share;
      EXPECT_TRUE(before == 0 || worst < 0.3 * before) << stiffness << " " << share << ": " << before << " -> " << worst;
      before = worst;
    }
  }
}

// Explicit steps, many in the time of one: they come to what was said, but for what implicit Euler dulls.
TEST(PredictedSprings, SayWhatManySmallStepsComeTo) {
  SpringBody body = held_cube(2000);
  SpringSystem system(body.network);
  const Real dt = 0.02;
  std::vector<Vec3> velocity;
  BlockMatrix answer;
  system.surroundings.load.assign(body.network.size(), Vec3(0, 0, -2));
  system.predict(dt, body.state, velocity, answer);
  SpringState state = body.state;
  StepStorage<SpringState> storage;
  for (int k = 0; k < 400; ++k) integrate_step(Scheme::kSymplecticEuler, system, 0, dt / 400, state, storage);
  Vec3 said = Vec3::Zero(), gone = Vec3::Zero();
  for (std::size_t i = 0; i < velocity.size(); ++i) {
    said += velocity[i];
    gone += (state.x[i] - body.state.x[i]) / dt;
  }
  EXPECT_GT(gone.norm(), 0);
  EXPECT_LT(said.norm(), 2.5 * gone.norm());
  EXPECT_GT(said.norm(), gone.norm() / 2.5);
  EXPECT_GT(said.dot(gone), 0.95 * said.norm() * gone.norm());
}

TEST(PredictedSprings, HeldPointsGoWithTheirOwnVelocityAndTheMatrixIsNoLessThanTheMass) {
  SpringBody body = held_cube(500);
  SpringSystem system(body.network);
  for (std::size_t i = 0; i < body.state.v.size(); ++i)
    if (body.network.held[i]) body.state.v[i] = Vec3(0.1, 0, 0.2);
  std::vector<Vec3> velocity, in, out(body.network.size());
  BlockMatrix answer;
  system.predict(0.02, body.state, velocity, answer);
  for (std::size_t i = 0; i < velocity.size(); ++i) {
    EXPECT_TRUE(!body.network.held[i] || velocity[i] == Vec3(0.1, 0, 0.2));
    in.push_back(body.network.held[i] ? Vec3(Vec3::Zero()) : Vec3(std::sin(3.0 * static_cast<Real>(i)), std::cos(7.0 * static_cast<Real>(i)), 0.3));
  }
  answer.multiply(in, out);
  Real energy = 0, kinetic = 0;
  for (std::size_t i = 0; i < in.size(); ++i) {
    energy += in[i].dot(out[i]);
    kinetic += body.network.mass[i] * in[i].squaredNorm();
  }
  EXPECT_GT(energy, kinetic);
}

}  // namespace
}  // namespace effuse::flow::springs
