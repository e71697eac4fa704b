#include "geometry/base/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <exception>
#include <mutex>

#include "geometry/base/check.h"

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
// libtbb is not instrumented: tell the race detector of the two points where it synchronises.
#define EFFUSE_TSAN_RELEASE(p) __tsan_release(p)
#define EFFUSE_TSAN_ACQUIRE(p) __tsan_acquire(p)
#else
#define EFFUSE_TSAN_RELEASE(p) (void)(p)
#define EFFUSE_TSAN_ACQUIRE(p) (void)(p)
#endif

namespace effuse {

struct ThreadLimit::Impl {
  tbb::global_control control;
};

ThreadLimit::ThreadLimit(int n) {
  CHECK_GE(n, 1);
  impl_.reset(new Impl{tbb::global_control(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(n))});
}
ThreadLimit::~ThreadLimit() = default;

int thread_count() { return static_cast<int>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism)); }

void parallel_chunks(std::size_t n, std::size_t grain, void (*body)(void*, std::size_t, std::size_t), void* context) {
  CHECK_GT(grain, std::size_t{0});
  const std::size_t chunks = (n + grain - 1) / grain;
  if (chunks <= 1 || thread_count() == 1) {
    for (std::size_t k = 0; k < chunks; ++k) body(context, k * grain, std::min((k + 1) * grain, n));
    return;
  }
  // Of several exceptions the one of the first chunk is rethrown: the one that a single thread would meet.
  std::mutex guard;
  std::exception_ptr error;
  std::size_t error_chunk = chunks;
  char started = 0, finished = 0;
  EFFUSE_TSAN_RELEASE(&started);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, chunks, 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        EFFUSE_TSAN_ACQUIRE(&started);
        for (std::size_t k = range.begin(); k != range.end(); ++k) {
          try {
            body(context, k * grain, std::min((k + 1) * grain, n));
          } catch (...) {
            const std::lock_guard lock(guard);
            if (k < error_chunk) {
              error_chunk = k;
              error = std::current_exception();
            }
          }
        }
        EFFUSE_TSAN_RELEASE(&finished);
      },
      tbb::simple_partitioner());
  EFFUSE_TSAN_ACQUIRE(&finished);
  if (error) std::rethrow_exception(error);
}

}  // namespace effuse
