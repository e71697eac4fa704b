#include "flow/sph/pair_kernels_float.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

struct FloatPairs::Lanes {
  void (*gradient)(const View&, std::size_t, std::size_t, Vector*);
  void (*divergence)(const View&, std::size_t, std::size_t, const Vector*, float*);
  void (*compliance)(const View&, std::size_t, std::size_t, Vector*, float*);
};

namespace {

using View = FloatPairs::View;
using Packed = FloatPairs::Packed;
using Vector = FloatPairs::Vector;
constexpr std::ptrdiff_t kLanes = 8;
static_assert(Neighbors::kGroup == kLanes && sizeof(Packed) == 16 && sizeof(Vector) == 16);

#define INLINE __attribute__((always_inline)) inline

/// Whole groups [begin, end) of one particle's list; what fills up the last is the particle itself, and counts nothing.
struct List {
  const Index *begin, *end;
};
INLINE List list_of(const View& s, std::size_t i) {
  const auto list = (*s.neighbors)[i];
  return {list.data(), list.data() + (static_cast<std::ptrdiff_t>(list.size()) + kLanes - 1) / kLanes * kLanes};
}

// Plain C++: what the others are tested against.
namespace scalar {
struct F8 {
  float at[kLanes];
};
template <class F>
INLINE F8 each(F&& f) {
  F8 out;
  for (std::ptrdiff_t k = 0; k < kLanes; ++k) out.at[k] = f(k);
  return out;
}
INLINE F8 operator+(const F8& a, const F8& b) { return each([&](auto k) { return a.at[k] + b.at[k]; }); }
INLINE F8 operator-(const F8& a, const F8& b) { return each([&](auto k) { return a.at[k] - b.at[k]; }); }
INLINE F8 operator*(const F8& a, const F8& b) { return each([&](auto k) { return a.at[k] * b.at[k]; }); }
INLINE F8 operator/(const F8& a, const F8& b) { return each([&](auto k) { return a.at[k] / b.at[k]; }); }
INLINE F8 fill(float a) { return each([&](auto) { return a; }); }
INLINE F8 root(const F8& a) { return each([&](auto k) { return std::sqrt(a.at[k]); }); }
INLINE F8 above_zero(const F8& a) { return each([&](auto k) { return a.at[k] > 0 ? a.at[k] : 0; }); }
INLINE F8 where_positive(const F8& test, const F8& yes, const F8& no) { return each([&](auto k) { return test.at[k] > 0 ? yes.at[k] : no.at[k]; }); }
INLINE float units(std::int32_t a, std::int32_t b) {  // a - b modulo 2^32
  return static_cast<float>(static_cast<std::int32_t>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b)));
}
INLINE void load_apart(const Packed& i, const Packed* p, const Index* j, F8& dx, F8& dy, F8& dz, F8& q) {
  dx = each([&](auto k) { return units(i.x, p[j[k]].x); });
  dy = each([&](auto k) { return units(i.y, p[j[k]].y); });
  dz = each([&](auto k) { return units(i.z, p[j[k]].z); });
  q = each([&](auto k) { return p[j[k]].q; });
}
INLINE void load_vectors(const Vector* v, const Index* j, F8& x, F8& y, F8& z) {
  x = each([&](auto k) { return v[j[k]].x; });
  y = each([&](auto k) { return v[j[k]].y; });
  z = each([&](auto k) { return v[j[k]].z; });
}
INLINE float sum(const F8& a) { return ((a.at[0] + a.at[4]) + (a.at[2] + a.at[6])) + ((a.at[1] + a.at[5]) + (a.at[3] + a.at[7])); }
#include "flow/sph/pair_kernels_float_internal.h"
}  // namespace scalar

#if defined(__x86_64__)

