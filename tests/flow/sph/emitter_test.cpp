#include "flow/sph/emitter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "geometry/base/parallel.h"
#include "geometry/base/state_io.h"
#include "geometry/terrain/terrain.h"

namespace effuse::flow::sph {
namespace {

using geometry::Contact;

const ContactSource kFloor = [](std::span<const Vec3> x, Real reach, std::span<Contact> out) {
  for (std::size_t i = 0; i < x.size(); ++i) out[i] = x[i].z() < reach ? Contact{Vec3(x[i].x(), x[i].y(), 0), Vec3::UnitZ(), x[i].z(), Vec3::Zero(), 0, 0} : Contact{};
};

/// A fissure with ramps and a crater that opens later.
std::vector<Vent> two_vents() {
  Vent fissure, crater;
  fissure.to = Vec3(6, 0, 0);
  fissure.width = 2;
  fissure.rate = 9;
  fissure.temperature = 1450;
  fissure.stop = 4;
  fissure.ramp = 1;
  crater.from = crater.to = Vec3(30, 0, 0);
  crater.width = 4;
  crater.rate = 20;
  crater.temperature = 1400;
  crater.start = 1.3;
  return {fissure, crater};
}

/// Irregular moments from 0 to 6 s, none of them a round number but the last.
std::vector<Real> moments(int seed) {
  std::vector<Real> t = {0};
  while (t.back() < 6) t.push_back(t.back() + 0.01 + 0.1 * std::abs(std::sin(3.7 * static_cast<Real>(t.size()) + seed)));
  t.back() = 6;
  return t;
}

TEST(Emitter, LetsOutTheSameParticlesWhateverTheStepsWere) {
  const std::vector<Vent> vents = two_vents();
  const Real dx = 0.5, one = dx * dx * dx;
  std::vector<std::vector<int>> counts;
  for (const int seed : {1, 2}) {
    Emitter emitter(vents, dx, 7, std::vector<ContactSource>{kFloor});
    std::vector<int> count(emitter.sites().size());
    const std::vector<Real> t = moments(seed);
    for (std::size_t k = 0; k + 1 < t.size(); ++k) {
      for (const Emitter::Newborn& p : emitter.emit(t[k], t[k + 1])) ++count[p.site];
      // At every moment each site has let out what the formula says, and the vents their volume but a particle a site.
      std::vector<Real> volume(vents.size()), sites(vents.size());
      for (std::size_t s = 0; s < count.size(); ++s) {
        const Emitter::Site& site = emitter.sites()[s];
        const Real risen = vents[site.vent].volume(t[k + 1]) / site.share + site.phase;
        ASSERT_EQ(count[s], static_cast<int>(std::floor(risen))) << "site " << s << " at " << t[k + 1] << " s";
        volume[site.vent] += one * count[s];
        sites[site.vent] += 1;
      }
      for (std::size_t v = 0; v < vents.size(); ++v) ASSERT_NEAR(volume[v], vents[v].volume(t[k + 1]), one * sites[v]) << v;
    }
    counts.push_back(count);
    std::size_t all = 0;
    for (const int c : count) all += static_cast<std::size_t>(c);
    EXPECT_EQ(emitter.size(), all);
    EXPECT_NEAR(static_cast<Real>(all) * one, 27 + 94, 0.01 * 121) << "phases are spread: the sum is far better than a particle a site";
  }
  EXPECT_EQ(counts[0], counts[1]);
}

TEST(Emitter, CarriesEachUpItsSpacingAtTheVentsSpeedAndLetsGo) {
  const std::vector<Vent> vents = two_vents();
  const Real dx = 0.5;
  Emitter emitter(vents, dx, 7, std::vector<ContactSource>{kFloor});
  std::vector<Vec3> x, v;
  std::vector<Index> site;
  std::vector<Real> freed_at;  // height
  const std::vector<Real> t = moments(3);
  std::size_t freed = 0, held = 0;
  for (std::size_t k = 0; k + 1 < t.size(); ++k) {
    const Real dt = t[k + 1] - t[k];
    std::vector<std::uint8_t> was_held;
    for (std::size_t i = 0; i < x.size(); ++i) was_held.push_back(emitter.held(i));
    emitter.carry(t[k], dt, v);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Emitter::Site& from = emitter.sites()[site[i]];
      const Vent& vent = vents[from.vent];
      if (emitter.held(i)) {
        const Real speed = (vent.volume(t[k + 1]) - vent.volume(t[k])) / dt / (from.share / (dx * dx * dx)) / (dx * dx);
        ASSERT_NEAR((v[i] - speed * from.up).norm(), 0, 1e-9) << "rate over area";
        ASSERT_LT(x[i].z(), dx + 1e-9);
        x[i] += dt * v[i];
        ++held;
      } else if (was_held[i]) {
        ++freed;
        if (t[k] < vent.stop) {
          EXPECT_GE(x[i].z(), dx - 1e-9) << "not before it has risen a spacing";
          EXPECT_LE(x[i].z(), dx + 20.0 / 13 / (dx * dx) * 0.11) << "nor much later";  // the crater's speed, the longest step
        }
        v[i] = Vec3(100, 0, 0);
      } else {
        ASSERT_EQ(v[i], Vec3(100, 0, 0)) << "a free particle's speed is its own";
      }
    }
    for (const Emitter::Newborn& p : emitter.emit(t[k], t[k + 1])) {
      const Emitter::Site& from = emitter.sites()[p.site];
      EXPECT_GE(p.x.z(), 0) << "above the ground";
      EXPECT_EQ((p.x - from.at).head<2>().norm(), 0);
      EXPECT_EQ(p.temperature, vents[from.vent].temperature);
      x.push_back(p.x);
      v.push_back(p.v);
      site.push_back(p.site);
    }
    // Each carried particle is where the vent's volume says, and a whole spacing above the next.
    std::map<Index, Real> last;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (!emitter.held(i)) continue;
      if (last.contains(site[i])) {
        EXPECT_NEAR(last[site[i]] - x[i].z(), dx, 1e-9);
      }
      last[site[i]] = x[i].z();
      const Emitter::Site& from = emitter.sites()[site[i]];
      const Real risen = vents[from.vent].volume(t[k + 1]) / from.share + from.phase;
      const Real cycle = x[i].z() / dx - risen;
      EXPECT_NEAR(cycle, std::round(cycle), 1e-9);
    }
  }
  ASSERT_GT(freed, 300u);
  ASSERT_GT(held, 300u);
  for (std::size_t i = 0; i < x.size(); ++i)
    EXPECT_FALSE(emitter.held(i) && emitter.sites()[site[i]].vent == 0) << "a closed vent holds nobody";
}

