#include "rhec/core/base/call_memory.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace rhec {
namespace call_memory_test {

TEST(CallMemory, HasRoomForOneRowAtLeast) {
  EXPECT_EQ(CallMemory(0).rows(), 4096);
  EXPECT_EQ(CallMemory(1000).rows(), 4);
  EXPECT_EQ(CallMemory(4096).rows(), 1);
  EXPECT_EQ(CallMemory(100000).rows(), 1);
  for (const std::size_t row : {0, 1000, 4096, 100000}) {
    const CallMemory memory(row);
    double sum = 0.0;
    memory.lend([&](double* numbers) {
      std::fill_n(numbers, row, 1.0);
      for (std::size_t k = 0; k < row; ++k) sum += numbers[k];
    });
    EXPECT_EQ(sum, static_cast<double>(row));
  }
}

/// What is in reserve is there from the start, and the same for all calls.
TEST(CallMemory, IsInReserveWhereARowIsWide) {
  const CallMemory memory(5000);
  double *first = nullptr, *second = nullptr;
  memory.lend([&](double* numbers) { first = numbers; });
  memory.lend([&](double* numbers) { second = numbers; });
  EXPECT_EQ(first, second);
}

}  // namespace call_memory_test
}  // namespace rhec
