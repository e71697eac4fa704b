#include "geometry/motion/walk.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/motion/curve.h"

namespace effuse::geometry {

namespace {

constexpr Real kLook = 0.35;       // [s] on both sides that a heading is the mean of
constexpr Real kStandSpeed = 0.4;  // of the root's mean speed: a slower foot stands, if it is low
constexpr Real kStandHeight = 0.05;  // [m] over its lowest
constexpr Real kReach = 0.9995;    // of a leg's length
constexpr Real kEase = 0.2;        // [s] on both sides in which hips come down

Quat about_z(Real angle) { return Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ())); }

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

bool has(const std::string& name, std::initializer_list<const char*> words) {
  return std::any_of(words.begin(), words.end(), [&](const char* word) { return name.find(word) != std::string::npos; });
}

/// Running mean over n values on both sides.
template <class T>
std::vector<T> smoothed(const std::vector<T>& v, int n) {
  std::vector<T> out;
  for (int i = 0; i < static_cast<int>(v.size()); ++i) {
    T sum = v[static_cast<std::size_t>(i)];
    // Alike on both sides, shorter at the ends: what goes straight stays.
    const int m = std::min({n, i, static_cast<int>(v.size()) - 1 - i});
    for (int k = 1; k <= m; ++k) sum += v[static_cast<std::size_t>(i - k)] + v[static_cast<std::size_t>(i + k)];
    out.push_back(sum / (2. * m + 1));
  }
  return out;
}

/// A path by its length.
class Path {
 public:
  explicit Path(const std::vector<Vec2>& points) {
    std::vector<Key<Vec2>> keys;
    Real chord = 0;
    for (const Vec2& p : points) {
      if (!keys.empty()) {
        const Real apart = (p - keys.back().value).norm();
        if (!(apart > 1e-6)) continue;
        chord += apart;
      }
      keys.push_back({chord, p, Between::kCatmullRom, Vec2::Zero(), Vec2::Zero()});
    }
    if (keys.size() < 2) throw InputError(Place{}, "the path has fewer than two points apart");
    curve_ = Curve<Vec2>(std::move(keys));
    constexpr int kPerPoint = 64;
    const int n = kPerPoint * static_cast<int>(points.size());
    for (int k = 0; k <= n; ++k) {
      const Real u = chord * k / n;
      length_.push_back(k == 0 ? 0 : length_.back() + (curve_.at(u) - curve_.at(chord * (k - 1) / n)).norm());
      u_.push_back(u);
    }
  }
  Real length() const { return length_.back(); }
  Vec2 at(Real s) const { return curve_.at(u(s)); }
  Real heading(Real s) const {
    const Real e = 1e-3 * length();
    const Vec2 d = at(std::min(s + e, length())) - at(std::max(s - e, 0.0));
    return std::atan2(d.y(), d.x());
  }

 private:
  Real u(Real s) const {
    const auto after = std::upper_bound(length_.begin(), length_.end(), std::clamp(s, 0.0, length()));
    const std::size_t k = std::clamp<std::size_t>(static_cast<std::size_t>(after - length_.begin()), 1, length_.size() - 1);
    const Real span = length_[k] - length_[k - 1], share = span > 0 ? (std::clamp(s, 0.0, length()) - length_[k - 1]) / span : 0;
    return u_[k - 1] + share * (u_[k] - u_[k - 1]);
  }
  Curve<Vec2> curve_;
  std::vector<Real> length_, u_;
};