TEST(Emitter, CarryMayBeAskedAgainWithAShorterStep) {
  Emitter emitter(two_vents(), 0.5, 7, std::vector<ContactSource>{kFloor});
  std::vector<Vec3> v;
  for (const Emitter::Newborn& p : emitter.emit(0, 0.9)) v.push_back(p.v);
  ASSERT_GT(v.size(), 5u);
  std::vector<Vec3> once = v, twice = v;
  Emitter other = emitter;
  emitter.carry(0.9, 0.05, once);
  other.carry(0.9, 0.1, twice);
  EXPECT_GT(twice[0].z(), once[0].z()) << "it is ramping up";
  other.carry(0.9, 0.05, twice);
  EXPECT_EQ(twice, once);
  for (std::size_t i = 0; i < v.size(); ++i) EXPECT_EQ(emitter.held(i), other.held(i));
}

TEST(Emitter, SitesLieOnRoughGroundAndKeepTheVentsHeightWhereThereIsNone) {
  const int n = 20;
  std::vector<Real> z;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) z.push_back(100 + 2 * std::sin(0.8 * i) * std::cos(0.6 * j) + i);
  const auto terrain = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(0, 0), Vec2(2, 2), n, n, z));
  const ContactSource ground = [&](std::span<const Vec3> x, Real reach, std::span<Contact> out) { terrain.contacts(x, reach, out); };
  Vent vent;
  vent.from = Vec3(10, 10, 120);
  vent.to = Vec3(44, 20, 80);  // from above to below the ground, and past its edge at x = 38
  vent.width = 4;
  vent.rate = 1;
  const Real dx = 0.5;
  const Emitter emitter({vent}, dx, 1, std::vector<ContactSource>{ground});
  const std::vector<Vec3> lattice = vent.lattice(dx);
  ASSERT_EQ(emitter.sites().size(), lattice.size());
  std::size_t on = 0, beside = 0;
  for (std::size_t s = 0; s < lattice.size(); ++s) {
    const Emitter::Site& site = emitter.sites()[s];
    EXPECT_EQ(site.at.head<2>(), lattice[s].head<2>());
    EXPECT_NEAR(site.up.norm(), 1, 1e-12);
    EXPECT_EQ(site.share, static_cast<Real>(lattice.size()) * dx * dx * dx);
    if (const auto height = terrain.height(site.at.x(), site.at.y())) {
      EXPECT_NEAR(site.at.z(), *height, 1e-5 * dx) << site.at.transpose();
      EXPECT_LT((site.up - terrain.contact(site.at).normal).norm(), 1e-5);
      ++on;
    } else {
      EXPECT_EQ(site.at, lattice[s]);
      EXPECT_EQ(site.up, Vec3::UnitZ());
      ++beside;
    }
  }
  EXPECT_GT(on, 400u);
  EXPECT_GT(beside, 50u);
}

