#include "rhec/core/base/instruction_sets.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

namespace rhec {
namespace instruction_sets_test {

TEST(InstructionSets, TheGenericOneIsFirstAndRunsEverywhere) {
  EXPECT_EQ(instruction_sets[0].name, "generic");
  EXPECT_TRUE(machine_runs("generic"));
}

TEST(InstructionSets, OneThatIsNotOfThisProcessorIsNotRun) {
  EXPECT_FALSE(machine_runs("mmx"));
#if defined(__x86_64__)
  EXPECT_FALSE(machine_runs("neon"));
#else
  EXPECT_FALSE(machine_runs("avx2"));
#endif
}

TEST(InstructionSets, AMachineThatRunsOneRunsThoseBeforeIt) {
  bool runs = true;
  for (const InstructionSet& set : instruction_sets) {
    EXPECT_LE(machine_runs(set.name), runs) << set.name;
    runs = machine_runs(set.name);
  }
}

TEST(InstructionSets, WhatIsRunnableEndsBeforeTheFirstThatIsNot) {
  struct Kernels {
    std::string_view set;
  };
  const std::vector<Kernels> kernels{{"generic"}, {"mmx"}, {"generic"}};
  EXPECT_EQ(runnable_sets(kernels, &Kernels::set), 1u);
}

}  // namespace instruction_sets_test
}  // namespace rhec