/// Bends a leg so that its foot comes to a place, what hangs on the foot with it. World poses are changed.
void reach(std::vector<RigidPose>& pose, const std::vector<ClipJoint>& joints, const Leg& leg, const Vec3& target, const Vec3& forward) {
  const Vec3 hip = pose[leg.hip].position, knee = pose[leg.knee].position, foot = pose[leg.foot].position;
  const Real thigh = (knee - hip).norm(), shin = (foot - knee).norm();
  const Real d = std::clamp((target - hip).norm(), std::abs(thigh - shin) + 1e-6, kReach * (thigh + shin));
  const Vec3 along = (target - hip).normalized(), end = hip + d * along;
  Vec3 bend = knee - hip;
  const Vec3 before = (foot - hip).normalized();
  bend -= bend.dot(before) * before;
  if (bend.norm() < 1e-3 * thigh) bend = forward;  // straight: knees bend forward
  bend -= bend.dot(along) * along;
  bend.normalize();
  const Real a = (thigh * thigh - shin * shin + d * d) / (2 * d), h = std::sqrt(std::max(0.0, thigh * thigh - a * a));
  const Vec3 new_knee = hip + a * along + h * bend;
  pose[leg.hip].orientation = Quat::FromTwoVectors(knee - hip, new_knee - hip) * pose[leg.hip].orientation;
  pose[leg.knee].orientation = Quat::FromTwoVectors(foot - knee, end - new_knee) * pose[leg.knee].orientation;
  pose[leg.knee].position = new_knee;
  const Vec3 shift = end - foot;
  std::vector<std::uint8_t> below(joints.size(), 0);
  below[leg.foot] = 1;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].parent != ClipJoint::kNone && below[joints[j].parent]) below[j] = 1;
    if (below[j]) pose[j].position += shift;
  }
}

}  // namespace

std::vector<Leg> find_legs(const std::vector<ClipJoint>& joints) {
  std::vector<Leg> legs;
  for (Index j = 0; j < joints.size(); ++j) {
    if (!has(lower(joints[j].name), {"foot", "ankle"}) || has(lower(joints[j].name), {"end"})) continue;
    const Index knee = joints[j].parent;
    if (knee == ClipJoint::kNone) continue;
    const Index hip = joints[knee].parent;
    if (hip == ClipJoint::kNone || !(joints[j].offset.norm() > 0) || !(joints[knee].offset.norm() > 0)) continue;
    // The toe of one that has been found is no leg.
    if (std::any_of(legs.begin(), legs.end(), [&](const Leg& leg) { return leg.foot == knee || leg.foot == hip; })) continue;
    legs.push_back({hip, knee, j});
  }
  return legs;
}

SkeletonClip repeated(const SkeletonClip& clip, Real length, Real fade) {
  SkeletonClip out = clip;
  Real lowest = 1e300;
  for (const SkeletonPose& pose : out.frames)
    for (const RigidPose& joint : forward_kinematics(out.joints, pose)) lowest = std::min(lowest, joint.position.z());
  for (SkeletonPose& pose : out.frames) pose.root.z() -= lowest;
  if (out.length() >= length) return out;
  const SkeletonClip once = out;
  fade = std::min(fade, once.length() / 4);
  // Found once: from the second half of the clip into its first.
  const SkeletonClip tail = cut(once, 0, once.length() - fade);
  const Transition turn = best_transition(tail, once, std::min(fade, 0.1), once.length() / 2, once.length() / 2 - fade);
  const Real gained = turn.from - turn.to;
  if (!(gained > 4 * once.frame_time)) throw InputError(Place{}, "the clip cannot be repeated: its end is like its very end only");
  while (out.length() < length) out = blended(out, once, out.length() - (once.length() - turn.from), turn.to, fade);
  return out;
}

