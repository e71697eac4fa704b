#include "skin/surface/particle_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/detail/blend.h"
#include "skin/surface/clones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

namespace {

using Row = float __attribute__((vector_size(kSide * sizeof(float))));
using Eigen::Vector3f;

constexpr int kRows = 3;                          // of eight points: 1 + 6 + 12 in the tangent plane, one over and one under the middle
constexpr int kOver = 19, kUnder = 20;
constexpr float kInner = 0.98f, kOuter = 2.07f;   // the rings' radii, in deviations of the Gaussian
constexpr float kMiddleWeight = 0.1f, kInnerWeight = 0.5625f, kOuterWeight = 0.3375f;
constexpr float kLeastDeviation = 0.15f;          // [spacings] slopes are taken over this where nothing is smoothed
constexpr float kOverMiddle = 0.25f;              // [spacings]
constexpr int kMostSteps = 6;                     // two or three serve almost everywhere
constexpr float kCloseEnough = 5e-4f;             // [spacings]
constexpr float kMostMoved = 0.5f, kFreely = 0.25f;  // [spacings] points go so far, and up to this all the way
constexpr float kLeastSlope = 0.3f, kFullSlope = 0.5f;  // where the field is flatter it is a crease, a neck or a thin sheet
constexpr float kLeastSlant = 0.5f;               // cosine between a line and the normal
constexpr float kGathered = 0.15f;                // [spacings] particles are looked for anew when a point has gone so far
constexpr float kSoft = 0.04f;                    // [spacings] how round balls meet one another
constexpr float kBound = 1.15f, kBoundSlope = 3;  // as in rasterize.cpp

struct Stencil {
  std::array<float, 8 * kRows> a{}, b{}, c{};     // places along two tangents and the normal [voxels]
  std::array<float, 8 * kRows> weight{};
  float spread = 0;                               // sum weight a^2, the same for b

