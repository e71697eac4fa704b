#include "flow/sph/pair_kernels.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

struct PairKernels::Lanes {
  void (*density)(const View&, double, double, std::size_t, std::size_t, double*, double*, std::size_t);
  void (*viscous)(const View&, double, std::size_t, std::size_t, const double*, double*);
  void (*viscous_block)(const View&, double, std::size_t, std::size_t, double*);
  void (*friction_power)(const View&, double, std::size_t, std::size_t, const double*, double*);
  void (*velocity_gradient)(const View&, double, double, std::size_t, std::size_t, const double*, double*, double*);
  void (*divergence)(const View&, double, std::size_t, std::size_t, const double*, double*, std::size_t);
  void (*gradient)(const View&, double, std::size_t, std::size_t, const double*, double*, std::size_t);
  void (*compliance)(const View&, double, std::size_t, std::size_t, const double*, double*, double*);
};

namespace {

using View = PairKernels::View;
using Packed = PairKernels::Packed;
constexpr std::ptrdiff_t kLanes = 8;
static_assert(Neighbors::kGroup == kLanes && sizeof(Packed) == 32 && sizeof(Vec3) == 24 && sizeof(Mat3) == 72);

#define INLINE __attribute__((always_inline)) inline

/// Whole groups [begin, end) of one particle's list; of them so many are neighbours.
struct List {
  const Index *begin, *end;
  double count;
};
INLINE List list_of(const View& s, std::size_t i) {
  const auto list = (*s.neighbors)[i];
  const auto count = static_cast<std::ptrdiff_t>(list.size());
  return {list.data(), list.data() + (count + kLanes - 1) / kLanes * kLanes, static_cast<double>(count)};
}

// Plain C++: what the others are tested against.
namespace scalar {
struct D8 {
  double at[kLanes];
};
template <class F>
INLINE D8 each(F&& f) {
  D8 out;
  for (std::ptrdiff_t k = 0; k < kLanes; ++k) out.at[k] = f(k);
  return out;
}
INLINE D8 operator+(const D8& a, const D8& b) { return each([&](auto k) { return a.at[k] + b.at[k]; }); }
INLINE D8 operator-(const D8& a, const D8& b) { return each([&](auto k) { return a.at[k] - b.at[k]; }); }
INLINE D8 operator*(const D8& a, const D8& b) { return each([&](auto k) { return a.at[k] * b.at[k]; }); }
INLINE D8 operator/(const D8& a, const D8& b) { return each([&](auto k) { return a.at[k] / b.at[k]; }); }
INLINE D8 fill(double a) { return each([&](auto) { return a; }); }
INLINE D8 root(const D8& a) { return each([&](auto k) { return std::sqrt(a.at[k]); }); }
INLINE D8 above_zero(const D8& a) { return each([&](auto k) { return a.at[k] > 0 ? a.at[k] : 0; }); }
INLINE D8 where_positive(const D8& test, const D8& yes, const D8& no) { return each([&](auto k) { return test.at[k] > 0 ? yes.at[k] : no.at[k]; }); }
INLINE void load_packed(const Packed* p, const Index* j, D8& x, D8& y, D8& z, D8& stiffness) {
  x = each([&](auto k) { return p[j[k]].x; });
  y = each([&](auto k) { return p[j[k]].y; });
  z = each([&](auto k) { return p[j[k]].z; });
  stiffness = each([&](auto k) { return p[j[k]].stiffness; });
}
INLINE void load_vectors(const double* v, const Index* j, D8& x, D8& y, D8& z) {
  x = each([&](auto k) { return v[3 * std::size_t{j[k]}]; });
  y = each([&](auto k) { return v[3 * std::size_t{j[k]} + 1]; });
  z = each([&](auto k) { return v[3 * std::size_t{j[k]} + 2]; });
}
INLINE D8 load_scalars(const double* q, const Index* j) { return each([&](auto k) { return q[j[k]]; }); }
INLINE double sum(const D8& a) { return ((a.at[0] + a.at[4]) + (a.at[2] + a.at[6])) + ((a.at[1] + a.at[5]) + (a.at[3] + a.at[7])); }
#include "flow/sph/pair_kernels_internal.h"
}  // namespace scalar

#if defined(__x86_64__)

#pragma GCC push_options
#pragma GCC target("avx2")
namespace avx2 {
struct D8 {
  __m256d a, b;  // lanes 0-3, 4-7
};
INLINE D8 operator+(D8 p, D8 q) { return {_mm256_add_pd(p.a, q.a), _mm256_add_pd(p.b, q.b)}; }
INLINE D8 operator-(D8 p, D8 q) { return {_mm256_sub_pd(p.a, q.a), _mm256_sub_pd(p.b, q.b)}; }
INLINE D8 operator*(D8 p, D8 q) { return {_mm256_mul_pd(p.a, q.a), _mm256_mul_pd(p.b, q.b)}; }
INLINE D8 operator/(D8 p, D8 q) { return {_mm256_div_pd(p.a, q.a), _mm256_div_pd(p.b, q.b)}; }
INLINE D8 fill(double a) { return {_mm256_set1_pd(a), _mm256_set1_pd(a)}; }
INLINE D8 root(D8 p) { return {_mm256_sqrt_pd(p.a), _mm256_sqrt_pd(p.b)}; }
INLINE D8 above_zero(D8 p) { return {_mm256_max_pd(p.a, _mm256_setzero_pd()), _mm256_max_pd(p.b, _mm256_setzero_pd())}; }
INLINE __m256d positive(__m256d p) { return _mm256_cmp_pd(p, _mm256_setzero_pd(), _CMP_GT_OQ); }
INLINE D8 where_positive(D8 test, D8 yes, D8 no) { return {_mm256_blendv_pd(no.a, yes.a, positive(test.a)), _mm256_blendv_pd(no.b, yes.b, positive(test.b))}; }
INLINE __m256d two_pairs(const double* p, const double* q) { return _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(p)), _mm_loadu_pd(q), 1); }
INLINE void four_packed(const Packed* p, const Index* j, __m256d& x, __m256d& y, __m256d& z, __m256d& w) {
  const double *p0 = &p[j[0]].x, *p1 = &p[j[1]].x, *p2 = &p[j[2]].x, *p3 = &p[j[3]].x;
  const __m256d xy02 = two_pairs(p0, p2), xy13 = two_pairs(p1, p3), zw02 = two_pairs(p0 + 2, p2 + 2), zw13 = two_pairs(p1 + 2, p3 + 2);
  x = _mm256_unpacklo_pd(xy02, xy13);
  y = _mm256_unpackhi_pd(xy02, xy13);
  z = _mm256_unpacklo_pd(zw02, zw13);
  w = _mm256_unpackhi_pd(zw02, zw13);
}
INLINE void load_packed(const Packed* p, const Index* j, D8& x, D8& y, D8& z, D8& w) {
  four_packed(p, j, x.a, y.a, z.a, w.a);
  four_packed(p, j + 4, x.b, y.b, z.b, w.b);
}
INLINE void four_vectors(const double* v, const Index* j, __m256d& x, __m256d& y, __m256d& z) {
  // (x y) and (y z) of each in 16 bytes: nothing is read beyond the vector.
  const double *v0 = v + 3 * std::size_t{j[0]}, *v1 = v + 3 * std::size_t{j[1]}, *v2 = v + 3 * std::size_t{j[2]}, *v3 = v + 3 * std::size_t{j[3]};
  const __m256d xy02 = two_pairs(v0, v2), xy13 = two_pairs(v1, v3), yz02 = two_pairs(v0 + 1, v2 + 1), yz13 = two_pairs(v1 + 1, v3 + 1);
  x = _mm256_unpacklo_pd(xy02, xy13);
  y = _mm256_unpackhi_pd(xy02, xy13);
  z = _mm256_unpackhi_pd(yz02, yz13);
}
INLINE void load_vectors(const double* v, const Index* j, D8& x, D8& y, D8& z) {
  four_vectors(v, j, x.a, y.a, z.a);
  four_vectors(v, j + 4, x.b, y.b, z.b);
}
INLINE D8 load_scalars(const double* q, const Index* j) {
  return {_mm256_setr_pd(q[j[0]], q[j[1]], q[j[2]], q[j[3]]), _mm256_setr_pd(q[j[4]], q[j[5]], q[j[6]], q[j[7]])};
}
INLINE double sum(D8 p) {
  const __m256d four = _mm256_add_pd(p.a, p.b);
  const __m128d two = _mm_add_pd(_mm256_castpd256_pd128(four), _mm256_extractf128_pd(four, 1));
  return _mm_cvtsd_f64(two) + _mm_cvtsd_f64(_mm_unpackhi_pd(two, two));
}
#include "flow/sph/pair_kernels_internal.h"
}  // namespace avx2
#pragma GCC pop_options

