#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "geometry/base/random.h"
#include "geometry/procedural/noise.h"
#include "geometry/query/mesh_tree.h"
#include "samples/study/skin/cases.h"
#include "samples/study/skin/fill.h"
#include "skin/detail/relief.h"
#include "skin/tessellate/make_skin.h"

/// Detail that goes with the lava: rigidly where that moves rigidly, without jumps where it shears; and noise that stands in the world, which
/// does neither and shows that the measures can tell.
namespace effuse::study {

namespace {

using geometry::TriMesh;
using skin::SkinKind;

constexpr Real kRigid = 0.01, kShear = 0.05;  // the bars: of the height from valleys to crests
constexpr SkinKind kKinds[] = {SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian};
constexpr Real kTop = 3, kEdge = 0.05;  // height of the slabs; fine enough for every octave [spacings]

std::string name_of(SkinKind kind) { return std::string(skin::kSkinKindNames[static_cast<std::size_t>(kind)]); }

/// A slab of cold lava three spacings deep, `across` wide, disordered, in two material frames.
struct Slab {
  Real across;
  std::vector<Vec3> x, velocity, rest, rest2;
  std::vector<Real> radius, temperature, crust;
  std::vector<std::uint64_t> id;

  explicit Slab(Real wide) : across(wide) {
    const Box3 box(Vec3::Zero(), Vec3(across, across, kTop));
    x = fill(box, [&](const Vec3& p) { return (box.min() - p).cwiseMax(p - box.max()).maxCoeff(); }, 0, Filling::kDisorder, 7);
    for (std::size_t i = 0; i < x.size(); ++i) {
      velocity.emplace_back(0.1 - 0.02 * x[i].x(), 0.01 * x[i].y(), 0);
      rest.push_back(x[i] + Vec3(100, 20, 3));
      rest2.push_back(x[i] + Vec3(-40, 55, 0.4));
      id.push_back(1000 + i);
    }
    radius.assign(x.size(), 0.5);
    temperature.assign(x.size(), 900);
    crust.assign(x.size(), 1);
  }
  geometry::Points points(Real ratio) const {
    geometry::Points p;
    p.position = x;
    p.velocity = velocity;
    p.rest = rest;
    p.rest2 = rest2;
    p.radius = radius;
    p.temperature = temperature;
    p.crust = crust;
    p.id = id;
    p.rest_ratio = ratio;
    return p;
  }
  /// n points of its top, `margin` from the sides.
  std::vector<Vec3> top(std::uint64_t n, Real margin) const {
    std::vector<Vec3> at;
    for (std::uint64_t i = 0; i < n; ++i)
      at.emplace_back(margin + (across - 2 * margin) * random_uniform(5, 0, i), margin + (across - 2 * margin) * random_uniform(5, 1, i), kTop);
    return at;
  }
};

skin::DisplaceOptions options_of(SkinKind kind, Real ratio) {
  skin::DisplaceOptions o;
  o.spacing = 1;
  o.kind = kind;
  o.rest_ratio = ratio;
  return o;
}

/// Heights at points over a slab.
using Heights = std::function<std::vector<Real>(const Slab&, Real ratio, const std::vector<Vec3>& at)>;

Heights heights_of(SkinKind kind) {
  return [kind](const Slab& slab, Real ratio, const std::vector<Vec3>& at) {
    const skin::Relief relief(slab.points(ratio), options_of(kind, ratio));
    std::vector<Real> h;
    for (const Vec3& x : at) h.push_back(relief.at(x, kEdge).height);
    return h;
  };
}
/// Noise of the relief's wavelength that knows the place alone.
std::vector<Real> world_noise(const Slab&, Real, const std::vector<Vec3>& at) {
  std::vector<Real> h;
  for (const Vec3& x : at) h.push_back(geometry::gradient_noise(x / skin::DisplaceOptions{}.wavelength, 1));
  return h;
}

/// From valleys to crests.
Real range(const std::vector<Real>& h) {
  const auto [low, high] = std::minmax_element(h.begin(), h.end());
  return *high - *low;
}
Real largest_difference(const std::vector<Real>& a, const std::vector<Real>& b) {
  Real most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

struct Move {
  Quat turn{Eigen::AngleAxisd(0.8, Vec3::UnitZ())};
  Vec3 shift{313.7, -94.1, 12.2};
  Vec3 operator()(const Vec3& x) const { return turn * x + shift; }
  void operator()(Slab& slab) const {
    for (Vec3& x : slab.x) x = (*this)(x);
    for (Vec3& v : slab.velocity) v = turn * v;
  }
};

constexpr Real kRatio = 0.3;  // of the two material frames

/// Largest change of the height at points that are moved with the slab, over the range.
Real moved_rigidly(const Heights& heights) {
  Slab slab(12);
  std::vector<Vec3> at = slab.top(400, 3);
  const std::vector<Real> before = heights(slab, kRatio, at);
  const Move move;
  move(slab);
  for (Vec3& x : at) x = move(x);
  return largest_difference(before, heights(slab, kRatio, at)) / range(before);
}

/// The displaced mesh of the moved slab beside the moved displaced mesh: largest distance of a vertex, over the height.
Real mesh_moved_rigidly(SkinKind kind) {
  Slab slab(12);
  skin::LevelSetOptions set;
  set.spacing = 1;
  const TriMesh smooth = skin::mesh_level_set(skin::build_level_set(slab.points(kRatio), static_cast<Real>(slab.x.size()), nullptr, set));
  TriMesh here = smooth, there = smooth;
  const skin::DisplaceOptions options = options_of(kind, kRatio);
  skin::displace(here, slab.points(kRatio), nullptr, options);
  const Move move;
  move(slab);
  for (Vec3& p : there.positions) p = move(p);
  for (Vec3& n : there.normals) n = move.turn * n;
  skin::displace(there, slab.points(kRatio), nullptr, options);
  if (here.positions.size() != there.positions.size()) return std::numeric_limits<Real>::infinity();
  Real most = 0;
  for (std::size_t i = 0; i < here.positions.size(); ++i) most = std::max(most, (move(here.positions[i]) - there.positions[i]).norm());
  return most / (2 * options.amplitude);
}

/// The same with all of the skin made anew, the level set on a lattice that has not moved: mean distance between the surfaces, over the height.
///   oversample  1: with the chords of triangles as long as the finest bumps
///   amplitude   hardly any: of what is displaced
Real remade_after_moving(SkinKind kind, skin::TessellationKind tessellation, Real oversample, Real amplitude) {
  Slab slab(12);
  skin::SkinOptions options;
  options.level_set.spacing = 1;
  options.level_set.voxel = 0.5;
  options.tessellation = tessellation;
  options.detail = options_of(kind, kRatio);
  options.detail->edge = 0.25;
  options.detail->oversample = oversample;
  options.detail->amplitude = amplitude;
  const TriMesh here = skin::make_skin(slab.points(kRatio), static_cast<Real>(slab.x.size()), nullptr, options).mesh;
  const Move move;
  move(slab);
  const TriMesh there = skin::make_skin(slab.points(kRatio), static_cast<Real>(slab.x.size()), nullptr, options).mesh;
  const geometry::MeshTree tree(there.positions, there.triangles);
  Real sum = 0;
  for (const Vec3& p : here.positions) sum += tree.nearest(move(p))->distance;
  return sum / static_cast<Real>(here.positions.size()) / (2 * skin::DisplaceOptions{}.amplitude);
}

// ---- Shear ----

constexpr int kFrames = 200, kPeriod = 160;
constexpr Real kStep = 0.01;  // what neighbours pass by one another in a frame [spacings]

struct Sheared {
  Curve change;            // in per cent of the amplitude, frame by frame
  Real most = 0;           // share
  std::size_t changed = 0;  // times a point changed its region
};

/// Two hundred frames of slow shear over width and depth. Material frames are born anew in turn every 160; one particle in nine rises to
/// the top at half a per cent of a spacing, and as many sink.
Sheared sheared(const std::string& name, const Heights& heights) {
  Sheared result;
  result.change = {name, {}, {}, false, false};
  Slab slab(14);
  std::vector<Vec3> at = slab.top(200, 4.5);
  const Real middle = slab.across / 2;
  const auto velocity = [&](const Vec3& x) { return Vec3(kStep * (0.8 * (x.y() - middle) + 0.57 * (x.z() - kTop / 2) - 0.2 * (x.x() - middle)), 0, 0); };
  int born = -kPeriod / 4, born2 = -3 * kPeriod / 4;
  std::vector<Real> before, steps;
  std::vector<Index> owner(at.size());
  Real amplitude = 0;
  for (int frame = 0; frame <= kFrames; ++frame) {
    if (frame - born >= kPeriod) slab.rest = slab.x, born = frame;
    if (frame - born2 >= kPeriod) slab.rest2 = slab.x, born2 = frame;
    for (std::size_t i = 0; i < slab.x.size(); ++i) slab.velocity[i] = 25 * velocity(slab.x[i]);
    const std::vector<Real> now = heights(slab, std::abs(2.0 * (frame - born) / kPeriod - 1), at);
    if (frame > 0) steps.push_back(largest_difference(before, now));
    amplitude = std::max(amplitude, range(now));
    before = now;
    const skin::Regions regions(slab.points(0), 1);
    for (std::size_t i = 0; i < at.size(); ++i) {
      const Index p = regions.nearest(at[i]);
      result.changed += frame > 0 && p != owner[i];
      owner[i] = p;
    }
    for (std::size_t i = 0; i < slab.x.size(); ++i) {
      Vec3& x = slab.x[i];
      x += velocity(x);
      if (i % 9 == 1 && x.z() < kTop - 0.4) x.z() += kStep / 2;
      if (i % 9 == 5 && x.z() > kTop / 2) x.z() -= kStep / 2;
    }
    for (Vec3& x : at) x += velocity(x);
  }
  for (std::size_t k = 0; k < steps.size(); ++k) {
    result.most = std::max(result.most, steps[k] / amplitude);
    result.change.x.push_back(static_cast<Real>(k + 1));
    result.change.y.push_back(100 * steps[k] / amplitude);
  }
  return result;
}

CaseResult coherence() {
  CaseResult result;
  Plot plot{"skin_coherence", "Slow shear: largest change of the height from frame to frame", "frame", "change [% of the height]", false, true, {}};
  plot.curves.push_back({"bar", {1, kFrames}, {100 * kShear, 100 * kShear}, false, true});
  const auto add = [&](const std::string& what, Real value, Real bar) { result.measures.push_back({what, "", value, 0, value, bar, ""}); };
  const auto fails = [&](const std::string& what, Real value, Real bar) {
    result.measures.push_back({what + ", which must fail", "", value, bar, value > bar ? 0.0 : 1.0, 0, ""});
  };
  std::size_t changed = 0;
  std::string chords;
  for (const SkinKind kind : kKinds) {
    add(name_of(kind) + ": moved rigidly, change of the height", moved_rigidly(heights_of(kind)), kRigid);
    add(name_of(kind) + ": moved rigidly, largest error of the displaced mesh", mesh_moved_rigidly(kind), kRigid);
    const auto remade = [&](skin::TessellationKind tessellation, Real oversample) { return remade_after_moving(kind, tessellation, oversample, skin::DisplaceOptions{}.amplitude); };
    add(name_of(kind) + ": moved rigidly, mean error of a skin made anew, voronoi", remade(skin::TessellationKind::kVoronoi, 1), kRigid);
    add(name_of(kind) + ": moved rigidly, mean error of a skin made anew, levelset, oversample 4", remade(skin::TessellationKind::kLevelSet, 4), kRigid);
    chords += fmt::format("{}{:.1f} % of {}", chords.empty() ? "" : ", ", 100 * remade(skin::TessellationKind::kLevelSet, 1), name_of(kind));
    Sheared shear = sheared(name_of(kind), heights_of(kind));
    add(name_of(kind) + ": sheared, largest change in 200 frames", shear.most, kShear);
    changed = shear.changed;
    plot.curves.push_back(std::move(shear.change));
  }
  fails("noise in the world: moved rigidly, change of the height", moved_rigidly(world_noise), kRigid);
  Sheared world = sheared("noise in the world", world_noise);
  plot.curves.push_back(std::move(world.change));
  result.plots.push_back(std::move(plot));
  result.note = fmt::format("Slabs of cold lava, three spacings deep. Rigidly: turned by 46 degrees and moved by 328 spacings; \"made anew\" has its level set on a lattice that "
                            "did not move: voxels of half a spacing, bumps for edges of a quarter. The fans of voronoi lie where the particles say, and so do the edges of a quarter that they are cut into. "
                            "The mesh of levelset needs edges of a sixteenth (oversample 4; of what is displaced alone {:.2f} %): edges of a quarter "
                            "cut the finest bumps' crests off, wherever vertices happen to lie on them: {}. Sheared: 1 % of a spacing a "
                            "frame between neighbours; 200 points of the surface changed their region {} times, material frames were born three times. All in shares of the "
                            "height from valleys to crests. The shear does not tell noise that stands in the world ({:.1f} % a frame), rigid motion does.",
                            100 * remade_after_moving(kKinds[0], skin::TessellationKind::kLevelSet, 4, 1e-9), chords, changed, 100 * world.most);
  return result;
}

}  // namespace

void add_coherence_cases(std::vector<Case>& cases) {
  cases.push_back({"coherence", "Detail goes with the lava: rigid motion, 200 frames of shear", "the lava's own motion", true, coherence});
}

}  // namespace effuse::study
