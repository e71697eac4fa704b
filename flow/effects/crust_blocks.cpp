#include "flow/effects/crust_blocks.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"
#include "geometry/fracture/convex_clip.h"

namespace effuse::flow {

namespace {

constexpr Real kReach = 2.5;      ///< spacings: neighbours along the surface
constexpr Real kCovered = 0.6;    ///< of a block's place must be crust
constexpr Real kFlat = 0.5;       ///< spacings, rms: rougher crust gives no plate
constexpr Real kApart = 0.98;     ///< of the way to the middle between two blocks: they do not touch at birth
constexpr int kCorners = 8;
constexpr Real kDeep = 0.45;      ///< spacings: no deeper under the surface, where particles lie

/// Particles by cells of the plan, columns of them.
class Plan {
 public:
  Plan(std::span<const Vec3> x, std::vector<Index> which, Real cell) : x_(x), cell_(cell) {
    for (const Index i : which) cells_[key(x[i])].push_back(i);
  }
  /// f(i) for all within r of p, r at most the cell: by cell, then in order.
  template <class F>
  void near(const Vec3& p, Real r, F&& f) const {
    const auto [a, b] = key(p);
    const int n = static_cast<int>(std::ceil(r / cell_));
    for (int j = -n; j <= n; ++j)
      for (int i = -n; i <= n; ++i) {
        const auto found = cells_.find({a + i, b + j});
        if (found == cells_.end()) continue;
        for (const Index k : found->second)
          if ((x_[k] - p).squaredNorm() < r * r) f(k);
      }
  }

