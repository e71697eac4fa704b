#include "flow/effects/met_things.h"

#include <gtest/gtest.h>

#include "geometry/collide/collision_mesh.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/effects/effect_scene.h"

/// Effects that meet rigid bodies which another effect moves.
namespace effuse::flow {
namespace {

/// A box that flies through the scene, for 17 frames until it meets the ground; half of its edges.
const std::string kBox = "[[body]]\nbox = [2, 2, 1]\nposition = [-4, 0, 3]\nvelocity = [4, 0, 0]\ndensity = 2000\n";
const Vec3 kHalf(1, 1, 0.5);

TEST(MetThings, BodiesMoveBesideEffectsOtherThanLavaAndBeforeThem) {
  EffectScene scene(kBox + "[[particles]]\n[[particles.emitter]]\nat = [9, 9, 5]\nrate = 1\n");
  ASSERT_EQ(scene.simulation->effects().size(), 2u);
  EXPECT_EQ(scene.simulation->effects()[0]->name(), "bodies");
  scene.frames(12);
  EXPECT_NEAR(scene.effect("bodies").body_poses()[0].position.x(), -2, 1e-6);
}

TEST(MetThings, AreWhereTheirEffectHasThemAtAnyMomentOfItsFrame) {
  EffectScene scene(kBox + "[[particles]]\n[[particles.emitter]]\nat = [9, 9, 5]\nrate = 1\n");
  const World world{&scene.terrain, 1, &scene.obstacles, &scene.bodies};
  MetThings things(world);
  std::vector<Effect*> others;
  for (const auto& effect : scene.simulation->effects()) others.push_back(effect.get());
  things.meet(others);
  const auto middle = [&] { return Vec3(things.obstacles().bounds().center()); };
  things.move(0, 0);
  EXPECT_NEAR(middle().x(), -4, 1e-9);
  for (int frame = 1; frame <= 5; ++frame) {
    scene.frames(1);
    const Real begin = (frame - 1) / 24.0;
    for (const Real u : {0.25, 0.5, 1.0}) {
      things.move(begin + (u - 0.25) / 24, 0.25 / 24);
      EXPECT_NEAR(middle().x(), -4 + 4 * (begin + u / 24), 1e-3) << frame << " " << u;
    }
  }
  // As a contact tells it.
  geometry::Contact c;
  EXPECT_EQ(things.obstacles().contacts(middle() + Vec3(1.1, 0, 0), 1, std::span(&c, 1)), 1);
  EXPECT_NEAR(c.surface_velocity.x(), 4, 0.01);
  EXPECT_NEAR(c.distance, 0.1, 1e-6);
}

TEST(MetThings, NoParticleIsInABodyThatFliesThroughThem) {
  EffectScene scene(kBox + "[[particles]]\npreset = \"sand\"\n[[particles.emitter]]\nfrom = \"disk\"\nat = [-2, 0, 5]\nradius = 2\ndirection = [0, 0, -1]\nspeed = 8\nrate = 1000\nlifetime = 100\n");
  std::size_t on_top = 0;
  for (int frame = 0; frame < 16; ++frame) {
    scene.frames(1);
    const geometry::RigidPose pose = scene.effect("bodies").body_poses()[0];
    const NamedCloud cloud = scene.effect("sand").clouds()[0];
    for (std::size_t i = 0; i < cloud.x.size(); ++i) {
      const Vec3 off = (pose.orientation.conjugate() * (cloud.x[i] - pose.position)).cwiseAbs() - kHalf;
      EXPECT_GT(off.maxCoeff(), -1e-3) << frame;
      on_top += off.x() < 0 && off.y() < 0 && std::abs(off.z()) < 0.05;
    }
  }
  EXPECT_GT(on_top, 50u);
}

TEST(MetThings, ABodyPushesJellyAndAnElasticBox) {
  for (const std::string soft : {"[[springs]]\nname = \"soft\"\nposition = [0, 0, 3]\nsize = 1\npoints = 5\ndensity = 100\nstiffness = 2000\ndamping = 5\ncontact_stiffness = 20000\ncontact_damping = 20\n",
                                 "[[elastic]]\nname = \"soft\"\nbox = [1, 1, 1]\nspacing = 0.5\nposition = [0, 0, 3]\nyoungs_modulus = 1e5\ndensity = 200\n"}) {
    EffectScene scene(kBox + soft);
    scene.frames(17);  // both fall; the box's front, at -0.17 m now, met the other's back, at -0.5 m, two frames ago
    const Real front = scene.effect("bodies").body_poses()[0].position.x() + 1;
    ASSERT_NEAR(front, -3 + 4 * 17 / 24.0, 1e-6);
    Real sum = 0, count = 0;
    const std::vector<NamedMesh> meshes = scene.effect("soft").meshes();
    for (const Vec3& x : meshes.at(0).mesh.positions) {
      EXPECT_GT(x.x(), front - 0.2) << soft;  // contacts are springs: as deep as four metres a second drive them
      sum += x.x(), ++count;
    }
    EXPECT_GT(sum / count, 0.1) << soft;
  }
}

TEST(MetThings, GoesOnToTheSameBitsFromTheMidstOfAFrame) {
  const std::string text = kBox + "[[particles]]\npreset = \"sand\"\n[[particles.emitter]]\nfrom = \"disk\"\nat = [-2, 0, 2]\nradius = 2\nrate = 300\n";
  EffectScene whole(text), half(text);
  for (EffectScene* each : {&whole, &half}) each->frames(20);
  // Bodies have their frame behind them, particles have not.
  int steps = 0;
  half.simulation->advance([&] { return ++steps < 6; });
  EffectScene again(text);
  again.simulation->restore(half.simulation->checkpoint("key"), "key", "file");
  for (EffectScene* each : {&whole, &again}) each->frames(3);
  EXPECT_EQ(whole.simulation->state_hash(), again.simulation->state_hash());
}

/// A wall that a ram breaks in the sixth frame.
const std::string kWall =
    "[[body]]\nname = \"wall\"\nbox = [0.4, 3, 2]\nposition = [0, 0, 1]\ndensity = 2000\nstrength = 1e5\ncells = 12\n"
    "[[body]]\nname = \"ram\"\nbox = [1, 1, 1]\nposition = [-2.5, 0, 1]\nvelocity = [10, 0, 0]\ndensity = 2700\n";
const std::string kRain = "[[particles]]\npreset = \"sand\"\n[[particles.emitter]]\nfrom = \"disk\"\nat = [0.8, 0, 2.6]\nradius = 1.5\ndirection = [0, 0, -1]\nspeed = 8\nrate = 1500\nlifetime = 100\n";

TEST(MetThings, NoParticleIsInABodyNorInWhatIsLeftOfIt) {
  EffectScene scene(kWall + kRain);
  std::size_t beside_whole = 0, beside_pieces = 0, inside = 0;
  for (int frame = 0; frame < 12; ++frame) {
    scene.frames(1);
    const std::vector<SolidPiece> pieces = scene.effect("bodies").pieces();
    const NamedCloud cloud = scene.effect("sand").clouds()[0];
    for (const SolidPiece& piece : pieces) {
      const geometry::CollisionMesh mesh(*piece.mesh);
      for (const Vec3& x : cloud.x) {
        const auto near = mesh.nearest(piece.pose.orientation.conjugate() * (x - piece.pose.position), 0.05);
        if (!near) continue;
        ++(pieces.size() > 1 ? beside_pieces : beside_whole);
        if (near->distance < -0.01) ++inside;  // as far as a piece's straight way through a frame may lie beside its own
      }
    }
  }
  EXPECT_GT(scene.figure("bodies", "pieces"), 3);
  EXPECT_GT(beside_whole, 30u);
  EXPECT_GT(beside_pieces, 100u);
  EXPECT_EQ(inside, 0u);
}

TEST(MetThings, PiecesGoOnToTheSameBits) {
  EffectScene whole(kWall + kRain), half(kWall + kRain);
  for (EffectScene* each : {&whole, &half}) each->frames(5);
  // In the frame that breaks the wall: bodies have it behind them, particles have not.
  int steps = 0;
  half.simulation->advance([&] { return ++steps < 6; });
  ASSERT_GT(half.figure("bodies", "pieces"), 1);
  EffectScene again(kWall + kRain);
  again.simulation->restore(half.simulation->checkpoint("key"), "key", "file");
  for (EffectScene* each : {&whole, &again}) each->frames(2);
  EXPECT_EQ(whole.simulation->state_hash(), again.simulation->state_hash());
  EXPECT_TRUE(resumes(kWall + kRain, 7, 1));
}

/// Makes blocks of crust, as lava does: the first at 1 s, another at 2 s, the first is gone at 3 s.
class BlockMaker final : public Effect {
 public:
  std::string_view name() const override { return "maker"; }
  Real time() const override { return time_; }
  void step(Real t_end) override { time_ = t_end; }
  bool makes_pieces() const override { return true; }
  std::vector<SolidPiece> pieces() const override {
    std::vector<SolidPiece> all;
    const auto cube = std::make_shared<const geometry::TriMesh>(geometry::make_box(Vec3(-0.5, -0.5, -0.5), Vec3(0.5, 0.5, 0.5)));
    if (time_ >= 1 && time_ < 3) all.push_back({4, SolidPiece::kNoBody, cube, {Vec3(time_, 0, 0)}, 900});
    if (time_ >= 2) all.push_back({7, SolidPiece::kNoBody, cube, {Vec3(0, 5, -time_)}, 900});
    return all;
  }
  std::size_t memory() const override { return 0; }
  void add_to(StateHash&) const override {}
  void save(StateWriter&) const override {}
  void load(StateReader&) override {}
  std::vector<std::pair<std::string, double>> figures() const override { return {}; }
  std::string status() const override { return ""; }