Walk walk_along(const SkeletonClip& clip, const std::function<Real(const Vec2&)>& height, const WalkOptions& o) {
  CHECK_GT(o.rate, 0);
  CHECK_GT(o.pace, 0);
  const std::vector<Leg> legs = find_legs(clip.joints);
  if (legs.empty()) throw InputError(Place{}, "no joint of the clip has 'foot' or 'ankle' in its name, with a knee and a hip above it");
  const Path path(o.path);
  const auto samples = static_cast<std::size_t>(std::ceil(std::max(0.0, o.duration) * o.rate)) + 2;
  Walk walk;
  walk.step = 1 / o.rate;
  const Real walking = std::max(walk.step, static_cast<Real>(samples) * walk.step - o.start);
  const SkeletonClip all = repeated(clip, walking * o.pace + 2 * kLook);

  // The clip's own way, and how far along it each sample is.
  std::vector<SkeletonPose> poses;
  std::vector<Vec2> roots;
  for (std::size_t i = 0; i < samples; ++i) {
    poses.push_back(all.at(std::max(0.0, static_cast<Real>(i) * walk.step - o.start) * o.pace));
    roots.push_back(poses.back().root.head<2>());
  }
  const std::vector<Vec2> way = smoothed(roots, static_cast<int>(std::round(kLook * o.rate)));
  std::vector<Real> s(samples, 0), heading(samples, 0);
  for (std::size_t i = 1; i < samples; ++i) s[i] = s[i - 1] + (way[i] - way[i - 1]).norm();
  const Real speed = s.back() / walking;
  if (!(speed > 0.05 * o.pace)) throw InputError(Place{}, fmt::format("the clip goes nowhere ({:.2g} m in {:.3g} s): a figure on a path needs one that walks; or its scale is wrong", s.back(), walking));
  for (std::size_t i = 0; i < samples; ++i) {
    // The stretch ahead and behind that is long enough to have a direction.
    std::size_t a = i, b = i;
    while ((way[b] - way[a]).norm() < 0.05 * speed && (a > 0 || b + 1 < samples)) a -= a > 0, b += b + 1 < samples;
    heading[i] = std::atan2(way[b].y() - way[a].y(), way[b].x() - way[a].x());
  }
  // At the path's end it stands as it came.
  std::size_t end = samples;
  for (std::size_t i = 0; i < samples; ++i)
    if (s[i] > path.length()) {
      end = i;
      break;
    }
  walk.travelled = std::min(s.back(), path.length());

  // Laid along the path, over the ground.
  std::vector<std::vector<RigidPose>> world;
  std::vector<std::vector<Vec3>> clip_feet(legs.size()), feet(legs.size());
  std::vector<Real> turned(samples), rise(samples);
  for (std::size_t i = 0; i < std::min(end, samples); ++i) {
    const std::vector<RigidPose> own = forward_kinematics(all.joints, poses[i]);
    const Real turn = path.heading(s[i]) - heading[i];
    const Vec2 to = path.at(s[i]);
    turned[i] = path.heading(s[i]);
    // The ground under a stride, not under a point.
    const Vec2 ahead(std::cos(turned[i]), std::sin(turned[i]));
    rise[i] = (height(to) + height(to + 0.3 * ahead) + height(to - 0.3 * ahead)) / 3;
    const Quat z = about_z(turn);
    std::vector<RigidPose> there;
    for (const RigidPose& joint : own) {
      const Vec3 off = joint.position - Vec3(way[i].x(), way[i].y(), 0);
      there.push_back({z * off + Vec3(to.x(), to.y(), rise[i]), z * joint.orientation});
    }
    for (std::size_t leg = 0; leg < legs.size(); ++leg) {
      clip_feet[leg].push_back(own[legs[leg].foot].position);
      Vec3 foot = there[legs[leg].foot].position;
      foot.z() = height(foot.head<2>()) + own[legs[leg].foot].position.z();
      feet[leg].push_back(foot);
    }
    world.push_back(std::move(there));
  }
  const std::size_t n = world.size();

  // When feet stand, by the clip; where, by the path and the ground; between, the way bends from the one place to the other.
  std::vector<std::vector<Vec3>> target = feet;
  for (std::size_t leg = 0; leg < legs.size(); ++leg) {
    Real low = 1e300;
    for (const Vec3& foot : clip_feet[leg]) low = std::min(low, foot.z());
    std::vector<std::uint8_t> stands(n, 0);
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t a = i > 0 ? i - 1 : i, b = std::min(i + 1, n - 1);
      const Real v = b > a ? (clip_feet[leg][b] - clip_feet[leg][a]).head<2>().norm() / (walk.step * static_cast<Real>(b - a)) : 0;
      stands[i] = clip_feet[leg][i].z() < low + kStandHeight && v < kStandSpeed * speed;
    }
    std::vector<Walk::Plant> plants;
    for (std::size_t i = 0; i < n; ++i) {
      if (!stands[i]) continue;
      if (i > 0 && stands[i - 1]) plants.back().last = i;
      else plants.push_back({leg, i, i});
    }
    std::erase_if(plants, [&](const Walk::Plant& p) { return static_cast<Real>(p.last - p.first) * walk.step < 0.05; });
    std::vector<Vec3> first_off, last_off;
    for (const Walk::Plant& plant : plants) {
      Vec3 place = feet[leg][(plant.first + plant.last) / 2];
      place.z() = height(place.head<2>()) + low;
      first_off.push_back(place - feet[leg][plant.first]);
      last_off.push_back(place - feet[leg][plant.last]);
      for (std::size_t i = plant.first; i <= plant.last; ++i) target[leg][i] = place;
    }
    for (std::size_t i = 0, next = 0; i < n; ++i) {
      while (next < plants.size() && plants[next].last < i) ++next;
      if (plants.empty() || (next < plants.size() && i >= plants[next].first)) continue;
      const Vec3 to = next < plants.size() ? first_off[next] : last_off.back(), from = next > 0 ? last_off[next - 1] : to;
      const std::size_t left = next > 0 ? plants[next - 1].last : 0, arrives = next < plants.size() ? plants[next].first : n;
      const Real u = static_cast<Real>(i - left) / static_cast<Real>(std::max<std::size_t>(arrives - left, 1));
      target[leg][i] = feet[leg][i] + from + u * u * (3 - 2 * u) * (to - from);
    }
    walk.plants.insert(walk.plants.end(), plants.begin(), plants.end());
  }

  // Hips come down where a leg would not reach, and do so smoothly.
  std::vector<Real> drop(n, 0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t leg = 0; leg < legs.size(); ++leg) {
      const Leg& l = legs[leg];
      const Real length = kReach * (all.joints[l.knee].offset.norm() + all.joints[l.foot].offset.norm()) - 1e-4;
      const Vec3 off = world[i][l.hip].position - target[leg][i];
      const Real flat2 = off.head<2>().squaredNorm();
      if (flat2 < length * length) drop[i] = std::max(drop[i], off.z() - std::sqrt(length * length - flat2));
    }
  const int ease = static_cast<int>(std::round(kEase * o.rate));
  std::vector<Real> widest(n, 0);
  for (std::size_t i = 0; i < n; ++i)
    for (int k = -ease; k <= ease; ++k) {
      const auto j = static_cast<std::int64_t>(i) + k;
      if (j >= 0 && j < static_cast<std::int64_t>(n)) widest[i] = std::max(widest[i], drop[static_cast<std::size_t>(j)]);
    }
  drop = smoothed(widest, ease);

  for (std::size_t i = 0; i < n; ++i) {
    for (RigidPose& joint : world[i]) joint.position.z() -= drop[i];
    for (std::size_t leg = 0; leg < legs.size(); ++leg) reach(world[i], all.joints, legs[leg], target[leg][i], Vec3(std::cos(turned[i]), std::sin(turned[i]), 0));
  }
  for (const Walk::Plant& plant : walk.plants)
    for (std::size_t i = plant.first; i <= plant.last; ++i)
      walk.slide = std::max(walk.slide, (world[i][legs[plant.leg].foot].position - target[plant.leg][i]).norm());
  walk.poses = std::move(world);
  while (walk.poses.size() < samples) walk.poses.push_back(std::vector<RigidPose>(walk.poses.back()));
  return walk;
}