// g++ 12 takes the intrinsics' own "undefined" operand for a variable of ours (GCC bug 105593).
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC push_options
#pragma GCC target("avx512f,avx512dq,avx512bw,avx512vl")
namespace avx512 {
struct D8 {
  __m512d a;
};
INLINE D8 operator+(D8 p, D8 q) { return {_mm512_add_pd(p.a, q.a)}; }
INLINE D8 operator-(D8 p, D8 q) { return {_mm512_sub_pd(p.a, q.a)}; }
INLINE D8 operator*(D8 p, D8 q) { return {_mm512_mul_pd(p.a, q.a)}; }
INLINE D8 operator/(D8 p, D8 q) { return {_mm512_div_pd(p.a, q.a)}; }
INLINE D8 fill(double a) { return {_mm512_set1_pd(a)}; }
INLINE D8 root(D8 p) { return {_mm512_sqrt_pd(p.a)}; }
INLINE D8 above_zero(D8 p) { return {_mm512_max_pd(p.a, _mm512_setzero_pd())}; }
INLINE D8 where_positive(D8 test, D8 yes, D8 no) { return {_mm512_mask_blend_pd(_mm512_cmp_pd_mask(test.a, _mm512_setzero_pd(), _CMP_GT_OQ), no.a, yes.a)}; }
INLINE __m512d two_packed(const Packed* p, Index j, Index k) {
  return _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_load_pd(&p[j].x)), _mm256_load_pd(&p[k].x), 1);
}
INLINE void load_packed(const Packed* p, const Index* j, D8& x, D8& y, D8& z, D8& w) {
  const __m512d r02 = two_packed(p, j[0], j[2]), r13 = two_packed(p, j[1], j[3]), r46 = two_packed(p, j[4], j[6]), r57 = two_packed(p, j[5], j[7]);
  const __m512d xz0123 = _mm512_unpacklo_pd(r02, r13), yw0123 = _mm512_unpackhi_pd(r02, r13);
  const __m512d xz4567 = _mm512_unpacklo_pd(r46, r57), yw4567 = _mm512_unpackhi_pd(r46, r57);
  x.a = _mm512_shuffle_f64x2(xz0123, xz4567, 0x88);
  y.a = _mm512_shuffle_f64x2(yw0123, yw4567, 0x88);
  z.a = _mm512_shuffle_f64x2(xz0123, xz4567, 0xdd);
  w.a = _mm512_shuffle_f64x2(yw0123, yw4567, 0xdd);
}
// Loads and shuffles in place of gathers, which some processors' microcode has made slow.
INLINE __m512d two_vectors(const double* v, Index j, Index k) {
  constexpr __mmask8 kXyz = 0x7;  // the fourth is not read
  return _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_maskz_loadu_pd(kXyz, v + 3 * std::size_t{j})), _mm256_maskz_loadu_pd(kXyz, v + 3 * std::size_t{k}), 1);
}
INLINE void load_vectors(const double* v, const Index* j, D8& x, D8& y, D8& z) {
  const __m512d r02 = two_vectors(v, j[0], j[2]), r13 = two_vectors(v, j[1], j[3]), r46 = two_vectors(v, j[4], j[6]), r57 = two_vectors(v, j[5], j[7]);
  const __m512d xz0123 = _mm512_unpacklo_pd(r02, r13), y0123 = _mm512_unpackhi_pd(r02, r13);
  const __m512d xz4567 = _mm512_unpacklo_pd(r46, r57), y4567 = _mm512_unpackhi_pd(r46, r57);
  x.a = _mm512_shuffle_f64x2(xz0123, xz4567, 0x88);
  y.a = _mm512_shuffle_f64x2(y0123, y4567, 0x88);
  z.a = _mm512_shuffle_f64x2(xz0123, xz4567, 0xdd);
}
INLINE __m256d four_scalars(const double* q, const Index* j) { return _mm256_setr_pd(q[j[0]], q[j[1]], q[j[2]], q[j[3]]); }
INLINE D8 load_scalars(const double* q, const Index* j) { return {_mm512_insertf64x4(_mm512_castpd256_pd512(four_scalars(q, j)), four_scalars(q, j + 4), 1)}; }
INLINE double sum(D8 p) {
  const __m256d four = _mm256_add_pd(_mm512_castpd512_pd256(p.a), _mm512_extractf64x4_pd(p.a, 1));
  const __m128d two = _mm_add_pd(_mm256_castpd256_pd128(four), _mm256_extractf128_pd(four, 1));
  return _mm_cvtsd_f64(two) + _mm_cvtsd_f64(_mm_unpackhi_pd(two, two));
}
#include "flow/sph/pair_kernels_internal.h"
}  // namespace avx512
#pragma GCC pop_options
#pragma GCC diagnostic pop