#pragma GCC push_options
#pragma GCC target("avx2")
namespace avx2 {
struct F8 {
  __m256 a;
};
INLINE F8 operator+(F8 p, F8 q) { return {_mm256_add_ps(p.a, q.a)}; }
INLINE F8 operator-(F8 p, F8 q) { return {_mm256_sub_ps(p.a, q.a)}; }
INLINE F8 operator*(F8 p, F8 q) { return {_mm256_mul_ps(p.a, q.a)}; }
INLINE F8 operator/(F8 p, F8 q) { return {_mm256_div_ps(p.a, q.a)}; }
INLINE F8 fill(float a) { return {_mm256_set1_ps(a)}; }
INLINE F8 root(F8 p) { return {_mm256_sqrt_ps(p.a)}; }
INLINE F8 above_zero(F8 p) { return {_mm256_max_ps(p.a, _mm256_setzero_ps())}; }
INLINE F8 where_positive(F8 test, F8 yes, F8 no) { return {_mm256_blendv_ps(no.a, yes.a, _mm256_cmp_ps(test.a, _mm256_setzero_ps(), _CMP_GT_OQ))}; }
INLINE __m256 two(const void* a, const void* b) {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(static_cast<const float*>(a))), _mm_load_ps(static_cast<const float*>(b)), 1);
}
/// Four words of each of eight particles, word by word.
INLINE void transpose(__m256 r04, __m256 r15, __m256 r26, __m256 r37, __m256& x, __m256& y, __m256& z, __m256& w) {
  const __m256 xy01 = _mm256_unpacklo_ps(r04, r15), zw01 = _mm256_unpackhi_ps(r04, r15);
  const __m256 xy23 = _mm256_unpacklo_ps(r26, r37), zw23 = _mm256_unpackhi_ps(r26, r37);
  x = _mm256_shuffle_ps(xy01, xy23, 0x44);
  y = _mm256_shuffle_ps(xy01, xy23, 0xee);
  z = _mm256_shuffle_ps(zw01, zw23, 0x44);
  w = _mm256_shuffle_ps(zw01, zw23, 0xee);
}
INLINE F8 units(std::int32_t a, __m256 b) { return {_mm256_cvtepi32_ps(_mm256_sub_epi32(_mm256_set1_epi32(a), _mm256_castps_si256(b)))}; }
INLINE void load_apart(const Packed& i, const Packed* p, const Index* j, F8& dx, F8& dy, F8& dz, F8& q) {
  __m256 x, y, z;
  transpose(two(p + j[0], p + j[4]), two(p + j[1], p + j[5]), two(p + j[2], p + j[6]), two(p + j[3], p + j[7]), x, y, z, q.a);
  dx = units(i.x, x);
  dy = units(i.y, y);
  dz = units(i.z, z);
}
INLINE void load_vectors(const Vector* v, const Index* j, F8& x, F8& y, F8& z) {
  __m256 unused;
  transpose(two(v + j[0], v + j[4]), two(v + j[1], v + j[5]), two(v + j[2], v + j[6]), two(v + j[3], v + j[7]), x.a, y.a, z.a, unused);
}
INLINE float sum(F8 p) {
  const __m128 four = _mm_add_ps(_mm256_castps256_ps128(p.a), _mm256_extractf128_ps(p.a, 1));
  const __m128 pair = _mm_add_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_add_ss(pair, _mm_shuffle_ps(pair, pair, 1)));
}
#include "flow/sph/pair_kernels_float_internal.h"
}  // namespace avx2
#pragma GCC pop_options

#endif
#undef INLINE

}  // namespace

void FloatPairs::build(const ParticleSystem& s, Simd simd) {
  ZONE("sph.pack");
  CHECK(simd <= best_simd());
  CHECK(s.neighbors != nullptr);
  CHECK_GE(s.neighbors->size(), s.size());
  CHECK_GT(s.support, 0.0);
  for (const Real period : s.period) CHECK(period == 0 || period >= 2 * s.support);
  lanes_ = &scalar::kTable;
#if defined(__x86_64__)
  if (simd >= Simd::kAvx2) lanes_ = &avx2::kTable;
#endif
  packed_.resize(s.size());
  // A period is 2^32 units: the nearest image comes by overflow.
  const Vec3 units(s.period.x() > 0 ? 0x1p32 / s.period.x() : 0x1p22 / s.support, s.period.y() > 0 ? 0x1p32 / s.period.y() : 0x1p22 / s.support, 0x1p22 / s.support);
  const auto whole = [](Real u) { return static_cast<std::int32_t>(static_cast<std::uint32_t>(static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(u))))); };
  parallel_for(s.size(), [&](std::size_t i) {
    const Vec3 u = s.x[i].cwiseProduct(units);
    packed_[i] = {whole(u.x()), whole(u.y()), whole(u.z()), 0};
  }, 4096);

  const Vec3 scale = (units * s.support).cwiseInverse();
  const Real height = with_kernel(s, [&](const auto& kernel, auto) { return kernel.W(0); });
  const Real shape = s.kernel == KernelKind::kWendlandC2 ? -20 : s.kernel == KernelKind::kCubicSpline ? 1 : -3;
  view_ = {packed_.data(), s.neighbors, static_cast<float>(scale.x()), static_cast<float>(scale.y()), static_cast<float>(scale.z()),
           static_cast<float>(s.volume() * shape * height / s.support), s.kernel};
}

void FloatPairs::gradient(std::size_t begin, std::size_t end, std::span<Vector> out) const {
  CHECK(begin <= end && end <= size());
  CHECK_EQ(out.size(), size());
  lanes_->gradient(view_, begin, end, out.data());
}

void FloatPairs::divergence(std::size_t begin, std::size_t end, std::span<const Vector> v, std::span<float> out) const {
  CHECK(begin <= end && end <= size());
  CHECK_EQ(v.size(), size());
  CHECK_EQ(out.size(), size());
  lanes_->divergence(view_, begin, end, v.data(), out.data());
}

void FloatPairs::compliance(std::size_t begin, std::size_t end, std::span<Vector> slope, std::span<float> squares) const {
  CHECK(begin <= end && end <= size());
  CHECK_EQ(slope.size(), size());
  CHECK_EQ(squares.size(), size());
  lanes_->compliance(view_, begin, end, slope.data(), squares.data());
}

}  // namespace effuse::flow::sph
