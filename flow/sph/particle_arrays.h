#pragma once

#include <cstring>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "geometry/base/error.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/base/types.h"

/// What every holder of one array a quantity, one element a particle, needs.
namespace effuse::flow::sph {

/// values[k] = values[which[k]]: reorders, or drops those not named.
template <class T>
void gather(std::vector<T>& values, std::span<const Index> which) {
  std::vector<T> out(which.size());
  parallel_for(which.size(), [&](std::size_t k) { out[k] = values[which[k]]; }, 4096);
  values.swap(out);
}

/// The i in [0, n) with wanted(i), rising. wanted is called once each, in parallel.
template <class F>
void select(std::size_t n, F&& wanted, std::vector<Index>& out) {
  constexpr std::size_t kGrain = 4096;
  out.resize(n);
  std::vector<std::size_t> count((n + kGrain - 1) / kGrain);
  parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
    std::size_t place = begin;
    for (std::size_t i = begin; i < end; ++i)
      if (wanted(i)) out[place++] = static_cast<Index>(i);
    count[begin / kGrain] = place - begin;
  });
  // Each chunk's own are at its beginning: close the gaps.
  std::size_t total = 0;
  for (std::size_t k = 0; k < count.size(); ++k) {
    if (total != k * kGrain && count[k] > 0) std::memmove(out.data() + total, out.data() + k * kGrain, count[k] * sizeof(Index));
    total += count[k];
  }
  out.resize(total);
}

/// Throws InputError unless all sizes are n: for arrays that were loaded.
inline void check_loaded_sizes(std::size_t n, std::initializer_list<std::size_t> sizes) {
  for (const std::size_t other : sizes)
    if (other != n) throw InputError(Place{}, "the checkpoint's arrays disagree: " + std::to_string(n) + " and " + std::to_string(other) + " particles");
}

/// An archive, as StateWriter and StateReader are, that hashes.
struct HashArchive {
  StateHash& hash;
  template <class T>
  void array(std::string_view, const std::vector<T>& values) {
    hash.add(std::span<const T>(values));
  }
  template <class T>
  void value(std::string_view, T v) {
    hash.add(v);
  }
};

}  // namespace effuse::flow::sph