#endif
#undef INLINE

}  // namespace

void PairKernels::build(const ParticleSystem& s, Simd simd) {
  ZONE("sph.pack");
  CHECK(simd <= best_simd());
  CHECK(s.neighbors != nullptr);
  CHECK_GE(s.neighbors->size(), s.size());
  CHECK_GT(s.support, 0.0);
  for (const Real period : s.period) CHECK(period == 0 || period >= 2 * s.support);
  lanes_ = &scalar::kTable;
#if defined(__x86_64__)
  if (simd == Simd::kAvx2) lanes_ = &avx2::kTable;
  if (simd == Simd::kAvx512) lanes_ = &avx512::kTable;
#endif
  const Real per_support = 1 / s.support;
  packed_.resize(s.size());
  view_ = {packed_.data(), s.neighbors, s.period.x() * per_support, s.period.y() * per_support, s.kernel};
  parallel_for(s.size(), [&](std::size_t i) {
    const Vec3 x = s.x[i] * per_support;
    packed_[i] = {x.x(), x.y(), x.z(), 1};
  }, 4096);

  // What the lanes leave out: they work in supports, on kernels without their constants.
  volume_ = s.volume();
  support_ = s.support;
  with_kernel(s, [&](const auto& kernel, auto) { height_ = kernel.W(0); });
  const Real shape = s.kernel == KernelKind::kWendlandC2 ? -20 : s.kernel == KernelKind::kCubicSpline ? 1 : -3;
  slope_ = shape * height_ / (support_ * support_);
  stiffness_ = 0;
}

