#include "skin/preview/preview.h"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"
#include "skin/color/lava_color.h"
#include "skin/preview/air.h"
#include "skin/preview/bloom.h"
#include "skin/preview/glow_field.h"
#include "skin/preview/ground.h"
#include "skin/preview/ground_texture.h"
#include "skin/preview/light.h"
#include "skin/preview/sky.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

using geometry::TriMesh;

namespace {

constexpr unsigned kGroundId = 0, kLavaId = 1;
constexpr int kPacket = 8;
constexpr float kMoltenGloss = 0.5f;
constexpr float kShadowLift = 0.1f;  // [terrain edges] what is lower casts no shadow of the ground's
// Root mean square slope, each way, of ripples too short for a water's mesh: that of a light air, by Cox and Munk 1954, J. Opt. Soc. Am. 44, 838-850.
constexpr float kRipples = 0.06f;
constexpr float kBrightest = 3;  // of what they mirror; white paper in the sun is 1: few facets that meet molten lava are grain
constexpr int kFacets = 3;  // of them that a sample meets
constexpr float kFar = std::numeric_limits<float>::infinity();

struct ReleaseDevice {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DevicePtr = std::unique_ptr<RTCDeviceTy, ReleaseDevice>;
using ScenePtr = std::unique_ptr<RTCSceneTy, ReleaseScene>;

[[noreturn]] void embree_failed(RTCDevice device, const char* what) {
  const RTCError code = rtcGetDeviceError(device);
  if (code == RTC_ERROR_OUT_OF_MEMORY) throw ResourceError(fmt::format("not enough memory to {}", what));
  throw std::runtime_error(fmt::format("Embree cannot {} (error {})", what, static_cast<int>(code)));
}

/// A tree over triangles. One thread builds: with more, the order of triangles in a leaf is a matter of chance, and with
/// it which of two neighbours a ray through their common edge hits.
ScenePtr build_scene(RTCDevice device, std::span<const Vec3f> positions, std::span<const geometry::Triangle> triangles, unsigned id,
                     RTCBuildQuality quality) {
  const ThreadLimit one(1);
  ScenePtr scene(rtcNewScene(device));
  if (!scene) embree_failed(device, "make a scene");
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);  // no ray slips through an edge
  rtcSetSceneBuildQuality(scene.get(), quality);
  if (!triangles.empty()) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    // Embree's own buffers: it reads 16 bytes at a 12-byte vertex, beyond the end of ours.
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), positions.size()));
    auto* indices = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), triangles.size()));
    if (!vertices || !indices) {
      rtcReleaseGeometry(geometry);
      embree_failed(device, "hold the triangles of a picture");
    }
    for (const Vec3f& p : positions) vertices = std::copy_n(p.data(), 3, vertices);
    for (const geometry::Triangle& t : triangles) indices = std::copy_n(t.data(), 3, indices);
    rtcSetGeometryBuildQuality(geometry, quality);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene.get(), geometry, id);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene.get());
  if (const RTCError code = rtcGetDeviceError(device); code != RTC_ERROR_NONE)
    throw std::runtime_error(
        fmt::format("Embree cannot build its tree of {} triangles (error {})", triangles.size(), static_cast<int>(code)));
  return scene;
}

/// True when anything of the scene lies on the segment from p along d, from `near` to `far`.
bool occluded(RTCScene scene, const Vec3f& p, const Vec3f& d, float near, float far) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray{};
  ray.org_x = p.x(), ray.org_y = p.y(), ray.org_z = p.z();
  ray.dir_x = d.x(), ray.dir_y = d.y(), ray.dir_z = d.z();
  ray.tnear = near, ray.tfar = far;
  ray.mask = ~0u;
  rtcOccluded1(scene, &context, &ray);
  return ray.tfar < 0;
}

