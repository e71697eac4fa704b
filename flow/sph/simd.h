#pragma once

namespace effuse::flow::sph {

/// Instruction sets that the loops over pairs are written for. The build targets the plain x86-64 of 2003;
/// what the processor has beyond it is found out when the program runs.
enum class Simd { kScalar, kAvx2, kAvx512 };

/// The widest that this processor has: kAvx2 means avx2 and fma, kAvx512 means avx512f, dq, bw and vl.
inline Simd best_simd() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
    return Simd::kAvx512;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return Simd::kAvx2;
#endif
  return Simd::kScalar;
}

}  // namespace effuse::flow::sph