TEST(Emitter, OfTwoGroundsSitesLieOnTheUpper) {
  const ContactSource slab = [](std::span<const Vec3> x, Real reach, std::span<Contact> out) {
    kFloor(x, reach, out);
    for (std::size_t i = 0; i < x.size(); ++i) out[i].distance = x[i].z() - 3;
  };
  for (const Real height : {-2.0, 1.0, 2.5, 7.0}) {
    Vent vent;
    vent.from = vent.to = Vec3(0, 0, height);
    for (const std::vector<ContactSource>& ground : {std::vector{kFloor, slab}, std::vector{slab, kFloor}})
      EXPECT_NEAR(Emitter({vent}, 1, 1, ground).sites()[0].at.z(), 3, 1e-6) << "inside either solid is inside, from " << height;
  }
}

TEST(Emitter, BesideAWallASiteKeepsTheVentsHeight) {
  // No way up or down leads to it: Newton's method runs away.
  const ContactSource wall = [](std::span<const Vec3> x, Real, std::span<Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) out[i] = {Vec3(0, x[i].y(), x[i].z()), Vec3::UnitX(), x[i].x(), Vec3::Zero(), 0, 0};
  };
  Vent vent;
  vent.from = vent.to = Vec3(5, 1, 2);
  const Emitter emitter({vent}, 1, 1, std::vector<ContactSource>{wall});
  EXPECT_EQ(emitter.sites()[0].at, vent.from);
  EXPECT_EQ(emitter.sites()[0].up, Vec3::UnitZ());
}