/// Share of the sky that each terrain vertex sees, cosine-weighted (1 outside the terrain).
std::vector<float> sky_visibility(RTCScene scene, const Ground& ground) {
  ZONE("preview.sky_visibility");
  std::vector<float> visible(ground.positions.size(), 1.0f);
  const std::size_t n = ground.terrain_vertices;
  if (n == 0) return visible;
  const int across = n > 400000 ? 3 : n > 50000 ? 5 : 8;  // rays: across^2
  parallel_for(
      n,
      [&](std::size_t v) {
        const Vec3f& normal = ground.normals[v];
        const Vec3f side = (std::abs(normal.x()) < 0.7f ? Vec3f::UnitX() : Vec3f::UnitY()).cross(normal).normalized(),
                    other = normal.cross(side);
        int open = 0;
        for (int k = 0; k < across * across; ++k) {
          const std::uint64_t index = v * 64 + static_cast<std::uint64_t>(k);
          const float r2 = (static_cast<float>(k % across) + static_cast<float>(random_uniform(1, 0, index))) / static_cast<float>(across);
          const float a = 2 * static_cast<float>(kPi) * (static_cast<float>(k / across) + static_cast<float>(random_uniform(1, 1, index))) /
                          static_cast<float>(across);
          const float r = std::sqrt(r2);
          const Vec3f d = r * std::cos(a) * side + r * std::sin(a) * other + std::sqrt(1 - r2) * normal;
          open += !occluded(scene, ground.positions[v], d, 0.25f * ground.edge, 1.5f * ground.radius);
        }
        visible[v] = static_cast<float>(open) / static_cast<float>(across * across);
      },
      64);
  // Average over the triangles around: what is left of the rays' noise.
  std::vector<float> sum(visible.size(), 0), count(visible.size(), 0);
  for (const geometry::Triangle& t : ground.triangles) {
    const float all = visible[t[0]] + visible[t[1]] + visible[t[2]];
    for (const Index v : t) {
      sum[v] += all;
      count[v] += 3;
    }
  }
  for (std::size_t v = 0; v < n; ++v)
    if (count[v] > 0) visible[v] = sum[v] / count[v];
  return visible;
}

/// The lava of one picture, in the ground's frame.
struct Lava {
  std::vector<Vec3f> positions, normals, reflected, glow;
  std::vector<float> water;  // [m] one sees into it; 0: rock. Empty: no water anywhere
  std::vector<float> fresh;  // 0 cold or crusted .. 1 molten film
  std::span<const geometry::Triangle> triangles;
};

Lava take_lava(const TriMesh& mesh, const Vec3& origin) {
  require_well_formed("the lava of the preview", mesh);
  const std::size_t n = mesh.positions.size();
  Lava lava;
  lava.triangles = mesh.triangles;
  lava.positions.resize(n);
  lava.normals.resize(n);
  lava.reflected.assign(n, Vec3f(0.04f, 0.034f, 0.03f));
  lava.glow.assign(n, Vec3f::Zero());
  const std::vector<Vec3> normals = unit_normals(mesh);
  const geometry::VertexAttribute* color = find_color(mesh);
  const auto found = mesh.attributes.find("glow");
  const geometry::VertexAttribute* glow = found != mesh.attributes.end() && found->second.width == 3 ? &found->second : nullptr;
  const auto scalar = [&](const char* name) -> const std::vector<float>* {
    const auto at = mesh.attributes.find(name);
    return at != mesh.attributes.end() && at->second.width == 1 ? &at->second.values : nullptr;
  };
  const std::vector<float>*temperature = scalar("temperature"), *crust = scalar("crust");
  lava.fresh.assign(n, 0.0f);
  if (const std::vector<float>* water = scalar("water")) lava.water = *water;
  parallel_for(n, [&](std::size_t i) {
    lava.positions[i] = (mesh.positions[i] - origin).cast<float>();
    lava.normals[i] = normals[i].cast<float>();
    if (temperature) lava.fresh[i] = smooth(1000, 1300, (*temperature)[i]) * (crust ? 1 - saturate((*crust)[i]) : 1);
    if (glow) lava.glow[i] = Vec3f(glow->values[3 * i], glow->values[3 * i + 1], glow->values[3 * i + 2]).cwiseMax(0);
    if (color) {
      // The display colour holds the emission too: off with it.
      const Vec3f display(color->values[3 * i], color->values[3 * i + 1], color->values[3 * i + 2]);
      lava.reflected[i] = (display - display_emission(lava.glow[i].cast<Real>()).cast<float>()).cwiseMax(0.008f).cwiseMin(1);
    }
  });
  return lava;
}

