#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "flow/bodies/rigid_bodies_internal.h"
#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::bodies {

using geometry::RigidMotion;

namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
constexpr int kRetries = 6;
constexpr int kJointRetries = 4;
constexpr Real kJointGood = 1e-4;   ///< of the smaller bounding radius, or of a radian: joints that are off by less are well
constexpr Real kSamePlace = 0.02;   ///< of the smaller bounding radius: a place found again
constexpr Real kFarthest = 1e12;    ///< [m]: a body further off has gone bad
constexpr Real kTravel = 0.5;       ///< of the bounding radius, between two looks
constexpr Real kSweepFrom = 0.5;    ///< of the core radius: a body that goes further is swept
constexpr int kMendings = 3;        ///< of joint impulses in a substep, at most
constexpr Real kJointTolerance = 1e-9;  ///< [m or rad]: joints that hold so well need no mending

}  // namespace

/// Whether anything is within reach of body i: one that falls for ever into the void costs the others nothing.
bool RigidBodies::Impl::may_meet(Index i, Real reach) const {
  const Box3 box(x[i] - Vec3::Constant(reach), x[i] + Vec3::Constant(reach));
  if (ground && ground->terrain().bounds().intersects(box)) return true;
  if (!broad || broad->size() < size()) return true;
  std::vector<Index> near;
  broad->query(box, near);
  return std::any_of(near.begin(), near.end(), [&](Index j) { return j != i; });
}

int RigidBodies::Impl::looks_for(Real dt) const {
  Real looks = std::max(Real{1}, std::ceil(dt / options.step * (1 - 1e-9)));
  Real wanted = looks;
  for (Index i = 0; i < size(); ++i) {
    if (!awake(i)) continue;
    const Real travel = dt * (velocity(i).norm() + dt * options.gravity.norm()), bound = shape[i]->bounding_radius();
    const Real needs = std::ceil(travel / (kTravel * bound));
    if (needs > wanted && may_meet(i, bound + 2 * travel)) wanted = needs;
  }
  return static_cast<int>(std::max(looks, std::min(wanted, Real(options.max_looks))));
}

bool RigidBodies::Impl::finite() const {
  for (Index i = 0; i < size(); ++i) {
    if (!dynamic(i)) continue;
    if (!(x[i].norm() < kFarthest && q[i].coeffs().allFinite() && p[i].allFinite() && L[i].allFinite() && std::isfinite(p[i].squaredNorm() / mass[i]) &&
          std::isfinite(spin(i).squaredNorm())))
      return false;
  }
  return true;
}

/// How far the worst joint is off, in units of what is well.
Real RigidBodies::Impl::joint_strain() const {
  Real worst = 0;
  for (const JointState& j : joints) {
    if (j.broken) continue;
    Real size = 1;
    for (const BodyId end : {j.joint.a, j.joint.b})
      if (end != Joint::kWorld && dynamic(end)) size = std::min(size, shape[end]->bounding_radius());
    worst = std::max(worst, bodies::joint_error(j, solver_body(j.joint.a), solver_body(j.joint.b)) / (kJointGood * size));
  }
  return worst;
}

BodyReport RigidBodies::step(Real dt) {
  ZONE("bodies.step");
  CHECK(dt > 0 && std::isfinite(dt));
  Impl& m = *impl_;
  const Impl::Saved before = m.saved();
  for (Index i = 0; i < m.size(); ++i) m.motion[i] = m.driven_now[i] ? RigidMotion({m.x[i], m.q[i]}, m.target[i], dt) : RigidMotion({m.x[i], m.q[i]});
  const int looks = m.finite() ? m.looks_for(dt) : 1;
  const Real strain = m.joint_strain();
  for (int retry = 0; retry <= kRetries; ++retry) {
    try {
      BodyReport report = m.run(dt, looks << retry);
      report.retries = retry;
      // A jerk that the substeps were too long for: heavy things on light chains. What was off before, and stays so, is left to heal.
      if (retry < kJointRetries && m.joint_strain() > std::max(Real{1}, 2 * strain)) {
        m.restore(before);
        continue;
      }
      for (Index i = 0; i < m.size(); ++i) {
        m.force[i].setZero();
        m.torque[i].setZero();
        m.driven_now[i] = 0;
      }
      return report;
    } catch (const NotFinite&) {
      m.restore(before);
    }
  }
  throw UnstableError(fmt::format("rigid bodies: a step of {:.3g} s ends in numbers that are not finite, {} looks for contacts in it or fewer", dt, looks << kRetries));
}

