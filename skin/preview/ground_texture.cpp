#include "skin/preview/ground_texture.h"

#include <array>
#include <cstdint>
#include <tuple>

namespace effuse::skin {

namespace {
/// Sixteen directions, 22.5 degrees apart; 1.5 brings the noise to about -1..1.
constexpr float kA = 1.5f, kB = 1.5f * 0.92387953f, kC = 1.5f * 0.70710678f, kD = 1.5f * 0.38268343f;
constexpr std::array<std::array<float, 2>, 16> kDirections = {{{kA, 0},
                                                               {kB, kD},
                                                               {kC, kC},
                                                               {kD, kB},
                                                               {0, kA},
                                                               {-kD, kB},
                                                               {-kC, kC},
                                                               {-kB, kD},
                                                               {-kA, 0},
                                                               {-kB, -kD},
                                                               {-kC, -kC},
                                                               {-kD, -kB},
                                                               {0, -kA},
                                                               {kD, -kB},
                                                               {kC, -kC},
                                                               {kB, -kD}}};

const std::array<float, 2>& direction(std::int32_t i, std::int32_t j, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(i) * 0x9e3779b1u ^ static_cast<std::uint32_t>(j) * 0x85ebca77u ^ seed * 0xc2b2ae3du;
  h ^= h >> 15;
  h *= 0x2c1b3c6du;
  h ^= h >> 13;
  return kDirections[(h * 0x297a2d39u) >> 28];
}

constexpr float kPush = 0.2f;  // of an octave's wavelength, by which it moves the next

std::int32_t floor_int(float x) {
  const std::int32_t i = static_cast<std::int32_t>(x);
  return i - (x < static_cast<float>(i) ? 1 : 0);
}
}  // namespace

PlaneNoise plane_noise(float x, float y, std::uint32_t seed) {
  const std::int32_t i = floor_int(x), j = floor_int(y);
  const float u = x - static_cast<float>(i), v = y - static_cast<float>(j);
  const auto &g00 = direction(i, j, seed), &g10 = direction(i + 1, j, seed), &g01 = direction(i, j + 1, seed),
             &g11 = direction(i + 1, j + 1, seed);
  const float n00 = g00[0] * u + g00[1] * v, n10 = g10[0] * (u - 1) + g10[1] * v;
  const float n01 = g01[0] * u + g01[1] * (v - 1), n11 = g11[0] * (u - 1) + g11[1] * (v - 1);
  // Quintic blend and its slope.
  const float s = u * u * u * (u * (u * 6 - 15) + 10), ds = 30 * u * u * (u - 1) * (u - 1);
  const float t = v * v * v * (v * (v * 6 - 15) + 10), dt = 30 * v * v * (v - 1) * (v - 1);
  const float a = n00 + s * (n10 - n00), b = n01 + s * (n11 - n01);
  const float dax = g00[0] + s * (g10[0] - g00[0]) + ds * (n10 - n00), dbx = g01[0] + s * (g11[0] - g01[0]) + ds * (n11 - n01);
  const float day = g00[1] + s * (g10[1] - g00[1]), dby = g01[1] + s * (g11[1] - g01[1]);
  return {a + t * (b - a), dax + t * (dbx - dax), day + t * (dby - day) + dt * (b - a)};
}

GroundLook ground_look(const Vec3f& p, const Vec3f& normal, float altitude, float footprint, float size) {
  // One octave: its value, and its slope added to the bumps; both fade between four and two pixels a wave. Each is
  // turned by the angle of a 3-4-5 triangle more than the last, and pushed about a little by the one before: else
  // the lattice, whose nodes are zeros of the noise, shows as a waffle from close by.
  float bump_x = 0, bump_y = 0, cosine = 1, sine = 0, push_x = 0, push_y = 0;
  const auto octave = [&](float wavelength, float slope, std::uint32_t seed) {
    std::tie(cosine, sine) = std::pair{0.8f * cosine - 0.6f * sine, 0.8f * sine + 0.6f * cosine};
    const float visible = saturate(wavelength / (2 * footprint) - 1);
    if (visible <= 0) return 0.0f;
    const float x = p.x() + push_x, y = p.y() + push_y;
    const PlaneNoise noise = plane_noise((cosine * x + sine * y) / wavelength, (cosine * y - sine * x) / wavelength, seed);
    push_x = kPush * wavelength * visible * noise.value * cosine;
    push_y = kPush * wavelength * visible * noise.value * sine;
    bump_x += visible * slope * (cosine * noise.dx - sine * noise.dy);
    bump_y += visible * slope * (sine * noise.dx + cosine * noise.dy);
    return visible * noise.value;
  };
  const float wide = octave(0.2f * size, 0, 1), patch = octave(67, 0.015f, 2), knoll = octave(23, 0.035f, 3),
              tuft = octave(8.3f, 0.055f, 4), stone = octave(3.1f, 0.075f, 5), grain = octave(1.15f, 0.11f, 6),
              dust = octave(0.41f, 0.13f, 7), crumb = octave(0.15f, 0.15f, 8), speck = octave(0.055f, 0.15f, 9);

  // How much of each: gentle ground carries soil, steep ground none.
  const float level = normal.z() + 0.05f * tuft + 0.04f * knoll;
  const float grass = smooth(0.80f, 0.93f, level - 0.03f * altitude), scree = (1 - grass) * smooth(0.66f, 0.80f, level);
  const float rock = 1 - grass - scree;

  const Vec3f dry(0.150f, 0.122f, 0.060f), green(0.058f, 0.072f, 0.028f), scrub(0.022f, 0.029f, 0.014f);
  const Vec3f gravel(0.098f, 0.080f, 0.062f), stone_gray(0.080f, 0.068f, 0.056f), scoria(0.105f, 0.056f, 0.036f);
  Vec3f meadow = mix(green, dry, smooth(-0.5f, 0.6f, 0.5f * wide + 0.5f * patch + 0.35f * knoll + 0.2f * tuft + 0.5f * (altitude - 0.35f)));
  meadow = mix(meadow, scrub, 0.75f * smooth(0.06f, 0.55f, 0.42f * tuft + 0.35f * stone + 0.3f * grain + 0.3f * knoll - 0.25f * patch));
  const float strata = 0.5f + 0.5f * std::sin(1.1f * p.z() + 2.5f * knoll + 1.5f * tuft);
  const Vec3f cliff = stone_gray * (0.72f + 0.35f * strata + 0.35f * stone);
  Vec3f albedo = grass * meadow + scree * gravel * (1 + 0.35f * stone) + rock * cliff;
  albedo = mix(albedo, scoria * (1 + 0.3f * tuft), smooth(0.5f, 1.0f, altitude + 0.22f * knoll + 0.2f * patch) * (0.75f - 0.45f * grass));
  albedo *= std::max(0.3f, 1 + 0.30f * grain + 0.25f * dust + 0.25f * crumb + 0.25f * speck + 0.12f * stone);

  const float rough = 0.75f + 0.5f * (rock + scree);
  const Vec3f bumped = (normal - rough * Vec3f(bump_x, bump_y, 0)).normalized();
  return {albedo.cwiseMax(0.004f), bumped};
}

}  // namespace effuse::skin