 private:
  std::pair<int, int> key(const Vec3& p) const { return {static_cast<int>(std::floor(p.x() / cell_)), static_cast<int>(std::floor(p.y() / cell_))}; }
  std::span<const Vec3> x_;
  Real cell_;
  std::map<std::pair<int, int>, std::vector<Index>> cells_;
};

std::vector<Index> surface_of(const sph::ModernLava& lava) {
  std::vector<Index> which;
  const auto flags = lava.surface();
  for (Index i = 0; i < flags.size(); ++i)
    if (flags[i]) which.push_back(i);
  return which;
}

/// Convex hull of points of a plane, counter-clockwise (Andrew's monotone chain).
std::vector<Vec2> convex(std::vector<Vec2> p) {
  std::sort(p.begin(), p.end(), [](const Vec2& a, const Vec2& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
  const auto turn = [](const Vec2& o, const Vec2& a, const Vec2& b) { return (a - o).x() * (b - o).y() - (a - o).y() * (b - o).x(); };
  std::vector<Vec2> out;
  for (int side = 0; side < 2; ++side) {
    const std::size_t start = out.size();
    for (const Vec2& q : p) {
      while (out.size() >= start + 2 && turn(out[out.size() - 2], out.back(), q) <= 0) out.pop_back();
      out.push_back(q);
    }
    out.pop_back();
    std::reverse(p.begin(), p.end());
  }
  return out;
}

}  // namespace

CrustBlockOptions read_crust_blocks(Parameters& lava, Real spacing, Real density) {
  CrustBlockOptions o;
  const bool there = lava.has("crust_blocks");
  Parameters p = lava.table("crust_blocks", "crust that the flow tears becomes rigid blocks, which it carries, tilts and piles up");
  o.on = p.flag("on", there, "false: none are born");
  o.thickness = p.number("thickness", "m", o.thickness, Parameters::positive(), "of crust that is strong enough to be a plate");
  o.strain = p.number("strain", "", o.strain, Parameters::not_negative(), "of the surface since its crust was that thick: then it breaks");
  o.size = p.number("size", "m", 6 * spacing, Parameters::positive(), "of a block, across; unless told, six spacings");
  o.depth = p.number("depth", "m", o.depth, Parameters::not_negative(), "of a block, with the stiff hot rock under its crust; 0: the crust alone");
  o.density = p.number("density", "kg/m3", 0.8 * density, {1, 1e5}, "of crust; unless told, 0.8 of the lava's: it floats");
  o.most = static_cast<std::size_t>(p.integer("most", static_cast<std::int64_t>(o.most), 0, 100000, "no more are born"));
  o.interval = p.number("interval", "s", o.interval, Parameters::positive(), "between two looks at the crust");
  if (o.on && spacing > 0 && o.size < 3 * spacing) p.fault("size", fmt::format("a block of {:g} m is too small for particles {:g} m apart, wanted three of them or more", o.size, spacing));
  return o;
}

CrustBlocks::CrustBlocks(const CrustBlockOptions& options, Real spacing) : options_(options), spacing_(spacing) {
  CHECK_GT(options.size, 0);
  CHECK_GT(options.density, 0);
  CHECK_GT(spacing, 0);
}

void CrustBlocks::strain_crust(const sph::ModernLava& lava, Real dt) {
  const auto x = lava.positions(), v = lava.velocities();
  const auto crust = lava.heat().crust_thickness();
  const auto ids = lava.ids();
  std::uint64_t most = 0;
  for (const std::uint64_t id : ids) most = std::max(most, id + 1);
  if (strain_.size() < most) strain_.resize(most, 0);
  const std::vector<Index> surface = surface_of(lava);
  const Plan plan(x, surface, kReach * spacing_);
  parallel_for(
      surface.size(),
      [&](std::size_t k) {
        const Index i = surface[k];
        if (crust[i] < options_.thickness) {
          strain_[ids[i]] = 0;  // it has healed
          return;
        }
        Mat3 A = Mat3::Zero(), B = Mat3::Zero();
        plan.near(x[i], kReach * spacing_, [&](Index j) {
          const Vec3 r = x[j] - x[i], u = v[j] - v[i];
          const Real w = 1 - r.norm() / (kReach * spacing_);
          A += w * r * r.transpose();
          B += w * u * r.transpose();
        });
        // Across the sheet there are no neighbours, and no gradient is sought.
        const Mat3 G = B * (A + 1e-2 * A.trace() * Mat3::Identity() + 1e-12 * spacing_ * spacing_ * Mat3::Identity()).inverse();
        const Mat3 D = (G + G.transpose()) / 2;
        strain_[ids[i]] += static_cast<float>(dt * std::sqrt(2 * D.squaredNorm()));
      },
      64);
}

void CrustBlocks::give_birth(sph::ModernLava& lava, SolidWorld& world) {
  const Real radius = options_.size / 2;
  std::vector<Index> ready, able;
  {
    const auto crust = lava.heat().crust_thickness();
    const auto ids = lava.ids();
    const auto surface = lava.surface();
    for (Index i = 0; i < lava.size(); ++i) {
      if (!surface[i] || crust[i] < options_.thickness) continue;
      able.push_back(i);
      if (strain_[ids[i]] >= options_.strain) ready.push_back(i);
    }
    std::sort(ready.begin(), ready.end(), [&](Index a, Index b) { return strain_[ids[a]] != strain_[ids[b]] ? strain_[ids[a]] > strain_[ids[b]] : ids[a] < ids[b]; });
  }
  if (ready.empty()) return;

  // Births of this look, chosen before any particle leaves: numbers move then.
  struct Birth {
    std::vector<Vec3> corners;   // of the plate, about its middle: top, then bottom
    geometry::RigidPose pose;
    Vec3 spin;
    Real density, area;
    std::vector<Index> taken;
  };
  std::vector<Birth> births;
  std::vector<Vec3> others = world.block_centres();
  const auto x = lava.positions(), v = lava.velocities();
  const auto crust = lava.heat().crust_thickness();
  const auto ids = lava.ids();
  const Real m = lava.particle_mass();
  const Plan plan(x, able, radius);
  std::vector<std::uint8_t> used(lava.size(), 0);
  for (const Index first : ready) {
    if (totals_.born + static_cast<Real>(births.size()) >= static_cast<Real>(options_.most)) break;
    if (used[first]) continue;
    if (std::any_of(others.begin(), others.end(), [&](const Vec3& c) { return (c - x[first]).norm() < 0.9 * options_.size; })) continue;
    std::vector<Index> patch;
    plan.near(x[first], radius, [&](Index j) {
      if (!used[j]) patch.push_back(j);
    });
    std::sort(patch.begin(), patch.end());
    if (static_cast<Real>(patch.size()) < kCovered * kPi * radius * radius / (spacing_ * spacing_)) continue;

    // The plane of the patch.
    const Real n = static_cast<Real>(patch.size());
    Vec3 middle = Vec3::Zero(), speed = Vec3::Zero();
    Real thick = 0;
    for (const Index j : patch) middle += x[j] / n, speed += v[j] / n, thick += crust[j] / n;
    Mat3 spread = Mat3::Zero(), J = Mat3::Zero();
    Vec3 whirl = Vec3::Zero();
    for (const Index j : patch) {
      const Vec3 r = x[j] - middle;
      spread += r * r.transpose() / n;
      J += r.squaredNorm() * Mat3::Identity() - r * r.transpose();
      whirl += r.cross(v[j] - speed);
    }
    const Eigen::SelfAdjointEigenSolver<Mat3> axes(spread);
    Vec3 up = axes.eigenvectors().col(0);
    if (up.z() < 0) up = -up;
    if (options_.depth > 0) thick = options_.depth;
    if (std::sqrt(std::max(0.0, axes.eigenvalues()[0])) > kFlat * spacing_ || up.z() < 0.5) continue;
    const Vec3 e1 = up.unitOrthogonal(), e2 = up.cross(e1);

    // An irregular polygon, kept from the blocks beside it.
    std::vector<Vec2> points;
    const Real turn = 2 * kPi * random_uniform(options_.seed, 11, ids[first]);
    for (int k = 0; k < kCorners; ++k) {
      const auto draw = static_cast<std::uint64_t>(12 + k);
      const Real angle = turn + 2 * kPi * (k + 0.7 * (random_uniform(options_.seed, draw, ids[first]) - 0.5)) / kCorners;
      const Real r = radius * (0.62 + 0.38 * random_uniform(options_.seed, draw + 32, ids[first]));
      points.emplace_back(r * std::cos(angle), r * std::sin(angle));
    }
    std::vector<Vec3> rim;
    for (const Vec2& p : convex(points)) rim.push_back(middle + p.x() * e1 + p.y() * e2);
    for (const Vec3& c : others)
      if (const Vec3 d = c - middle; d.norm() < 1.3 * options_.size) geometry::clip(rim, d.normalized(), d.normalized().dot(middle + kApart * d / 2), 1e-9 * options_.size);
    Vec3 area = Vec3::Zero(), centroid = Vec3::Zero();
    for (std::size_t k = 1; k + 1 < rim.size(); ++k) {
      const Vec3 part = (rim[k] - rim[0]).cross(rim[k + 1] - rim[0]) / 2;
      area += part;
      centroid += part.dot(up) * (rim[0] + rim[k] + rim[k + 1]) / 3;
    }
    if (!(area.dot(up) > kCovered * kPi * radius * radius * 0.5)) continue;
    centroid /= area.dot(up);

    // Whole particles for it, drawn from those under it, spread evenly.
    Birth birth;
    birth.area = area.dot(up);
    const Real wanted = options_.density * birth.area * thick / m;
    const auto k = static_cast<std::size_t>(std::max(1.0, std::round(wanted)));
    std::vector<std::pair<std::uint64_t, Index>> order;
    for (const Index j : patch) order.emplace_back(random_bits(options_.seed, 99, ids[j]), j);
    std::sort(order.begin(), order.end());
    if (k > order.size()) continue;
    for (std::size_t q = 0; q < k; ++q) birth.taken.push_back(order[q].second);
    const Real t = static_cast<Real>(k) * m / (options_.density * birth.area);
    birth.density = options_.density;
    // Top at the surface, half a spacing over the particles' middles, unless it were to reach down to these.
    const Real top = spacing_ / 2 + std::max(0.0, t - kDeep * spacing_);
    birth.pose.position = centroid + (top - t / 2) * up;
    birth.spin = J.inverse() * whirl;
    for (const bool upper : {true, false})
      for (const Vec3& p : rim) birth.corners.push_back(centroid + (upper ? 1.0 : 0.96) * (p - centroid) + (upper ? t / 2 : -t / 2) * up - centroid);
    for (const Index j : patch) used[j] = 1;
    others.push_back(birth.pose.position);
    births.push_back(std::move(birth));
  }
  if (births.empty()) return;

  // The particles go, then the plates come.
  std::vector<Index> all;
  std::vector<Vec3> momentum;
  std::vector<Real> temperature;
  for (const Birth& b : births) {
    Vec3 p = Vec3::Zero();
    Real T = 0;
    for (const Index j : b.taken) {
      p += m * v[j];
      T += lava.temperatures()[j] / static_cast<Real>(b.taken.size());
      all.push_back(j);
    }
    momentum.push_back(p);
    temperature.push_back(T);
  }
  std::sort(all.begin(), all.end());
  totals_.heat += lava.take(all);
  for (std::size_t k = 0; k < births.size(); ++k) {
    Birth& b = births[k];
    const Real mass = m * static_cast<Real>(b.taken.size());
    world.add_block(b.corners, mass, b.pose, momentum[k] / mass, b.spin, temperature[k]);
    totals_.born += 1;
    totals_.mass += mass;
  }
}

void CrustBlocks::step(sph::ModernLava& lava, SolidWorld& world, const geometry::Terrain& terrain) {
  const Real now = lava.time();
  if (now < last_ + options_.interval) return;
  ZONE("lava.crust_blocks");
  strain_crust(lava, now - last_);
  last_ = now;
  give_birth(lava, world);
  totals_.left += world.drop_blocks([&](const Vec3& p) { return !terrain.height(p.x(), p.y()).has_value(); });
}

std::vector<std::pair<std::string, double>> CrustBlocks::figures() const {
  return {{"crust_blocks", totals_.born}, {"crust_blocks_kg", totals_.mass}, {"crust_blocks_J", totals_.heat}, {"crust_blocks_left_kg", totals_.left}};
}

template <class Self, class Archive>
void CrustBlocks::archive(Self& self, Archive& io) {
  io.value("blocks_last", self.last_);
  io.value("blocks_born", self.totals_.born);
  io.value("blocks_mass", self.totals_.mass);
  io.value("blocks_heat", self.totals_.heat);
  io.value("blocks_left", self.totals_.left);
  io.array("blocks_strain", self.strain_);
}

void CrustBlocks::add_to(StateHash& hash) const {
  hash.add(last_);
  hash.add(std::span<const float>(strain_));
}
void CrustBlocks::save(StateWriter& out) const { archive(*this, out); }
void CrustBlocks::load(StateReader& in) { archive(*this, in); }

}  // namespace effuse::flow