TriMesh make_capsule(const Vec3& end, Real radius_from, Real radius_to, int round, int cap) {
  CHECK_GE(round, 3);
  CHECK_GE(cap, 1);
  const Vec3 along = end.norm() > 0 ? Vec3(end.normalized()) : Vec3(Vec3::UnitZ()), a = along.unitOrthogonal(), b = along.cross(a);
  TriMesh mesh;
  mesh.positions.push_back(-radius_from * along);
  const auto ring = [&](const Vec3& centre, Real radius) {
    for (int q = 0; q < round; ++q) mesh.positions.push_back(centre + radius * (std::cos(2 * kPi * q / round) * a + std::sin(2 * kPi * q / round) * b));
  };
  for (int k = cap - 1; k >= 0; --k) {
    const Real angle = kPi / 2 * k / cap;
    ring(-radius_from * std::sin(angle) * along, radius_from * std::cos(angle));
  }
  for (int k = 0; k < cap; ++k) {
    const Real angle = kPi / 2 * k / cap;
    ring(end + radius_to * std::sin(angle) * along, radius_to * std::cos(angle));
  }
  mesh.positions.push_back(end + radius_to * along);
  const auto last = static_cast<Index>(mesh.positions.size() - 1);
  const auto at = [&](int k, int q) { return static_cast<Index>(1 + k * round + q % round); };
  for (int q = 0; q < round; ++q) {
    mesh.triangles.push_back({0, at(0, q + 1), at(0, q)});
    for (int k = 0; k + 1 < 2 * cap; ++k) {
      mesh.triangles.push_back({at(k, q), at(k, q + 1), at(k + 1, q + 1)});
      mesh.triangles.push_back({at(k, q), at(k + 1, q + 1), at(k + 1, q)});
    }
    mesh.triangles.push_back({at(2 * cap - 1, q), at(2 * cap - 1, q + 1), last});
  }
  return mesh;
}

