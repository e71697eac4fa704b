#include "skin/preview/air.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {

using geometry::GridVolume;

constexpr int kMostSteps = 512;         // of a ray through a volume
constexpr float kOpaque = 0.004f;       // what is behind shows by less: enough
constexpr float kLeastRadius = 0.55f;   // [pixels] of a speck; smaller ones are paler instead
constexpr int kBand = 8;                // rows that a thread draws at a time
constexpr float kSoftReach = 1.0f;      // a soft speck ends at its radius
constexpr int kShadowStep = 2;          // cells a side that share one look at the sun

/// Density at every point, and how much of sun and sky gets to it through the volume itself.
class Fog {
 public:
  Fog(const Cloud& cloud, const AirView& view, const Sky& sky) : grid_(cloud.grid), color_(cloud.color.cast<float>()) {
    corner_ = (grid_.corner - view.origin).cast<float>();
    cell_ = static_cast<float>(grid_.cell);
    for (std::size_t a = 0; a < 3; ++a) {
      n_[a] = grid_.n[a];
      m_[a] = std::max(1, (n_[a] + kShadowStep - 1) / kShadowStep);
    }
    glows_ = !grid_.temperature.empty() && *std::max_element(grid_.temperature.begin(), grid_.temperature.end()) > LavaColorOptions{}.glow_from;
    light_through(sky.sun_direction(), sun_);
    light_through(Vec3f::UnitZ(), up_);
  }
  bool glows() const { return glows_; }
  const Vec3f& color() const { return color_; }
  float cell() const { return cell_; }

  /// Where a ray enters and leaves the box of cells; false: it passes by.
  bool cross(const Vec3f& from, const Vec3f& d, float& near, float& far) const {
    for (int a = 0; a < 3; ++a) {
      const float low = corner_[a], high = corner_[a] + cell_ * static_cast<float>(n_[static_cast<std::size_t>(a)]);
      if (std::abs(d[a]) < 1e-12f) {
        if (from[a] < low || from[a] > high) return false;
        continue;
      }
      const float t0 = (low - from[a]) / d[a], t1 = (high - from[a]) / d[a];
      near = std::max(near, std::min(t0, t1));
      far = std::min(far, std::max(t0, t1));
    }
    return near < far;
  }

  float density(const Vec3f& p) const { return sample(grid_.density, n_, (p - corner_) / cell_); }
  float temperature(const Vec3f& p) const { return sample(grid_.temperature, n_, (p - corner_) / cell_); }
  float sun(const Vec3f& p) const { return sample(sun_, m_, (p - corner_) / (kShadowStep * cell_)); }
  float up(const Vec3f& p) const { return sample(up_, m_, (p - corner_) / (kShadowStep * cell_)); }

 private:
  /// Trilinear between middles; as at the border beyond it.
  static float sample(const std::vector<float>& values, const std::array<int, 3>& n, const Vec3f& g) {
    int i[3], up[3];
    float f[3];
    for (int a = 0; a < 3; ++a) {
      const float q = std::clamp(g[a] - 0.5f, 0.0f, static_cast<float>(n[static_cast<std::size_t>(a)] - 1));
      i[a] = std::min(static_cast<int>(q), n[static_cast<std::size_t>(a)] - 1);
      up[a] = std::min(i[a] + 1, n[static_cast<std::size_t>(a)] - 1);
      f[a] = q - static_cast<float>(i[a]);
    }
    const auto v = [&](int x, int y, int z) { return values[(static_cast<std::size_t>(z) * static_cast<std::size_t>(n[1]) + static_cast<std::size_t>(y)) * static_cast<std::size_t>(n[0]) + static_cast<std::size_t>(x)]; };
    return mix(mix(mix(v(i[0], i[1], i[2]), v(up[0], i[1], i[2]), f[0]), mix(v(i[0], up[1], i[2]), v(up[0], up[1], i[2]), f[0]), f[1]),
               mix(mix(v(i[0], i[1], up[2]), v(up[0], i[1], up[2]), f[0]), mix(v(i[0], up[1], up[2]), v(up[0], up[1], up[2]), f[0]), f[1]), f[2]);
  }

  /// exp(-optical depth) along d to the volume's border, at the middle of each block of cells.
  void light_through(const Vec3f& d, std::vector<float>& out) const {
    out.assign(static_cast<std::size_t>(m_[0]) * static_cast<std::size_t>(m_[1]) * static_cast<std::size_t>(m_[2]), 1.0f);
    const float step = 1.5f * cell_;
    parallel_for(out.size(), [&](std::size_t c) {
      const auto mx = static_cast<std::size_t>(m_[0]), my = static_cast<std::size_t>(m_[1]);
      const Vec3f p = corner_ + kShadowStep * cell_ * Vec3f(static_cast<float>(c % mx) + 0.5f, static_cast<float>(c / mx % my) + 0.5f, static_cast<float>(c / (mx * my)) + 0.5f);
      float near = 0, far = 1e30f, depth = 0;
      if (!cross(p, d, near, far)) return;
      for (float t = step / 2; t < far && depth < 8; t += step) depth += step * density(p + t * d);
      out[c] = std::exp(-depth);
    }, 256);
  }