/// Of a look this long [s].
int RigidBodies::Impl::substeps_of(Real look) const {
  if (options.contact != ContactModel::kPenalty) return options.substeps;
  return std::max(options.substeps, static_cast<int>(std::ceil(look / penalty_step_limit(options, options.penalty_springs) * (1 - 1e-9))));
}

BodyReport RigidBodies::Impl::run(Real dt, int looks) {
  BodyReport report;
  report.dt = dt;
  report.looks = looks;
  report.substeps = looks * substeps_of(dt / looks);
  loads.clear();
  for (int k = 0; k < looks; ++k) look(dt / looks, k, looks, report);
  time += dt;
  for (Index i = 0; i < size(); ++i) {
    if (role[i] == Role::kDriven && driven_now[i]) {
      x[i] = target[i].position;
      q[i] = target[i].orientation;
    }
    if (!dynamic(i)) continue;
    report.awake += awake(i);
    report.kinetic += p[i].squaredNorm() / (2 * mass[i]) + spin(i).dot(L[i]) / 2;
    report.potential -= mass[i] * options.gravity.dot(x[i]);
  }
  if (!std::isfinite(report.kinetic)) throw NotFinite{};
  for (const JointState& j : joints)
    if (!j.broken) report.joint_error = std::max(report.joint_error, bodies::joint_error(j, solver_body(j.joint.a), solver_body(j.joint.b)));
  COUNT("bodies.contacts", report.contacts);
  return report;
}

void RigidBodies::Impl::look(Real dt, int number, int looks, BodyReport& report) {
  if (!finite()) throw NotFinite{};
  const int substeps = substeps_of(dt);
  // Driven bodies: where they are now, and after each substep.
  for (Index i = 0; i < size(); ++i) {
    if (!driven_now[i]) continue;
    path[i].resize(substeps + 1);
    for (int k = 0; k <= substeps; ++k) path[i][k] = motion[i].pose((number + static_cast<Real>(k) / substeps) / looks);
    x[i] = path[i][0].position;
    q[i] = path[i][0].orientation;
    placed_well[i] = 0;
  }
  do {
    place_bodies(dt);
    find_contacts();
  } while (wake_touched(dt));

  std::vector<unsigned char> moving(size());
  for (Index i = 0; i < size(); ++i) moving[i] = awake(i);
  std::vector<Link> links;
  links.reserve(points.size());
  for (const ContactPoint& c : points) links.push_back({c.a, c.b});
  std::vector<std::pair<JointId, Link>> joined;
  for (JointId j = 0; j < joints.size(); ++j)
    if (!joints[j].broken) joined.push_back({j, {joints[j].joint.a, joints[j].joint.b}});
  std::vector<Island> islands = make_islands(moving, links, joined);
  report.islands = islands.size();
  report.contacts = points.size();

  const std::vector<Vec3> before = x;
  solve(dt, number, islands, report);
  if (!finite()) throw NotFinite{};
  stop_fast(before, static_cast<Real>(number) / looks, static_cast<Real>(number + 1) / looks, report);
  let_sleep(islands, dt);
}

void RigidBodies::Impl::place_bodies(Real dt) {
  ZONE("bodies.place");
  parallel_for(
      size(),
      [&](std::size_t i) {
        const Index k = static_cast<Index>(i);
        if (role[i] == Role::kGone || (placed_well[i] && !awake(k))) return;
        placed[i].place(*shape[i], x[i], q[i].toRotationMatrix());
        const Real bound = shape[i]->bounding_radius();
        Real reach = options.margin * bound;
        if (awake(k)) reach += dt * (velocity(k).norm() + dt * options.gravity.norm() + spin(k).norm() * bound);
        if (driven_now[i]) reach += dt * (motion[i].shift().norm() + motion[i].turn().norm() * bound) / motion[i].duration();
        placed[i].margin = reach;
      },
      64);
  if (!broad) {
    std::vector<Real> bounds;
    for (const auto& s : shape) bounds.push_back(s->bounding_radius());
    std::sort(bounds.begin(), bounds.end());
    broad.emplace(bounds.empty() ? 0 : 0.1 * bounds[bounds.size() / 2]);
  }
  active.resize(size());
  for (Index i = 0; i < size(); ++i) {
    active[i] = awake(i) || driven_now[i];
    if (role[i] == Role::kGone) {
      if (i >= broad->size()) {  // numbers have no gaps
        broad->update(i, Box3(x[i], x[i]));
        broad->remove(i);
      }
      continue;
    }
    if (placed_well[i] && !awake(i)) continue;
    Box3 box = shape[i]->bounds(x[i], placed[i].R);
    const Vec3 grown = Vec3::Constant(placed[i].margin);
    broad->update(i, Box3(box.min() - grown, box.max() + grown));
    placed_well[i] = 1;
  }
}