/// Light of the lava and of what glows in the air: of each speck a triangle as wide as its disk.
GlowField glow_of(const Lava& lava, const Air& air, const Vec3& origin, const GlowField::Surroundings& surroundings) {
  constexpr float kCorner = 1.5551f;  // [radii] of a triangle of a disk's area from its middle
  std::vector<Vec3f> positions(lava.positions), glow(lava.glow);
  std::vector<geometry::Triangle> triangles(lava.triangles.begin(), lava.triangles.end());
  for (const Speck& s : air.specks) {
    if (s.glow.isZero()) continue;
    const auto first = static_cast<Index>(positions.size());
    triangles.push_back({first, first + 1, first + 2});
    for (int k = 0; k < 3; ++k) {
      const float turn = 2 * static_cast<float>(kPi) * static_cast<float>(k) / 3, r = kCorner * static_cast<float>(s.radius);
      positions.push_back((s.position - origin).cast<float>() + r * Vec3f(std::cos(turn), std::sin(turn), 0));
      glow.push_back(s.glow.cast<float>() * static_cast<float>(s.opacity));
    }
  }
  return GlowField(positions, triangles, glow, surroundings);
}

/// What a sample sees, before it is known whether the sun reaches it.
struct Surface {
  bool hit = false, is_lava = false;
  Vec3f position, normal, albedo, emission;
  Vec3f geometric;  ///< the triangle's normal, towards the viewer
  float distance = 0, sky = 1, gloss = 0;
  float water = 0;  ///< [m] one sees into it
};

/// Rays of the picture: where sample s of pixel (x, y) goes.
class Lens {
 public:
  explicit Lens(const PreviewOptions& options, const Vec3& origin) : options_(options) {
    eye_ = (options.camera.eye - origin).cast<float>();
    const Vec3 forward = (options.camera.target - options.camera.eye).normalized();
    // Straight up or down: north is up in the picture.
    const Vec3 right =
        (forward.cross(Vec3::UnitZ()).norm() > 1e-6 ? forward.cross(Vec3::UnitZ()) : forward.cross(Vec3::UnitY())).normalized();
    const Real tangent = std::tan(options.camera.field_of_view / 2);
    forward_ = forward.cast<float>();
    up_ = (tangent * right.cross(forward)).cast<float>();
    right_ = (tangent * options.width / options.height * right).cast<float>();
    across_ = std::max(1, static_cast<int>(std::sqrt(static_cast<Real>(options.samples))));
    down_ = (options.samples + across_ - 1) / across_;
    pixel_angle_ = static_cast<float>(2 * tangent / options.height);
  }
  const Vec3f& eye() const { return eye_; }
  AirView view(const Vec3& origin) const { return {origin, eye_, forward_, right_, up_, pixel_angle_}; }
  /// Size of a pixel at a distance of 1.
  float pixel_angle() const { return pixel_angle_; }
  Vec3f direction(int x, int y, int s) const {
    const std::uint64_t pixel = static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(options_.width) + static_cast<std::uint64_t>(x);
    const std::uint64_t bits = random_bits(options_.seed, pixel, static_cast<std::uint64_t>(s));
    const float jx = static_cast<float>(bits >> 40) * 0x1p-24f, jy = static_cast<float>(bits >> 16 & 0xffffff) * 0x1p-24f;
    const float sx = (static_cast<float>(s % across_) + jx) / static_cast<float>(across_),
                sy = (static_cast<float>(s / across_) + jy) / static_cast<float>(down_);
    const float u = 2 * (static_cast<float>(x) + sx) / static_cast<float>(options_.width) - 1,
                v = 1 - 2 * (static_cast<float>(y) + sy) / static_cast<float>(options_.height);
    return (forward_ + u * right_ + v * up_).normalized();
  }

 private:
  const PreviewOptions& options_;
  Vec3f eye_, forward_, right_, up_;
  int across_, down_;
  float pixel_angle_;
};