  const GridVolume& grid_;
  Vec3f color_, corner_;
  float cell_;
  std::array<int, 3> n_, m_;
  bool glows_ = false;
  std::vector<float> sun_, up_;
};

/// Light that has been scattered often goes farther than the straight beam: a second, longer term (Wrenninge 2013's octaves, two of them).
float soft_light(float through) { return 0.6f * through + 0.4f * std::sqrt(std::sqrt(through)); }

void draw_volume(Image& image, std::span<const float> depth, const AirView& view, const Sky& sky, const PreviewOptions& options, const Cloud& cloud) {
  if (cloud.grid.size() == 0) return;
  const Fog fog(cloud, view, sky);
  const float exposure = static_cast<float>(options.exposure);
  const Vec3f sun = sky.sun_light() * (0.55f / static_cast<float>(kPi)), open = sky.ambient(Vec3f::UnitZ()), under = sky.ambient(-Vec3f::UnitZ());
  std::vector<Vec3f> heat;  // emission by temperature, in steps of 10 K
  if (fog.glows())
    for (int k = 0; k <= 250; ++k) heat.push_back(lava_emission(10.0 * k).cast<float>());
  parallel_for(
      static_cast<std::size_t>(image.height),
      [&](std::size_t y) {
        for (int x = 0; x < image.width; ++x) {
          const std::size_t pixel = y * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x);
          const float u = 2 * (static_cast<float>(x) + 0.5f) / static_cast<float>(image.width) - 1, v = 1 - 2 * (static_cast<float>(y) + 0.5f) / static_cast<float>(image.height);
          const Vec3f d = (view.forward + u * view.right + v * view.up).normalized();
          float near = 0, far = depth[pixel];
          if (!fog.cross(view.eye, d, near, far)) continue;
          const float step = std::max(fog.cell(), (far - near) / kMostSteps);
          Vec3f gathered = Vec3f::Zero();
          float through = 1;
          const float jitter = static_cast<float>(random_uniform(options.seed + 2, 0, pixel));
          for (float t = near + jitter * step; t < far && through > kOpaque; t += step) {
            const Vec3f p = view.eye + t * d;
            const float extinction = fog.density(p);
            if (extinction <= 1e-5f) continue;
            const float stopped = -std::expm1(-extinction * std::min(step, far - near));
            Vec3f light = fog.color().cwiseProduct(soft_light(fog.sun(p)) * sun + mix(under, open, soft_light(fog.up(p))) * 0.9f);
            if (!heat.empty()) light += heat[static_cast<std::size_t>(std::clamp(fog.temperature(p) / 10, 0.0f, 250.0f))];
            gathered += through * stopped * light;
            through *= 1 - stopped;
          }
          float* rgb = &image.rgb[3 * pixel];
          for (int c = 0; c < 3; ++c) rgb[c] = through * rgb[c] + exposure * gathered[c];
        }
      },
      4);
}

/// A speck on the picture: a capsule from a to b.
struct Drawn {
  float ax, ay, bx, by, radius;  // [pixels]
  float distance, reach;         // of its middle [m]; its radius [m]
  Vec3f color, glow;
  float opacity;
  bool soft;
};