void RigidBodies::Impl::find_contacts() {
  ZONE("bodies.contacts");
  broad->pairs(pairs, active);
  std::set<std::array<Index, 2>> joined;
  for (const JointState& j : joints)
    if (!j.broken && !j.joint.collide) joined.insert({std::min(j.joint.a, j.joint.b), std::max(j.joint.a, j.joint.b)});
  std::erase_if(pairs, [&](const std::array<Index, 2>& pair) {
    return (!dynamic(pair[0]) && !dynamic(pair[1])) || (!joined.empty() && joined.count(pair) > 0);
  });
  if (ground)
    for (Index i = 0; i < size(); ++i)
      if (awake(i)) pairs.push_back({i, kTerrain});
  std::sort(pairs.begin(), pairs.end());

  const auto key = [](const ContactPoint& c) { return std::array<Index, 2>{c.a, c.b}; };
  constexpr std::size_t kGrain = 8;
  std::vector<std::vector<ContactPoint>> found((pairs.size() + kGrain - 1) / kGrain);
  parallel_ranges(pairs.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<ContactPoint>& out = found[begin / kGrain];
    for (std::size_t k = begin; k < end; ++k) {
      const auto [a, b] = pairs[k];
      const auto first = std::lower_bound(points.begin(), points.end(), pairs[k], [&](const ContactPoint& c, const std::array<Index, 2>& at) { return key(c) < at; });
      auto last = first;
      while (last != points.end() && key(*last) == pairs[k]) ++last;
      const std::span<const ContactPoint> old(first, last);
      const std::size_t start = out.size();
      if (b == kTerrain)
        collide_terrain(a, placed[a], *ground, old, out);
      else
        collide(a, placed[a], b, placed[b], old, out);
      const Real bound = b == kTerrain ? shape[a]->bounding_radius() : std::min(shape[a]->bounding_radius(), shape[b]->bounding_radius());
      hand_on(old, {out.data() + start, out.size() - start}, kSamePlace * bound);
    }
  });

  // Places of bodies that sleep stay as they are.
  std::vector<ContactPoint> now;
  now.reserve(points.size());
  for (const ContactPoint& c : points)
    if (!active[c.a] && (c.b == kTerrain || !active[c.b]) && (group[c.a] != 0 || (c.b != kTerrain && group[c.b] != 0))) now.push_back(c);
  for (const auto& part : found) now.insert(now.end(), part.begin(), part.end());
  std::stable_sort(now.begin(), now.end(), [&](const ContactPoint& c, const ContactPoint& d) { return key(c) < key(d); });
  points = std::move(now);
}

/// Wakes sleepers that something moving touches, or will before the next look. Whether there were any.
bool RigidBodies::Impl::wake_touched(Real dt) {
  bool woke = false;
  for (const ContactPoint& c : points) {
    if (c.b == kTerrain) continue;
    const bool wakes_b = active[c.a] && group[c.b] != 0, wakes_a = active[c.b] && group[c.a] != 0;
    if (!wakes_a && !wakes_b) continue;
    const auto speed = [&](Index i) {
      if (driven_now[i]) return Vec3(motion[i].velocity_at(x[i], 0));
      return velocity(i);
    };
    const Real closing = c.normal.dot(speed(c.a) - speed(c.b));
    const Real near = 0.1 * options.margin * std::min(shape[c.a]->bounding_radius(), shape[c.b]->bounding_radius());
    if (c.separation > near + std::max(Real{0}, closing) * dt) continue;
    wake_group(wakes_b ? c.b : c.a);
    woke = true;
  }
  return woke;
}

PairSurface RigidBodies::Impl::pair_surface(const ContactPoint& c) const {
  const Surface& a = surface[c.a];
  if (c.b == kTerrain) return {std::sqrt(a.friction * options.terrain_friction), std::max(a.restitution, options.terrain_restitution), a.rolling};
  const Surface& b = surface[c.b];
  return {std::sqrt(a.friction * b.friction), std::max(a.restitution, b.restitution), std::max(a.rolling, b.rolling)};
}