void require_sane(const PreviewOptions& o) {
  const auto fail = [](const std::string& message) { throw InputError({"preview"}, message); };
  if (o.width < 1 || o.height < 1 || o.width > 16384 || o.height > 16384)
    fail(fmt::format("picture of {} x {} pixels, wanted 1 .. 16384 a side", o.width, o.height));
  if (o.samples < 1 || o.samples > 1024) fail(fmt::format("{} samples a pixel, wanted 1 .. 1024", o.samples));
  const Camera& c = o.camera;
  if (!c.eye.allFinite() || !c.target.allFinite() || !((c.target - c.eye).norm() > 0))
    fail("the camera's eye and target must be finite and apart");
  if (!(c.field_of_view > 0 && c.field_of_view < kPi))
    fail(fmt::format("field of view {} rad, wanted more than 0 and less than pi", c.field_of_view));
  if (!o.sun_direction.allFinite() || !(o.sun_direction.norm() > 0)) fail("the direction to the sun must be finite and have a length");
  for (const auto& [name, value] : {std::pair{"sun", o.sun},
                                    {"sky", o.sky},
                                    {"exposure", o.exposure},
                                    {"haze", o.haze},
                                    {"bloom", o.bloom},
                                    {"glow_light", o.glow_light}})
    if (!(value >= 0 && value <= 1e6)) fail(fmt::format("{} is {}, wanted 0 or more", name, value));
  if (!(o.gloss >= 0 && o.gloss <= 1)) fail(fmt::format("gloss is {}, wanted 0 to 1", o.gloss));
}

}  // namespace

struct Preview::Impl {
  Ground ground;
  DevicePtr device;
  ScenePtr scene;
  std::vector<float> sky_visibility;
};

namespace {

/// All that a picture's pixels are made from.
struct Picture {
  const Ground& ground;
  const std::vector<float>& sky_visibility;
  RTCScene ground_scene, lava_scene;
  const Lava& lava;
  const GlowField& glow_field;
  const Sky& sky;
  const Lens& lens;
  const PreviewOptions& options;

  /// Values of the three corners, weighted by the hit's barycentric coordinates.
  template <class T>
  static T at_hit(const std::vector<T>& values, const geometry::Triangle& t, float u, float v) {
    return values[t[0]] * (1 - u - v) + values[t[1]] * u + values[t[2]] * v;
  }

  Surface surface_at(unsigned id, unsigned primitive, float u, float v, float distance, const Vec3f& d, Vec3f geometric) const {
    return surface_at(id, primitive, u, v, lens.eye() + distance * d, distance, d, geometric);
  }
  Surface surface_at(unsigned id, unsigned primitive, float u, float v, const Vec3f& position, float distance, const Vec3f& d, Vec3f geometric) const {
    Surface s;
    s.hit = true;
    s.distance = distance;
    s.position = position;
    geometric.normalize();
    s.geometric = geometric.dot(d) > 0 ? Vec3f(-geometric) : geometric;
    if (id == kLavaId) {
      const geometry::Triangle& t = lava.triangles[primitive];
      s.is_lava = true;
      s.normal = at_hit(lava.normals, t, u, v);
      s.albedo = at_hit(lava.reflected, t, u, v);
      s.emission = at_hit(lava.glow, t, u, v);
      s.gloss = std::max(static_cast<float>(options.gloss), kMoltenGloss * at_hit(lava.fresh, t, u, v));
      s.normal = s.normal.squaredNorm() > 1e-8f ? s.normal.normalized() : s.geometric;
      if (geometric.dot(d) > 0) s.normal = -s.normal;  // seen from behind
      if (!lava.water.empty()) s.water = at_hit(lava.water, t, u, v);
    } else {
      const geometry::Triangle& t = ground.triangles[primitive];
      const Vec3f normal = at_hit(ground.normals, t, u, v);
      const float altitude = saturate((s.position.z() - ground.low) / (ground.high - ground.low));
      // A pixel's size on the ground: longer where it is seen at a slant, but noise would rather shimmer than vanish.
      const float slant = std::max(0.15f, std::abs(s.geometric.dot(d)));
      const GroundLook look = ground_look(s.position, normal.squaredNorm() > 1e-8f ? normal.normalized() : s.geometric, altitude,
                                          0.6f * distance * lens.pixel_angle() / slant, ground.radius);
      s.albedo = look.albedo;
      s.normal = geometric.dot(d) > 0 ? Vec3f(-look.normal) : look.normal;
      s.emission = Vec3f::Zero();
      s.sky = at_hit(sky_visibility, t, u, v);
    }
    return s;
  }