void PairKernels::set_viscosity(std::span<const Real> mu) {
  CHECK_EQ(mu.size(), size());
  const Real largest = parallel_max(size(), 0, [&](std::size_t i) { return mu[i]; });
  parallel_for(size(), [&](std::size_t i) {
    CHECK_GE(mu[i], 1e-30 * largest);
    CHECK_GT(mu[i], 0.0);
    packed_[i].stiffness = largest / mu[i];
  }, 4096);
  // mu_ij = 2 mu_i mu_j / (mu_i + mu_j) = 2 largest / (stiffness_i + stiffness_j)
  stiffness_ = 2 * largest * ViscousWeight(support_).factor;
}

void PairKernels::check(std::size_t begin, std::size_t end, std::size_t in, std::size_t out) const {
  CHECK(begin <= end && end <= size());
  CHECK_EQ(in, size());
  CHECK_EQ(out, size());
}

void PairKernels::density(std::size_t begin, std::size_t end, std::span<Real> sum, std::span<Vec3> slope) const {
  check(begin, end, sum.size(), size());
  CHECK(slope.size() == size() || slope.size() == end - begin);
  if (begin < end) lanes_->density(view_, volume_ * height_, volume_ * slope_ * support_, begin, end, sum.data(), slope[0].data(), slope.size() == size() ? 0 : begin);
}

