#include "geometry/base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "geometry/base/random.h"

namespace effuse {
namespace {

TEST(Parallel, SumsHaveTheSameBitsOnAnyNumberOfThreads) {
  for (const std::size_t n : {std::size_t{0}, std::size_t{1}, std::size_t{1023}, std::size_t{1024}, std::size_t{1025}, std::size_t{300001}}) {
    std::vector<Real> sums;
    for (const int threads : {1, 2, 4}) {
      const ThreadLimit limit(threads);
      sums.push_back(parallel_sum(n, Real{0}, [](std::size_t i) { return random_normal(3, 0, i) * std::pow(10.0, static_cast<double>(i % 13)); }));
    }
    EXPECT_EQ(sums[0], sums[1]) << n;
    EXPECT_EQ(sums[0], sums[2]) << n;
  }
}

TEST(Parallel, EveryIndexIsVisitedOnce) {
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    std::vector<std::atomic<int>> visits(10007);
    parallel_for(visits.size(), [&](std::size_t i) { ++visits[i]; }, 100);
    for (const auto& count : visits) ASSERT_EQ(count, 1);
  }
}

TEST(Parallel, ChunksDependOnLengthAndGrainOnly) {
  for (const int threads : {1, 4}) {
    const ThreadLimit limit(threads);
    std::vector<std::size_t> ends(8, 0);
    parallel_ranges(1050, 150, [&](std::size_t begin, std::size_t end) { ends[begin / 150] = end; });
    EXPECT_EQ(ends, (std::vector<std::size_t>{150, 300, 450, 600, 750, 900, 1050, 0}));
  }
}

TEST(Parallel, AnExceptionReachesTheCaller) {
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    EXPECT_THROW(parallel_for(5000, [](std::size_t i) { if (i == 4321) throw std::runtime_error("here"); }, 16), std::runtime_error);
  }
}

TEST(Parallel, OfSeveralExceptionsTheFirstChunksArrives) {
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    try {
      parallel_for(5000, [](std::size_t i) { if (i % 100 == 99) throw std::runtime_error(std::to_string(i)); }, 16);
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "99") << threads << " threads";
    }
  }
}

TEST(Parallel, MaxIsTheLargestOrTheLowest) {
  EXPECT_EQ(parallel_max(0, -5, [](std::size_t) { return 1.0; }), -5);
  EXPECT_EQ(parallel_max(5000, 0, [](std::size_t i) { return static_cast<Real>(i == 4000 ? 7 : 3); }), 7);
}

TEST(Parallel, ALimitEndsWithItsScope) {
  const int before = thread_count();
  {
    const ThreadLimit limit(1);
    EXPECT_EQ(thread_count(), 1);
  }
  EXPECT_EQ(thread_count(), before);
}

TEST(Parallel, LoopsInsideLoopsAreComplete) {
  std::vector<Real> sums(64);
  parallel_for(sums.size(), [&](std::size_t i) { sums[i] = parallel_sum(2000, Real{0}, [](std::size_t k) { return static_cast<Real>(k); }); }, 1);
  for (Real sum : sums) EXPECT_EQ(sum, 1999000);
}

}  // namespace
}  // namespace effuse