  /// Light from the surface towards the eye; `lit`: the sun reaches it.
  Vec3f radiance(const Surface& s, const Vec3f& d, bool lit) const {
    const Vec3f& to_sun = sky.sun_direction();
    const float facing = std::max(0.0f, s.normal.dot(to_sun));
    Vec3f light = s.albedo.cwiseProduct(sky.ambient(s.normal) * s.sky);
    if (lit) light += s.albedo.cwiseProduct(sky.sun_light()) * (facing / static_cast<float>(kPi));
    if (!glow_field.empty()) light += static_cast<float>(options.glow_light) * s.albedo.cwiseProduct(glow_field(s.position, s.normal));
    if (s.is_lava) {
      // Sheen: a highlight of the sun and a dull mirror of the sky. Fresnel's rise at a grazing view is that of facets which face
      // the viewer, and rubble has few that still do (Lagarde's form of Schlick's); what it mirrors is blurred over the sky.
      const float grazing = 1 - saturate(-s.normal.dot(d)), g2 = grazing * grazing, fresnel = 0.04f + 0.5f * s.gloss * g2 * g2 * grazing;
      const Vec3f mirrored = d - 2 * d.dot(s.normal) * s.normal;
      if (lit) {
        const Vec3f half = (to_sun - d).normalized();
        const float h = std::max(0.0f, s.normal.dot(half)), alpha = mix(0.7f, 0.3f, s.gloss), alpha2 = alpha * alpha, q = h * h * (alpha2 - 1) + 1;
        const float lobe = alpha2 / (static_cast<float>(kPi) * q * q);
        light += sky.sun_light() * (0.25f * 0.04f * lobe * facing);
      }
      const Vec3f reflection = mix(sky.ambient(s.normal), sky.radiance(mirrored), s.gloss);
      light += (0.3f * fresnel * saturate(0.4f + mirrored.z())) * reflection;
      light += s.emission;
    }
    return through_air(s.distance, d, light);
  }

  /// Air between.
  Vec3f through_air(float distance, const Vec3f& d, const Vec3f& light) const {
    const float thickness = distance * static_cast<float>(options.haze) / (9 * ground.radius);
    const float clear = std::exp(-thickness * std::sqrt(thickness));  // clear before, closed behind
    return mix(sky.haze(d), light, clear);
  }

  /// What a ray from p along d meets, and how far away; not hit: the sky. s.distance counts from the eye, by way of p.
  Surface second(const Vec3f& p, const Vec3f& d, float before, float lift, float& way) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit hit{};
    hit.ray.org_x = p.x(), hit.ray.org_y = p.y(), hit.ray.org_z = p.z();
    hit.ray.dir_x = d.x(), hit.ray.dir_y = d.y(), hit.ray.dir_z = d.z();
    hit.ray.tnear = lift;
    hit.ray.tfar = kFar;
    hit.ray.mask = ~0u;
    hit.hit.geomID = hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(ground_scene, &context, &hit);
    rtcIntersect1(lava_scene, &context, &hit);
    way = hit.ray.tfar;
    if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    return surface_at(hit.hit.geomID, hit.hit.primID, hit.hit.u, hit.hit.v, p + way * d, before + way, d, Vec3f(hit.hit.Ng_x, hit.hit.Ng_y, hit.hit.Ng_z));
  }