void PairKernels::viscous(std::size_t begin, std::size_t end, std::span<const Vec3> v, std::span<Vec3> out) const {
  check(begin, end, v.size(), out.size());
  if (begin == end) return;
  CHECK_GT(stiffness_, 0.0);  // set_viscosity has been called
  lanes_->viscous(view_, volume_ * stiffness_ * support_ * support_, begin, end, v[0].data(), out[0].data());
}

void PairKernels::viscous_block(std::size_t begin, std::size_t end, std::span<Mat3> out) const {
  check(begin, end, size(), size());
  CHECK_EQ(out.size(), end - begin);
  if (begin == end) return;
  CHECK_GT(stiffness_, 0.0);  // set_viscosity has been called
  lanes_->viscous_block(view_, volume_ * stiffness_ * support_ * support_, begin, end, out[0].data());
}

void PairKernels::friction_power(std::size_t begin, std::size_t end, std::span<const Vec3> v, std::span<Real> out) const {
  check(begin, end, v.size(), out.size());
  if (begin == end) return;
  CHECK_GT(stiffness_, 0.0);
  lanes_->friction_power(view_, volume_ * stiffness_ * support_ * support_, begin, end, v[0].data(), out.data());
}

void PairKernels::velocity_gradient(std::size_t begin, std::size_t end, std::span<const Vec3> v, std::span<Mat3> gradient, std::span<Mat3> moment) const {
  check(begin, end, v.size(), size());
  CHECK_EQ(gradient.size(), end - begin);
  CHECK_EQ(moment.size(), end - begin);
  const Real factor = volume_ * slope_ * support_;
  if (begin < end) lanes_->velocity_gradient(view_, factor, -factor * support_, begin, end, v[0].data(), gradient[0].data(), moment[0].data());
}

void PairKernels::divergence(std::size_t begin, std::size_t end, std::span<const Vec3> v, std::span<Real> out) const {
  check(begin, end, v.size(), size());
  CHECK(out.size() == size() || out.size() == end - begin);
  if (begin < end) lanes_->divergence(view_, volume_ * slope_ * support_, begin, end, v[0].data(), out.data(), out.size() == size() ? 0 : begin);
}

void PairKernels::gradient(std::size_t begin, std::size_t end, std::span<const Real> q, std::span<Vec3> out) const {
  check(begin, end, q.size(), size());
  CHECK(out.size() == size() || out.size() == end - begin);
  if (begin < end) lanes_->gradient(view_, volume_ * slope_ * support_, begin, end, q.data(), out[0].data(), out.size() == size() ? 0 : begin);
}

void PairKernels::compliance(std::size_t begin, std::size_t end, std::span<const Real> weight, std::span<Vec3> slope, std::span<Real> squares) const {
  check(begin, end, weight.size(), slope.size());
  CHECK_EQ(squares.size(), size());
  if (begin < end) lanes_->compliance(view_, volume_ * slope_ * support_, begin, end, weight.data(), slope[0].data(), squares.data());
}

std::size_t PairKernels::memory() const { return packed_.capacity() * sizeof(Packed); }

}  // namespace effuse::flow::sph
