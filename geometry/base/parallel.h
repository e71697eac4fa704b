#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "geometry/base/types.h"

/// Parallel loops and sums that give the same bits on any number of threads.
///
/// A loop is cut into chunks whose size depends on its length and grain only, never on the threads.
/// parallel_for: one writer per index. parallel_sum and parallel_max: a partial result per chunk,
/// combined in the chunks' order. Of the body's exceptions that of the first chunk is rethrown in the caller.
namespace effuse {

/// At most n threads, the caller's included, until the scope ends (n >= 1). Limits OpenVDB too.
class ThreadLimit {
 public:
  explicit ThreadLimit(int n);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Threads a parallel loop may use now.
int thread_count();

/// Calls body(context, begin, end) for the chunks [k*grain, min((k+1)*grain, n)), in any order.
void parallel_chunks(std::size_t n, std::size_t grain, void (*body)(void* context, std::size_t begin, std::size_t end), void* context);

/// body(begin, end) over chunks of [0, n).
template <class Body>
void parallel_ranges(std::size_t n, std::size_t grain, Body&& body) {
  using B = std::remove_reference_t<Body>;
  parallel_chunks(
      n, grain, [](void* context, std::size_t begin, std::size_t end) { (*static_cast<B*>(context))(begin, end); },
      const_cast<std::remove_const_t<B>*>(std::addressof(body)));
}

/// body(i) for i in [0, n). grain: iterations one thread takes at a time.
template <class Body>
void parallel_for(std::size_t n, Body&& body, std::size_t grain = 256) {
  parallel_ranges(n, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

/// combine(... combine(zero, f(0)) ..., f(n-1)), chunk by chunk in a fixed order.
template <class T, class F, class Combine>
T parallel_reduce(std::size_t n, T zero, F&& f, Combine&& combine, std::size_t grain = 1024) {
  const std::size_t chunks = (n + grain - 1) / grain;
  std::vector<T> partial(chunks, zero);
  parallel_ranges(n, grain, [&](std::size_t begin, std::size_t end) {
    T sum = zero;
    for (std::size_t i = begin; i < end; ++i) sum = combine(sum, f(i));
    partial[begin / grain] = sum;
  });
  T total = zero;
  for (const T& part : partial) total = combine(total, part);
  return total;
}

/// sum of f(i), i in [0, n).
template <class T, class F>
T parallel_sum(std::size_t n, T zero, F&& f, std::size_t grain = 1024) {
  return parallel_reduce(n, zero, f, [](const T& a, const T& b) -> T { return a + b; }, grain);
}

/// max of lowest and every f(i), i in [0, n). A NaN of f is not seen: test finiteness apart.
template <class F>
Real parallel_max(std::size_t n, Real lowest, F&& f, std::size_t grain = 1024) {
  return parallel_reduce(n, lowest, f, [](Real a, Real b) { return std::max(a, b); }, grain);
}

}  // namespace effuse