  /// Water: Fresnel's mirror of one bounce, on facets of ripples, and down through it what lies there, red fading first; the body's own
  /// colour by the light that falls in. facets: slopes beyond the mesh's.
  Vec3f water_light(const Surface& s, const Vec3f& d, bool lit, const std::array<Eigen::Vector2f, kFacets>& facets) const {
    // Smooth normals lean away from the viewer at a crest's edge: they are turned back until it is seen at a slant.
    constexpr float kSlant = 0.03f;
    const auto seen_from_here = [&](const Vec3f& normal) {
      const float away = normal.dot(d) + kSlant;
      return away > 0 ? Vec3f((normal - away * d).normalized()) : normal;
    };
    const Vec3f n = seen_from_here(s.normal);
    const float lift = 1e-4f * s.distance + 1e-4f * ground.radius, cosine = saturate(-n.dot(d));
    float way = 0;
    // Snell's law, air to water.
    const Vec3f body = s.albedo.cwiseProduct(sky.ambient(Vec3f::UnitZ()) + (lit ? 0.5f : 0.0f) * std::max(0.0f, sky.sun_direction().z()) * sky.sun_light() / static_cast<float>(kPi));
    const float eta = 1 / 1.33f, inner = std::sqrt(std::max(0.0f, 1 - eta * eta * (1 - cosine * cosine)));
    const Vec3f down = (eta * d + (eta * cosine - inner) * n).normalized();
    const Surface below = second(s.position - lift * s.geometric, down, s.distance, lift, way);
    Vec3f seen = body;
    if (below.hit && below.water <= 0) {
      const Vec3f through = (Vec3f(1.9f, 0.95f, 0.8f) * (-way / s.water)).array().exp();
      seen = through.cwiseProduct(radiance(below, down, true)) + (Vec3f::Ones() - through).cwiseProduct(body);
    }
    Vec3f light = Vec3f::Zero();
    float mean_fresnel = 0;
    for (const Eigen::Vector2f& slope : facets) {
      const Vec3f facet = seen_from_here((s.normal + Vec3f(slope.x(), slope.y(), 0)).normalized());
      const float out = 1 - saturate(-facet.dot(d)), o2 = out * out, fresnel = 0.02f + 0.98f * o2 * o2 * out;
      Vec3f mirrored = d - 2 * d.dot(facet) * facet;
      mirrored.z() = std::max(mirrored.z(), 0.02f);
      mirrored.normalize();
      const Surface above = second(s.position + lift * s.geometric, mirrored, s.distance, lift, way);
      // Other waves show the sky, too, from higher up.
      Vec3f onward = mirrored;
      onward.z() += 0.25f;
      const Vec3f reflection = !above.hit ? sky.radiance(mirrored) : above.water > 0 ? Vec3f(mix(body, sky.radiance(onward.normalized()), 0.7f)) : radiance(above, mirrored, true);
      light += mix(seen, Vec3f(reflection.cwiseMin(kBrightest)), fresnel) / kFacets;
      mean_fresnel += fresnel / kFacets;
    }
    if (lit) {
      // The sun, on all of the ripples at once.
      const Vec3f half = (sky.sun_direction() - d).normalized();
      const float h = std::max(0.0f, n.dot(half)), alpha2 = 2 * kRipples * kRipples, q = h * h * (alpha2 - 1) + 1;
      light += sky.sun_light() * (0.25f * mean_fresnel * alpha2 / (static_cast<float>(kPi) * q * q));
    }
    return through_air(s.distance, d, light);
  }

  /// Pixels [x0, x1) of row y, eight samples at a time.
  void render_span(int y, int x0, int x1, float* rgb, float* depth) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    const int samples = options.samples, total = (x1 - x0) * samples;
    const float weight = static_cast<float>(options.exposure) / static_cast<float>(samples);

