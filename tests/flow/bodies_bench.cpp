#include <benchmark/benchmark.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <vector>

#include "flow/bodies/rigid_bodies.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "tests/geometry/terrain/fields.h"

/// 1,000 boulders (boxes of 1 to 3 m edges) dropped on Maunga Whau, and a step of it beside Bullet's on the same scene: same
/// bodies, same triangles (split alike), same friction, 1/120 s a step, one thread, without sleeping, from the
/// drop on. `deepest` is the furthest any corner of a box lies under the ground at the end, in metres, by the same measure for both.
namespace effuse::flow::bodies {
namespace {

constexpr std::size_t kBodies = 1000;
constexpr Real kDensity = 2600, kFriction = 0.6, kStep = 1.0 / 120;
constexpr int kSteps = 600;  // 5 s

struct Boulder {
  Vec3 half, x;
  Quat q;
};

std::vector<Boulder> boulders(const geometry::HeightField& field) {
  std::vector<Boulder> all;
  for (std::size_t k = 0; k < kBodies; ++k) {
    const auto random = [&](std::uint64_t stream) { return random_uniform(20, stream, k); };
    Boulder b;
    b.half = Vec3(0.5 + random(0), 0.5 + random(1), 0.5 + random(2));
    // On a lattice over the crater, so that none begins inside another.
    const Real x = 200 + 6.0 * static_cast<Real>(k % 32), y = 300 + 6.0 * static_cast<Real>(k / 32);
    b.x = Vec3(x, y, field.height(x, y) + 4 + 10 * random(3));
    b.q = Quat(random(4) - 0.5, random(5) - 0.5, random(6) - 0.5, random(7) - 0.5).normalized();
    all.push_back(b);
  }
  return all;
}

/// Furthest below the bilinear ground that a corner of any box lies.
class Depth {
 public:
  explicit Depth(const geometry::Terrain& terrain) : terrain_(terrain) {}
  void see(const Vec3& half, const Vec3& x, const Mat3& R) {
    for (int k = 0; k < 8; ++k) {
      const Vec3 corner((k & 1 ? 1 : -1) * half.x(), (k & 2 ? 1 : -1) * half.y(), (k & 4 ? 1 : -1) * half.z());
      deepest_ = std::max(deepest_, -terrain_.signed_distance(x + R * corner));
    }
  }
  Real deepest() const { return deepest_; }

 private:
  const geometry::Terrain& terrain_;
  Real deepest_ = 0;
};

void effuse_boulders(benchmark::State& state) {
  const ThreadLimit threads(static_cast<int>(state.range(0)));
  const geometry::HeightField field = geometry::fields::maunga_whau();
  const geometry::Terrain terrain = geometry::Terrain::from_height_field(field);
  const std::vector<Boulder> all = boulders(field);
  StateHash hash;
  Depth depth(terrain);
  std::size_t contacts = 0;
  Real worst = 0, seconds = 0;
  for (auto _ : state) {
    BodyOptions options;
    options.sleep_speed = 0;
    options.terrain_friction = kFriction;
    RigidBodies world(options, terrain);
    for (const Boulder& b : all) world.add(Shape::box(b.half), kDensity, {b.x, b.q}, {kFriction, 0, 0});
    for (int k = 0; k < kSteps; ++k) {
      const auto begin = std::chrono::steady_clock::now();
      contacts = world.step(kStep).contacts;
      const Real took = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      worst = std::max(worst, took);
      seconds += took;
    }
    hash = {};
    world.add_to(hash);
    for (BodyId i = 0; i < kBodies; ++i) depth.see(all[i].half, world.centres()[i], world.orientations()[i].toRotationMatrix());
  }
  state.SetLabel(hash.hex());
  state.counters["ms_a_step"] = seconds / kSteps * 1e3;
  state.counters["worst_ms"] = worst * 1e3;
  state.counters["contacts"] = static_cast<double>(contacts);
  state.counters["deepest"] = depth.deepest();
}
BENCHMARK(effuse_boulders)->Arg(1)->Arg(2)->Unit(benchmark::kSecond)->Iterations(1);

btVector3 bt(const Vec3& v) { return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())}; }

void bullet_boulders(benchmark::State& state) {
  const geometry::HeightField field = geometry::fields::maunga_whau();
  const geometry::Terrain terrain = geometry::Terrain::from_height_field(field);
  const geometry::TriMesh mesh = field.mesh();
  const std::vector<Boulder> all = boulders(field);
  Depth depth(terrain);
  std::size_t contacts = 0;
  Real seconds = 0;
  for (auto _ : state) {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broad;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world(&dispatcher, &broad, &solver, &configuration);
    world.setGravity(btVector3(0, 0, static_cast<btScalar>(-kGravity)));
    btTriangleMesh triangles;
    for (const geometry::Triangle& t : mesh.triangles) triangles.addTriangle(bt(mesh.positions[t[0]]), bt(mesh.positions[t[1]]), bt(mesh.positions[t[2]]));
    btBvhTriangleMeshShape ground_shape(&triangles, true);
    std::vector<std::unique_ptr<btCollisionShape>> shapes;
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    const auto add = [&](btCollisionShape* shape, Real mass, const btTransform& at) {
      btVector3 inertia(0, 0, 0);
      if (mass > 0) shape->calculateLocalInertia(static_cast<btScalar>(mass), inertia);
      bodies.push_back(std::make_unique<btRigidBody>(static_cast<btScalar>(mass), nullptr, shape, inertia));
      bodies.back()->setWorldTransform(at);
      bodies.back()->setInterpolationWorldTransform(at);
      bodies.back()->setFriction(static_cast<btScalar>(std::sqrt(kFriction * kFriction)));
      bodies.back()->setActivationState(DISABLE_DEACTIVATION);
      world.addRigidBody(bodies.back().get());
    };
    add(&ground_shape, 0, btTransform::getIdentity());
    bodies.back()->setFriction(1);  // Bullet multiplies the two
    for (const Boulder& b : all) {
      shapes.push_back(std::make_unique<btBoxShape>(bt(b.half)));
      const btQuaternion q(static_cast<btScalar>(b.q.x()), static_cast<btScalar>(b.q.y()), static_cast<btScalar>(b.q.z()), static_cast<btScalar>(b.q.w()));
      add(shapes.back().get(), kDensity * 8 * b.half.prod(), btTransform(q, bt(b.x)));
    }
    const auto begin = std::chrono::steady_clock::now();
    for (int k = 0; k < kSteps; ++k) world.stepSimulation(static_cast<btScalar>(kStep), 0);
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    contacts = 0;
    for (int k = 0; k < dispatcher.getNumManifolds(); ++k) contacts += static_cast<std::size_t>(dispatcher.getManifoldByIndexInternal(k)->getNumContacts());
    for (std::size_t i = 0; i < kBodies; ++i) {
      const btTransform& at = bodies[i + 1]->getWorldTransform();
      Mat3 R;
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) R(r, c) = at.getBasis()[r][c];
      depth.see(all[i].half, Vec3(at.getOrigin().x(), at.getOrigin().y(), at.getOrigin().z()), R);
    }
    for (auto& body : bodies) world.removeRigidBody(body.get());
  }
  state.counters["ms_a_step"] = seconds / kSteps * 1e3;
  state.counters["contacts"] = static_cast<double>(contacts);
  state.counters["deepest"] = depth.deepest();
}
BENCHMARK(bullet_boulders)->Unit(benchmark::kSecond)->Iterations(1);

}  // namespace
}  // namespace effuse::flow::bodies
