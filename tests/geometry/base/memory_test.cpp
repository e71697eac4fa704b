#include "geometry/base/memory.h"

#include <gtest/gtest.h>

namespace effuse {
namespace {

TEST(Memory, OfAMachineThatRunsThisIsMoreThanAMegabyteAndLessThanAPetabyte) {
  EXPECT_GT(available_memory(), 1u << 20);
  EXPECT_LT(static_cast<double>(available_memory()), 1e15);
}

}  // namespace
}  // namespace effuse