    for (int first = 0; first < total; first += kPacket) {
      alignas(32) int valid[kPacket];
      alignas(32) RTCRayHit8 rays;
      std::array<Vec3f, kPacket> direction;
      for (int k = 0; k < kPacket; ++k) {
        valid[k] = first + k < total ? -1 : 0;
        const int sample = std::min(first + k, total - 1);
        direction[static_cast<std::size_t>(k)] = lens.direction(x0 + sample / samples, y, sample % samples);
        set_ray(rays.ray, k, lens.eye(), direction[static_cast<std::size_t>(k)], 0, kFar);
        rays.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        rays.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
      }
      // The second scene finds only what lies before the hits of the first.
      rtcIntersect8(valid, ground_scene, &context, &rays);
      rtcIntersect8(valid, lava_scene, &context, &rays);

      // Surfaces, and a ray to the sun from each that faces it.
      std::array<Surface, kPacket> surface;
      alignas(32) int to_ground[kPacket], to_lava[kPacket];
      alignas(32) RTCRay8 ground_shadow, lava_shadow;
      for (int k = 0; k < kPacket; ++k) {
        to_ground[k] = to_lava[k] = 0;
        if (!valid[k] || rays.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) continue;
        Surface& s = surface[static_cast<std::size_t>(k)];
        s = surface_at(rays.hit.geomID[k], rays.hit.primID[k], rays.hit.u[k], rays.hit.v[k], rays.ray.tfar[k],
                       direction[static_cast<std::size_t>(k)], Vec3f(rays.hit.Ng_x[k], rays.hit.Ng_y[k], rays.hit.Ng_z[k]));
        if (s.normal.dot(sky.sun_direction()) <= 0 || sky.sun_light().maxCoeff() <= 0) continue;
        to_ground[k] = to_lava[k] = -1;
        const float lift = 1e-4f * s.distance + 1e-4f * ground.radius;
        const Vec3f from = s.position + lift * s.geometric;
        // A low sun on coarse triangles with smooth normals: the triangles next to the point may not shade it, or every
        // edge would show along the shadow's border.
        const Vec3f above = from + Vec3f(0, 0, kShadowLift * ground.edge);
        set_ray(ground_shadow, k, above, sun_sample(first + k, x0, y), s.is_lava ? lift : 1.2f * ground.edge, kFar);
        set_ray(lava_shadow, k, from, sun_sample(first + k, x0, y), lift, kFar);
      }
      rtcOccluded8(to_ground, ground_scene, &context, &ground_shadow);
      for (int k = 0; k < kPacket; ++k)
        if (to_ground[k] && ground_shadow.tfar[k] < 0) to_lava[k] = 0;
      rtcOccluded8(to_lava, lava_scene, &context, &lava_shadow);

      for (int k = 0; k < kPacket && first + k < total; ++k) {
        const Surface& s = surface[static_cast<std::size_t>(k)];
        const Vec3f& d = direction[static_cast<std::size_t>(k)];
        const bool lit = to_lava[k] != 0 && !(lava_shadow.tfar[k] < 0);
        const Vec3f light = !s.hit ? sky.radiance(d) : s.water > 0 ? water_light(s, d, lit, facets_sample(first + k, x0, y)) : radiance(s, d, lit);
        if (depth && s.hit) {
          depth[2 * ((first + k) / samples)] += s.distance;
          depth[2 * ((first + k) / samples) + 1] += 1;
        }
        float* pixel = rgb + 3 * ((first + k) / samples);
        for (int c = 0; c < 3; ++c) pixel[c] += weight * light[c];
      }
    }
  }

 private:
  static void set_ray(RTCRay8& ray, int k, const Vec3f& from, const Vec3f& d, float near, float far) {
    ray.org_x[k] = from.x(), ray.org_y[k] = from.y(), ray.org_z[k] = from.z();
    ray.dir_x[k] = d.x(), ray.dir_y[k] = d.y(), ray.dir_z[k] = d.z();
    ray.tnear[k] = near, ray.tfar[k] = far;
    ray.time[k] = 0;
    ray.mask[k] = ~0u;
    ray.id[k] = static_cast<unsigned>(k);
    ray.flags[k] = 0;
  }

  /// A direction within the sun's disc, ten times as wide as the real one: soft shadows.
  /// Slopes of facets of water's surface, of the ripples that a mesh does not have: normal, kRipples wide each way.
  std::array<Eigen::Vector2f, kFacets> facets_sample(int sample, int x0, int y) const {
    std::array<Eigen::Vector2f, kFacets> facets;
    const std::uint64_t pixel = static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(options.width) + static_cast<std::uint64_t>(x0);
    for (int k = 0; k < kFacets; ++k) {
      const std::uint64_t bits = random_bits(options.seed + 2, pixel, static_cast<std::uint64_t>(sample) * kFacets + static_cast<std::uint64_t>(k));
      const float r = static_cast<float>(bits >> 40) * 0x1p-24f, turn = static_cast<float>(bits >> 16 & 0xffffff) * 0x1p-24f;
      // Of lengths and turns one of each share to a pixel: less grain.
      const int n = kFacets * options.samples, i = sample % options.samples * kFacets + k;
      const float length = kRipples * std::sqrt(-2 * std::log((static_cast<float>(i) + 1 - r) / static_cast<float>(n)));
      const float angle = 2 * static_cast<float>(kPi) * (static_cast<float>(k) + turn) / kFacets;
      facets[static_cast<std::size_t>(k)] = length * Eigen::Vector2f(std::cos(angle), std::sin(angle));
    }
    return facets;
  }
  Vec3f sun_sample(int sample, int x0, int y) const {
    const std::uint64_t pixel = static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(options.width) + static_cast<std::uint64_t>(x0);
    const std::uint64_t bits = random_bits(options.seed + 1, pixel, static_cast<std::uint64_t>(sample));
    const float a = static_cast<float>(bits >> 40) * 0x1p-24f - 0.5f, b = static_cast<float>(bits >> 16 & 0xffffff) * 0x1p-24f - 0.5f;
    return (sky.sun_direction() + 0.035f * Vec3f(a, b, 0.5f * (a - b))).normalized();
  }
};

}  // namespace