  explicit Stencil(const FieldRule& rule) {
    const float deviation = std::max(std::sqrt(2 * rule.smoothing), kLeastDeviation * rule.raster.spacing);
    weight[0] = kMiddleWeight;
    const auto ring = [&](int first, int n, float radius, float share) {
      for (int k = 0; k < n; ++k) {
        const auto at = static_cast<std::size_t>(first + k);
        const double angle = 2 * kPi * k / n;
        a[at] = radius * deviation * static_cast<float>(std::cos(angle));
        b[at] = radius * deviation * static_cast<float>(std::sin(angle));
        weight[at] = share / static_cast<float>(n);
      }
    };
    ring(1, 6, kInner, kInnerWeight);
    ring(7, 12, kOuter, kOuterWeight);
    c[kOver] = kOverMiddle * rule.raster.spacing;
    c[kUnder] = -c[kOver];
    for (std::size_t q = 0; q < a.size(); ++q) spread += weight[q] * a[q] * a[q];
  }
  float farthest(const FieldRule& rule) const { return std::max(a[7], kOverMiddle * rule.raster.spacing); }
};

/// Particles near a point, counted from it [voxels].
struct Near {
  std::vector<float> x, y, z, r;
  std::vector<Vector3f> ball;
  std::vector<float> ball_radius;
};

/// phi at eight points, W there.
EFFUSE_CLONES void field_at(const Near& near, const RasterOptions& o, const float* px, const float* py, const float* pz, float* phi, float* weight) {
  Row x, y, z;
  std::memcpy(&x, px, sizeof x);
  std::memcpy(&y, py, sizeof y);
  std::memcpy(&z, pz, sizeof z);
  const Row zero{};
  const float inverse_R2 = 1 / (o.reach * o.reach);
  Row W = zero, wx = zero, wy = zero, wz = zero, wr = zero, nearest = zero + o.reach * o.reach;
  for (std::size_t c = 0; c < near.x.size(); ++c) {
    const Row dx = near.x[c] - x, dy = near.y[c] - y, dz = near.z[c] - z;
    const Row d2 = dx * dx + dy * dy + dz * dz;
    Row t = 1 - d2 * inverse_R2;
    t = t > zero ? t : zero;
    const Row w = t * t * t;
    W += w;
    wx += w * dx;
    wy += w * dy;
    wz += w * dz;
    wr += w * near.r[c];
    nearest = d2 < nearest ? d2 : nearest;
  }
  for (int k = 0; k < 8; ++k) {
    weight[k] = W[k];
    phi[k] = o.outside;
    if (W[k] < 1e-9f) continue;
    const float to_mean = std::sqrt(wx[k] * wx[k] + wy[k] * wy[k] + wz[k] * wz[k]) / W[k];
    phi[k] = std::min(o.outside, std::max(to_mean - o.radius_factor * wr[k] / W[k], kBoundSlope * (std::sqrt(nearest[k]) - kBound * o.spacing)));
  }
}

struct Slope {
  float value;
  Vector3f gradient, smooth;  ///< of f, and of phi_s alone
};

Slope slope_at(const Near& near, const FieldRule& rule, const Stencil& s, const Vector3f& x, const Vector3f& n) {
  const Vector3f t1 = n.unitOrthogonal(), t2 = n.cross(t1);
  std::array<float, 8 * kRows> px, py, pz, phi, weight;
  for (std::size_t q = 0; q < px.size(); ++q) {
    px[q] = x.x() + s.a[q] * t1.x() + s.b[q] * t2.x() + s.c[q] * n.x();
    py[q] = x.y() + s.a[q] * t1.y() + s.b[q] * t2.y() + s.c[q] * n.y();
    pz[q] = x.z() + s.a[q] * t1.z() + s.b[q] * t2.z() + s.c[q] * n.z();
  }
  for (std::size_t row = 0; row < kRows; ++row) field_at(near, rule.raster, &px[8 * row], &py[8 * row], &pz[8 * row], &phi[8 * row], &weight[8 * row]);
  float mean = 0, along1 = 0, along2 = 0;
  for (std::size_t q = 0; q < px.size(); ++q) {
    mean += s.weight[q] * phi[q];
    along1 += s.weight[q] * s.a[q] * phi[q];
    along2 += s.weight[q] * s.b[q] * phi[q];
  }
  const float share = rule.smoothing > 0 ? smoothing_share(rule, weight[0]) : 0;
  Slope out;
  out.value = phi[0] + share * (mean - phi[0]);
  out.smooth = (along1 * t1 + along2 * t2) / s.spread + (phi[kOver] - phi[kUnder]) / (2 * s.c[kOver]) * n;
  out.gradient = out.smooth;

  // The nearest ball, softly: b = -soft log sum exp(-b_k / soft), or creases between balls would stand in Newton's way.
  const float soft = kSoft * rule.raster.spacing;
  float ball = 1e9f;
  for (std::size_t k = 0; k < near.ball.size(); ++k) ball = std::min(ball, (x - near.ball[k]).norm() - near.ball_radius[k]);
  const float blend = rule.cover.blend;
  if (ball - out.value > blend + 2 * soft) return out;
  float sum = 0;
  Vector3f outward = Vector3f::Zero();
  for (std::size_t k = 0; k < near.ball.size(); ++k) {
    const Vector3f from = x - near.ball[k];
    const float distance = from.norm(), beyond = distance - near.ball_radius[k] - ball;
    if (beyond > 12 * soft || !(distance > 0)) continue;
    const float w = std::exp(-beyond / soft);
    sum += w;
    outward += w / distance * from;
  }
  if (!(sum > 0)) return out;
  ball -= soft * std::log(sum);
  outward /= sum;
  const float apart = std::max(0.0f, blend - std::abs(out.value - ball));
  const float of_ball = (out.value < ball ? apart : 2 * blend - apart) / (2 * blend);
  out.value = std::min(out.value, ball) - apart * apart / (4 * blend);
  out.gradient = (1 - of_ball) * out.smooth + of_ball * outward;
  return out;
}

/// Particles within reach of start + at, counted from start.
void gather(const LevelSet::Impl& s, const std::vector<float>& balls, const Vec3& start, const Vector3f& at, Real reach, Near& near) {
  for (auto* v : {&near.x, &near.y, &near.z, &near.r, &near.ball_radius}) v->clear();
  near.ball.clear();
  const Vec3 middle = start + at.cast<Real>(), margin = Vec3::Constant(reach);
  s.particles.runs(middle - margin, middle + margin, [&](Index from, Index to) {
    for (Index j = from; j < to; ++j) {
      const Vec3& p = s.particles.x()[j];
      if ((p - middle).squaredNorm() >= reach * reach) continue;
      const Vector3f x = (p - start).cast<float>();
      near.x.push_back(x.x());
      near.y.push_back(x.y());
      near.z.push_back(x.z());
      near.r.push_back(s.particles.radius()[j]);
      if (balls[j] <= 0) continue;
      near.ball.push_back(x);
      near.ball_radius.push_back(balls[j]);
    }
  });
}

}  // namespace

ParticleSurface::ParticleSurface(const LevelSet& surface) : surface_(surface) {
  const LevelSet::Impl& s = surface.impl();
  ball_ = s.rule.kernel == SurfaceKernel::kRound ? ball_radii(s.particles, s.rule.cover) : std::vector<float>(s.particles.size(), 0);
}