 private:
  Real time_ = 0;
};

TEST(MetThings, BlocksOfCrustAreMetWhileTheyAreThere) {
  BlockMaker maker;
  MetThings things(World{});
  EXPECT_TRUE(things.empty());
  things.meet({&maker});
  EXPECT_FALSE(things.empty()) << "some may come";
  things.move(0, 0.1);
  EXPECT_EQ(things.obstacles().bounds().isEmpty(), true);
  const auto contact = [](const MetThings& of, const Vec3& x) {
    geometry::Contact c;
    return of.obstacles().contacts(x, 0.2, std::span(&c, 1)) > 0 ? c : geometry::Contact{};
  };

  maker.step(1);
  things.move(0.5, 0.1);
  EXPECT_NEAR(contact(things, Vec3(1, 0, 0.6)).distance, 0.1, 1e-12) << "it comes where it is";
  EXPECT_EQ(contact(things, Vec3(1, 0, 0.6)).surface_velocity, Vec3::Zero());
  EXPECT_EQ(contact(things, Vec3(1, 0, 0.6)).surface_temperature, 900);

  // It goes through the frame from where it was; the other has just come.
  maker.step(2);
  things.move(1.25, 0.25);
  EXPECT_NEAR(contact(things, Vec3(1.5, 0, 0.6)).distance, 0.1, 1e-9);
  EXPECT_NEAR(contact(things, Vec3(1.5, 0, 0.6)).surface_velocity.x(), 1, 1e-9);
  EXPECT_TRUE(contact(things, Vec3(0, 5, -1.4)).any());
  std::vector<PlaneContact> planes;
  things.add_planes(nullptr, std::vector<Vec3>{Vec3(1.5, 0, 0.55), Vec3(20, 0, 0)}, 0.2, 0, planes);
  ASSERT_EQ(planes.size(), 1u);
  EXPECT_NEAR(planes[0].velocity.x(), 1, 1e-9);

  // A checkpoint between: the same contacts.
  StateWriter out;
  things.save(out);
  MetThings again(World{});
  again.meet({&maker});
  StateReader in(out.bytes(), "");
  again.load(in);
  for (MetThings* each : {&things, &again}) each->move(1.5, 0.5);
  for (const Vec3& x : {Vec3(2, 0, 0.6), Vec3(0, 5, -1.4)}) {
    EXPECT_TRUE(contact(again, x).any());
    EXPECT_EQ(contact(things, x).distance, contact(again, x).distance);
    EXPECT_EQ(contact(things, x).surface_velocity, contact(again, x).surface_velocity);
  }

  maker.step(3);
  things.move(2.5, 0.5);
  EXPECT_FALSE(contact(things, Vec3(3, 0, 0.6)).any()) << "gone";
  EXPECT_NEAR(contact(things, Vec3(0, 5, -2.4)).distance, 0.1, 1e-9);
}

}  // namespace
}  // namespace effuse::flow
