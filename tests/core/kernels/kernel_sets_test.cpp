#include "rhec/core/kernels/kernel_sets.hpp"

#include <gtest/gtest.h>

namespace rhec {
namespace kernel_sets_test {

TEST(KernelSets, AreThereForEverySetThatThisMachineRuns) {
  ASSERT_FALSE(runnable_kernels().empty());
  EXPECT_STREQ(runnable_kernels().front().instruction_set, "generic");
#if defined(__x86_64__)
  EXPECT_EQ(runnable_kernels().size() > 1, __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"));
#endif
}

}  // namespace kernel_sets_test
}  // namespace rhec