/// along(i, n): the direction in which point i goes where the field's unit gradient is n.
template <class F>
void ParticleSurface::move(std::span<Vec3> x, std::span<Vec3> normals, std::span<Real> share, F&& along) const {
  ZONE("skin.particle_surface");
  CHECK_EQ(x.size(), normals.size());
  std::fill(share.begin(), share.end(), Real{0});
  const LevelSet::Impl& s = surface_.impl();
  if (s.particles.size() == 0 || s.rule.kernel != SurfaceKernel::kRound) return;
  const Stencil stencil(s.rule);
  const float d = s.rule.raster.spacing, margin = kGathered * d, most = kMostMoved * d;
  const Real reach = static_cast<Real>(s.reach + stencil.farthest(s.rule) + margin);
  const float level = static_cast<float>(s.level);
  parallel_ranges(x.size(), 64, [&](std::size_t begin, std::size_t end) {
    Near near;
    for (std::size_t i = begin; i < end; ++i) {
      Real allowed = 1;
      if (s.terrain) {
        const geometry::Contact contact = s.terrain->contact(x[i], 2 * s.spacing);
        if (contact.any()) allowed = smoothstep(0.5 * s.spacing, s.spacing, contact.distance);
        if (!(allowed > 0)) continue;
      }
      const Vec3 start = (x[i] - s.particles.origin()) / s.voxel;
      Vector3f at = Vector3f::Zero(), gathered_at = at, frame = normals[i].cast<float>();
      gather(s, ball_, start, at, reach, near);
      const Vector3f first = frame;
      Vector3f normal = frame;
      bool good = true, close = false;
      float slope = 1;
      for (int step = 0; step < kMostSteps && good && !close; ++step) {
        const Slope now = slope_at(near, s.rule, stencil, at, frame);
        const float length = now.gradient.norm();
        good = length > kLeastSlope && now.gradient.dot(first) > 0.5f * length && now.smooth.dot(first) > kLeastSlope / 2;
        if (!good) break;
        slope = length;
        normal = now.gradient / length;
        frame = now.smooth.normalized();
        const Vector3f direction = along(i, normal);
        const float slant = direction.dot(normal);
        good = slant > kLeastSlant;
        if (!good) break;
        const float way = (now.value - level) / (length * slant);
        at -= way * direction;
        close = std::abs(way) < kCloseEnough * d;
        good = at.norm() < most;
        if (good && !close && (at - gathered_at).norm() > margin) gather(s, ball_, start, gathered_at = at, reach, near);
      }
      if (!good) continue;
      allowed *= 1 - smoothstep(static_cast<Real>(kFreely * d), static_cast<Real>(most), static_cast<Real>(at.norm()));
      allowed *= smoothstep(static_cast<Real>(kLeastSlope), static_cast<Real>(kFullSlope), static_cast<Real>(slope));
      x[i] += allowed * s.voxel * at.cast<Real>();
      normals[i] = (normals[i] + allowed * (normal.cast<Real>() - normals[i])).normalized();
      if (!share.empty()) share[i] = allowed;
    }
  });
}

Real ParticleSurface::spacing() const { return surface_.impl().spacing; }

void ParticleSurface::project(std::span<Vec3> x, std::span<Vec3> normals) const {
  move(x, normals, {}, [](std::size_t, const Vector3f& normal) { return normal; });
}

void ParticleSurface::project_along(std::span<Vec3> x, std::span<Vec3> normals, std::span<const Vec3> along, std::span<Real> share) const {
  CHECK_EQ(x.size(), along.size());
  CHECK(share.empty() || share.size() == x.size());
  move(x, normals, share, [&](std::size_t i, const Vector3f&) -> Vector3f { return along[i].cast<float>(); });
}

void ParticleSurface::project(geometry::TriMesh& mesh) const {
  CHECK_EQ(mesh.normals.size(), mesh.positions.size());
  std::vector<Vec3> x = mesh.positions, normals = mesh.normals;
  project(x, normals);
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<std::uint8_t> turned(mesh.triangles.size());
    parallel_for(mesh.triangles.size(), [&](std::size_t t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const auto& p = mesh.positions;
      const Vec3 before = (p[b] - p[a]).cross(p[c] - p[a]), after = (x[b] - x[a]).cross(x[c] - x[a]);
      turned[t] = before.dot(after) <= 0.1 * before.norm() * after.norm() && x[a] + x[b] + x[c] != p[a] + p[b] + p[c];
    });
    std::vector<std::uint8_t> held(x.size(), 0);
    for (std::size_t t = 0; t < turned.size(); ++t)
      if (turned[t])
        for (const Index v : mesh.triangles[t]) held[v] = 1;
    if (std::find(held.begin(), held.end(), std::uint8_t{1}) == held.end()) break;
    for (std::size_t v = 0; v < held.size(); ++v) {
      if (!held[v]) continue;
      x[v] = round + 2 < kRounds ? Vec3((x[v] + mesh.positions[v]) / 2) : mesh.positions[v];
      normals[v] = mesh.normals[v];
    }
  }
  mesh.positions = std::move(x);
  mesh.normals = std::move(normals);
}

}  // namespace effuse::skin