Preview::Preview(const TriMesh& terrain) : impl_(std::make_unique<Impl>()) {
  ZONE("preview.terrain");
  impl_->ground = build_ground(terrain);
  {
    const ThreadLimit one(1);  // see build_scene: the device remembers how many threads there were
    impl_->device.reset(rtcNewDevice(nullptr));
  }
  if (!impl_->device) embree_failed(nullptr, "start");
  impl_->scene = build_scene(impl_->device.get(), impl_->ground.positions, impl_->ground.triangles, kGroundId, RTC_BUILD_QUALITY_MEDIUM);
  impl_->sky_visibility = sky_visibility(impl_->scene.get(), impl_->ground);
}

Preview::~Preview() = default;

Image Preview::render(const TriMesh& mesh, const PreviewOptions& options, const Air& air) const {
  ZONE("preview");
  require_sane(options);
  const Ground& ground = impl_->ground;
  const Lava lava = take_lava(mesh, ground.origin);
  ScenePtr lava_scene;
  {
    ZONE("preview.tree");
    lava_scene = build_scene(impl_->device.get(), lava.positions, lava.triangles, kLavaId, RTC_BUILD_QUALITY_LOW);
  }
  RTCScene ground_scene = impl_->scene.get();

  GlowField::Surroundings surroundings;
  surroundings.ground_height = [&](float x, float y) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit hit{};
    hit.ray.org_x = x, hit.ray.org_y = y, hit.ray.org_z = 10 * ground.radius;
    hit.ray.dir_z = -1;
    hit.ray.tfar = kFar;
    hit.ray.mask = ~0u;
    hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(ground_scene, &context, &hit);
    return hit.hit.geomID == RTC_INVALID_GEOMETRY_ID ? ground.low : 10 * ground.radius - hit.ray.tfar;
  };
  surroundings.hidden = [&](const Vec3f& from, const Vec3f& to) { return occluded(ground_scene, from, to - from, 0.01f, 0.97f); };
  const GlowField glow_field = options.glow_light > 0 ? glow_of(lava, air, ground.origin, surroundings) : GlowField();

  const Sky sky(options.sun_direction, options.sun, options.sky);
  const Lens lens(options, ground.origin);
  const Picture picture{ground, impl_->sky_visibility, ground_scene, lava_scene.get(), lava, glow_field, sky, lens, options};
  Image image{options.width, options.height, {}};
  const std::size_t row = std::size_t{3} * static_cast<std::size_t>(options.width);
  image.rgb.assign(row * static_cast<std::size_t>(options.height), 0.0f);
  std::vector<float> hits;  // of each pixel: sum of distances, and how many there are
  if (!air.empty()) hits.assign(row / 3 * 2 * static_cast<std::size_t>(options.height), 0.0f);
  {
    ZONE("preview.rays");
    parallel_for(
        static_cast<std::size_t>(options.height),
        [&](std::size_t y) { picture.render_span(static_cast<int>(y), 0, options.width, image.rgb.data() + y * row, hits.empty() ? nullptr : hits.data() + y * row / 3 * 2); }, 4);
  }
  if (!air.empty()) {
    std::vector<float> depth(hits.size() / 2);
    for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = 2 * hits[2 * i + 1] >= static_cast<float>(options.samples) ? hits[2 * i] / hits[2 * i + 1] : kFar;
    draw_air(image, depth, lens.view(ground.origin), sky, options, air);
  }
  add_bloom(image, static_cast<float>(options.bloom));
  return image;
}

}  // namespace effuse::skin