void RigidBodies::Impl::solve(Real dt, int number, std::vector<Island>& islands, BodyReport& report) {
  ZONE("bodies.solve");
  solver.resize(size() + 1);
  for (Index i = 0; i < size(); ++i) {
    solver[i] = solver_body(i);
    if (group[i] != 0) solver[i].im = 0, solver[i].iI.setZero();
    if (driven_now[i]) {
      solver[i].path = path[i].data();
      solver[i].v = motion[i].shift() / motion[i].duration();
      solver[i].w = motion[i].turn() / motion[i].duration();
    }
  }
  solver[size()] = SolverBody{};  // the terrain

  const int substeps = substeps_of(dt);
  const Real h = dt / substeps;
  std::vector<Real> deepest(islands.size(), 0);
  std::vector<std::vector<ContactLoad>> given(islands.size());
  parallel_for(islands.size(), [&](std::size_t k) { deepest[k] = solve_island(islands[k], h, substeps, number * substeps, given[k]); }, 1);
  for (const auto& part : given) loads.insert(loads.end(), part.begin(), part.end());
  report.penetration = 0;
  for (const Real d : deepest) report.penetration = std::max(report.penetration, d);
  for (const Island& island : islands)
    for (const Index i : island.bodies) {
      x[i] = solver[i].x;
      q[i] = solver[i].q;
      p[i] = solver[i].p;
      L[i] = solver[i].L;
    }
}

/// What rests on something lighter needs more rounds until the two agree: one for each power of ten.
int RigidBodies::Impl::more_iterations(std::span<const ContactPoint> places) const {
  Real most = 1;
  for (const ContactPoint& c : places) {
    if (c.b == kTerrain || !dynamic(c.a) || !dynamic(c.b)) continue;
    most = std::max({most, mass[c.a] / mass[c.b], mass[c.b] / mass[c.a]});
  }
  return std::min(4, static_cast<int>(std::log10(most) + 1e-9));
}

/// Positions after substep k. With joints so that they hold there: the impulses are mended (RATTLE, with the projection of the velocities
/// that follows), which keeps the energy of swinging linkages from drifting.
void RigidBodies::Impl::go_on(const Island& island, JointSolver& linkage, int k, Real h) {
  std::vector<std::pair<Vec3, Quat>> from;
  if (!linkage.empty())
    for (const Index i : island.bodies) from.emplace_back(solver[i].x, solver[i].q);
  for (int round = 0;; ++round) {
    for (const Index i : island.bodies) {
      SolverBody& b = solver[i];
      b.x += h * b.v;
      b.q = turn_freely(options.rotor, b.q, b.L, b.moments, h);
    }
    if (linkage.empty() || round == kMendings || linkage.refine(k, kJointTolerance) <= kJointTolerance) break;
    for (std::size_t n = 0; n < island.bodies.size(); ++n) {
      solver[island.bodies[n]].x = from[n].first;
      solver[island.bodies[n]].q = from[n].second;
    }
  }
  for (const Index i : island.bodies) solver[i].refresh();
}