void draw_specks(Image& image, std::span<const float> depth, const AirView& view, const Sky& sky, const PreviewOptions& options, std::span<const Speck> specks) {
  const auto width = static_cast<float>(image.width), height = static_cast<float>(image.height);
  const float right2 = view.right.squaredNorm(), up2 = view.up.squaredNorm(), exposure = static_cast<float>(options.exposure);
  // A ball's mean light: half of it sees the sun.
  const Vec3f shine = sky.sun_light() * (0.4f / static_cast<float>(kPi)) + sky.ambient(Vec3f(0, 0, 0.3f));
  std::vector<Drawn> drawn;
  drawn.reserve(specks.size());
  for (const Speck& s : specks) {
    const Vec3f middle = (s.position - view.origin).cast<float>() - view.eye, half = 0.5f * s.streak.cast<float>();
    const float distance = middle.norm(), ahead = middle.dot(view.forward);
    if (!(ahead > 0.02f * distance) || ahead < 2 * static_cast<float>(s.radius)) continue;  // behind, or in the lens
    const auto pixel = [&](const Vec3f& p, float& x, float& y) {
      const float z = std::max(p.dot(view.forward), 0.5f * ahead);
      x = (0.5f + 0.5f * p.dot(view.right) / (right2 * z)) * width;
      y = (0.5f - 0.5f * p.dot(view.up) / (up2 * z)) * height;
    };
    Drawn one;
    pixel(middle - half, one.ax, one.ay);
    pixel(middle + half, one.bx, one.by);
    one.reach = static_cast<float>(s.radius);
    const float true_radius = one.reach / (ahead * view.pixel_angle);
    one.radius = std::max(kLeastRadius, true_radius);
    const float length = std::hypot(one.bx - one.ax, one.by - one.ay);
    // What is spread over more pixels than it covers is so much paler; but glints are seen that are smaller than a pixel.
    const float spread = static_cast<float>(kPi) * one.radius / (static_cast<float>(kPi) * one.radius + 2 * length);
    const float covered = std::min(1.0f, true_radius / one.radius);
    one.opacity = static_cast<float>(s.opacity) * spread * covered * covered;
    one.distance = distance;
    one.color = s.color.cast<float>().cwiseProduct(shine);
    one.glow = s.glow.cast<float>() * (s.soft ? static_cast<float>(s.opacity) : std::sqrt(spread) * covered);
    one.soft = s.soft;
    const float edge = one.radius + 1;
    if (std::max(one.ax, one.bx) < -edge || std::min(one.ax, one.bx) > width + edge || std::max(one.ay, one.by) < -edge || std::min(one.ay, one.by) > height + edge) continue;
    drawn.push_back(one);
  }
  std::stable_sort(drawn.begin(), drawn.end(), [](const Drawn& a, const Drawn& b) { return a.distance > b.distance; });

  const std::size_t bands = (static_cast<std::size_t>(image.height) + kBand - 1) / kBand;
  parallel_for(
      bands,
      [&](std::size_t band) {
        const int y0 = static_cast<int>(band) * kBand, y1 = std::min(y0 + kBand, image.height);
        for (const Drawn& s : drawn) {
          const float edge = s.radius + 1;
          if (std::max(s.ay, s.by) + edge < static_cast<float>(y0) || std::min(s.ay, s.by) - edge > static_cast<float>(y1)) continue;
          const int low_y = std::max(y0, static_cast<int>(std::floor(std::min(s.ay, s.by) - edge))), high_y = std::min(y1 - 1, static_cast<int>(std::ceil(std::max(s.ay, s.by) + edge)));
          const int low_x = std::max(0, static_cast<int>(std::floor(std::min(s.ax, s.bx) - edge))), high_x = std::min(image.width - 1, static_cast<int>(std::ceil(std::max(s.ax, s.bx) + edge)));
          const float dx = s.bx - s.ax, dy = s.by - s.ay, length2 = dx * dx + dy * dy;
          for (int y = low_y; y <= high_y; ++y)
            for (int x = low_x; x <= high_x; ++x) {
              const std::size_t pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x);
              // The share of it that is before what the pixel shows.
              const float before = s.soft ? saturate((depth[pixel] - s.distance + s.reach) / (2 * s.reach)) : depth[pixel] > s.distance - s.reach ? 1.0f : 0.0f;
              if (before <= 0) continue;
              const float px = static_cast<float>(x) + 0.5f - s.ax, py = static_cast<float>(y) + 0.5f - s.ay;
              const float along = length2 > 0 ? saturate((px * dx + py * dy) / length2) : 0;
              const float off = std::hypot(px - along * dx, py - along * dy);
              float shape;
              if (s.soft) {
                const float q = 1 - off * off / (s.radius * s.radius * kSoftReach);
                shape = q > 0 ? q * q : 0;
              } else {
                shape = saturate(s.radius - off + 0.5f);
              }
              if (shape <= 0) continue;
              const float cover = s.glow.isZero() ? shape * s.opacity * before : s.soft ? 0 : shape * s.opacity * before;
              float* rgb = &image.rgb[3 * pixel];
              for (int c = 0; c < 3; ++c) rgb[c] = rgb[c] * (1 - cover) + exposure * (cover * s.color[c] + shape * before * s.glow[c]);
            }
        }
      },
      1);
}

}  // namespace

void draw_air(Image& image, std::span<const float> depth, const AirView& view, const Sky& sky, const PreviewOptions& options, const Air& air) {
  ZONE("preview.air");
  for (const Cloud& cloud : air.clouds) draw_volume(image, depth, view, sky, options, cloud);
  draw_specks(image, depth, view, sky, options, air.specks);
}

}  // namespace effuse::skin