std::vector<Bone> body_of(const std::vector<ClipJoint>& joints, const SkeletonPose& standing) {
  Real low = 1e300, high = -1e300;
  for (const RigidPose& joint : forward_kinematics(joints, standing)) low = std::min(low, joint.position.z()), high = std::max(high, joint.position.z());
  const Real tall = high - low;
  std::vector<Bone> bones;
  for (Index j = 1; j < joints.size(); ++j) {
    const Index p = joints[j].parent;
    const Real length = joints[j].offset.norm();
    if (length < tall / 20) continue;
    const std::string from = lower(joints[p].name), to = lower(joints[j].name);
    // Shares of the height, as people are built.
    Real thick = 0.028, thin = 0.022;
    if (has(from, {"hip", "pelvis", "spine", "chest", "torso", "abdomen"}) && has(to, {"spine", "chest", "torso", "abdomen", "neck"})) thick = 0.078, thin = 0.085;
    else if (has(from, {"head"})) thick = thin = 0.055;
    else if (has(from, {"neck"})) thick = 0.03, thin = 0.035;
    else if (has(to, {"upleg", "thigh", "hip"})) thick = 0.07, thin = 0.052;
    else if (has(from, {"upleg", "thigh"})) thick = 0.05, thin = 0.036;
    else if (has(from, {"leg", "knee", "shin"})) thick = 0.036, thin = 0.024;
    else if (has(from, {"foot", "ankle"})) thick = 0.024, thin = 0.022;
    else if (has(to, {"shoulder", "collar"}) || has(from, {"shoulder", "collar", "chest", "spine"})) thick = 0.05, thin = 0.034;
    else if (has(to, {"hand", "wrist"})) thick = 0.024, thin = 0.018;
    bones.push_back({p, joints[j].name, make_capsule(joints[j].offset, thick * tall, thin * tall)});
  }
  return bones;
}

}  // namespace effuse::geometry