TEST(Emitter, WhatComesOutWasASpacingApartInTheConduit) {
  const std::vector<Vent> vents = two_vents();
  const Real dx = 0.5, born = 2.2;  // of the material coordinates
  Emitter emitter(vents, dx, 7, std::vector<ContactSource>{kFloor});
  std::map<Index, Real> last;
  std::size_t pairs = 0;
  const std::vector<Real> t = moments(5);
  for (std::size_t k = 0; k + 1 < t.size(); ++k)
    for (const Emitter::Newborn& p : emitter.emit(t[k], t[k + 1])) {
      const Vec3 rest = p.x - emitter.rise(p.site, born, t[k + 1]);
      if (last.contains(p.site)) {
        EXPECT_NEAR(last[p.site] - rest.z(), dx, 1e-9);
        ++pairs;
      }
      last[p.site] = rest.z();
    }
  EXPECT_GT(pairs, 300u);
  const Emitter::Site& crater = emitter.sites().back();
  EXPECT_NEAR(emitter.rise(static_cast<Index>(emitter.sites().size() - 1), 2, 3).z(), 20 / crater.share * dx, 1e-12);
}

TEST(Emitter, KeepAndLoadTakeTheCarriersAlong) {
  Emitter emitter(two_vents(), 0.5, 7, std::vector<ContactSource>{kFloor});
  emitter.add_free(2);
  const std::size_t newborn = emitter.emit(0, 1).size();
  ASSERT_GT(newborn, 3u);
  ASSERT_EQ(emitter.size(), newborn + 2);
  EXPECT_FALSE(emitter.held(0) || emitter.held(1));
  EXPECT_TRUE(emitter.held(2));
  emitter.keep(std::vector<Index>{4, 0, 2});
  EXPECT_TRUE(emitter.held(0) && !emitter.held(1) && emitter.held(2));

  StateWriter out;
  Emitter::arrays(static_cast<const Emitter&>(emitter), out);
  Emitter resumed(two_vents(), 0.5, 7, std::vector<ContactSource>{kFloor});
  StateReader in(out.bytes(), "memory");
  Emitter::arrays(resumed, in);
  resumed.check_loaded(3);
  EXPECT_THROW(resumed.check_loaded(2), InputError);
  std::vector<Vec3> v(3, Vec3::Zero()), w(3, Vec3::Zero());
  emitter.carry(1, 0.1, v);
  resumed.carry(1, 0.1, w);
  EXPECT_EQ(v, w);
  EXPECT_GT(v[0].z(), 0);
  const auto more = emitter.emit(1, 1.5);
  const std::vector<Emitter::Newborn> ours(more.begin(), more.end());
  const auto theirs = resumed.emit(1, 1.5);
  ASSERT_EQ(ours.size(), theirs.size());
  for (std::size_t i = 0; i < ours.size(); ++i) EXPECT_EQ(ours[i].x, theirs[i].x);

  // Of a run with other vents: refused.
  Emitter small({}, 0.5, 7, std::vector<ContactSource>{kFloor});
  StateReader again(out.bytes(), "memory");
  Emitter::arrays(small, again);
  EXPECT_THROW(small.check_loaded(3), InputError);
}

TEST(Emitter, HasTheSameBitsOnOneAndFourThreads) {
  const auto hash = [](int threads) {
    const ThreadLimit limit(threads);
    std::vector<Vent> vents = two_vents();
    vents[1].width = 40;
    vents[1].rate = 4000;
    Emitter emitter(vents, 0.5, 7, std::vector<ContactSource>{kFloor});
    std::vector<Vec3> v;
    StateHash h;
    for (const auto& [t0, t1] : {std::pair(0.0, 2.0), std::pair(2.0, 2.3)}) {
      for (const Emitter::Newborn& p : emitter.emit(t0, t1)) v.push_back(p.v);
      emitter.carry(t1, 0.1, v);
      h.add(std::span<const Vec3>(v));
    }
    HashArchive io{h};
    Emitter::arrays(emitter, io);
    EXPECT_GT(v.size(), 8192u) << "several chunks";
    return h.hex();
  };
  EXPECT_EQ(hash(1), hash(4));
}

TEST(EmitterDeathTest, AVentsRateIsANumberNotBelowZero) {
  Vent vent;
  vent.rate = -1;
  EXPECT_DEATH(Emitter({vent}, 1, 1, {}), "rate");
}

}  // namespace
}  // namespace effuse::flow::sph