Real RigidBodies::Impl::solve_island(const Island& island, Real h, int substeps, int first_substep, std::vector<ContactLoad>& loads_out) {
  const bool alone = island.points.empty() && island.joints.empty();
  if (alone) {
    // A ballistic arc is exact with the mean of the velocities.
    SolverBody& b = solver[island.bodies[0]];
    for (int k = 1; k <= substeps; ++k) {
      const Vec3 before = b.v;
      b.p += h * b.force;
      b.L += h * b.torque;
      b.v = b.im * b.p;
      b.x += h * (before + b.v) / 2;
      b.q = turn_freely(options.rotor, b.q, b.L, b.moments, h);
    }
    return 0;
  }

  std::vector<ContactPoint> local;
  std::vector<PairSurface> surfaces;
  for (const Index k : island.points) {
    local.push_back(points[k]);
    surfaces.push_back(pair_surface(points[k]));
  }
  ContactSolver contacts({h, options.push_speed, options.restitution_speed, options.penalty_frequency, options.penalty_damping}, local, surfaces, solver);
  JointSolver linkage(h, island.joints, joints, solver);
  const int iterations = options.iterations + more_iterations(local);
  const bool soft = options.contact == ContactModel::kPenalty;
  const bool records = std::any_of(island.bodies.begin(), island.bodies.end(), [&](Index i) { return recorded[i] != 0; });
  contacts.prepare(0);
  linkage.prepare(0);
  // Half of the force before and half after a substep is of second order. What gives (contacts, limits, springs) wants all of it
  // before: it is answered twice in a substep, and must see the same force both times.
  const Real early = local.empty() && !linkage.gives() ? h / 2 : h, late = h - early;
  for (int k = 1; k <= substeps; ++k) {
    if (soft) contacts.penalty();  // by the speeds a substep ended with: a body at rest hangs where its spring carries it
    for (const Index i : island.bodies) {
      SolverBody& b = solver[i];
      b.p += early * b.force;
      b.L += early * b.torque;
      b.v = b.im * b.p;
      b.w = b.iI * b.L;
    }
    linkage.warm_start();
    if (!soft) contacts.warm_start();
    for (int r = 0; r < iterations; ++r) {
      linkage.solve_extras(true);
      if (soft) contacts.rub_all();
      else contacts.solve(true);
      linkage.solve_holding(true);
    }
    go_on(island, linkage, k, h);
    if (late > 0)
      for (const Index i : island.bodies) solver[i].push_with(late * solver[i].force, late * solver[i].torque);
    contacts.prepare(k);
    linkage.prepare(k);
    for (int r = 0; r < iterations; ++r) {
      linkage.solve_extras(false);
      if (!soft) contacts.solve(false);
      linkage.solve_holding(false);
    }
    if (!soft && k == substeps) contacts.rebound();
    if (records) contacts.book(recorded, first_substep + k - 1, loads_out);
  }
  const Real deepest = contacts.finish();
  for (std::size_t k = 0; k < local.size(); ++k) points[island.points[k]] = local[k];
  return deepest;
}

/// Bodies that went far in this look wait where their core first touched something that does not give way.
void RigidBodies::Impl::stop_fast(const std::vector<Vec3>& before, Real s0, Real s1, BodyReport& report) {
  ZONE("bodies.sweep");
  std::vector<std::uint8_t> stopped(size(), 0);
  parallel_for(
      size(),
      [&](std::size_t n) {
        const Index i = static_cast<Index>(n);
        if (!awake(i)) return;
        const Vec3 d = x[i] - before[i];
        const Real core = std::max(shape[i]->core_radius(), 1e-3 * shape[i]->bounding_radius());
        if (d.norm() <= kSweepFrom * core) return;
        const Real radius = kSweepFrom * core;
        Real share = 1;
        if (ground) share = std::min(share, first_touch(*ground, before[i], d, radius));
        Box3 box(before[i].cwiseMin(x[i]) - Vec3::Constant(radius), before[i].cwiseMax(x[i]) + Vec3::Constant(radius));
        std::vector<Index> near;
        broad->query(box, near);
        for (const Index j : near) {
          if (j == i || dynamic(j)) continue;
          const RigidMotion part = driven_now[j] ? RigidMotion(motion[j].pose(s0), motion[j].pose(s1), 1) : RigidMotion({x[j], q[j]});
          share = std::min(share, first_touch(placed[j], part, before[i], d, radius));
        }
        if (share >= 1) return;
        x[i] = before[i] + share * d;
        stopped[i] = 1;
      },
      64);
  for (const std::uint8_t s : stopped) report.stopped += s;
}

void RigidBodies::Impl::let_sleep(const std::vector<Island>& islands, Real dt) {
  if (options.sleep_speed == 0) return;
  for (const Island& island : islands) {
    bool slow = true;
    for (const Index i : island.bodies) slow = slow && velocity(i).norm() + spin(i).norm() * shape[i]->bounding_radius() < options.sleep_speed;
    for (const Index k : island.points) {
      const ContactPoint& c = points[k];
      if (driven_now[c.a] || (c.b != kTerrain && driven_now[c.b])) slow = false;
    }
    for (const JointId j : island.joints) {
      const Joint& joint = joints[j].joint;
      for (const BodyId end : {joint.a, joint.b})
        if (end != Joint::kWorld && driven_now[end]) slow = false;
      if (joint.motor_strength > 0 && joint.motor_speed != 0) slow = false;  // however slowly it turns
    }
    Real least = kInfinity;
    for (const Index i : island.bodies) {
      rested[i] = slow ? rested[i] + dt : 0;
      least = std::min(least, rested[i]);
    }
    if (least < options.sleep_delay) continue;
    ++groups;
    for (const Index i : island.bodies) {
      group[i] = groups;
      p[i].setZero();
      L[i].setZero();
      placed_well[i] = 0;  // once more, where it lies down
    }
  }
}

}  // namespace effuse::flow::bodies
