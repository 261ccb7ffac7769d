#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "rhec/core/base/instruction_sets.hpp"
#include "rhec/core/formula/tape.hpp"

namespace rhec {
namespace tape_sets_test {

TEST(TapeSets, TheGenericOneIsAlwaysThereAndFirst) {
  std::vector<std::string> names;
  for (const TapeKernels* kernels : runnable_tape_kernels()) names.emplace_back(kernels->name);
  std::vector<std::string> all;
  for (const InstructionSet& set : instruction_sets) all.emplace_back(set.name);
  ASSERT_FALSE(names.empty());
  ASSERT_LE(names.size(), all.size());
  EXPECT_THAT(names, testing::ElementsAreArray(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(names.size())));
}

TEST(TapeSets, LanesHoldTheRowsWithoutManyToSpare) {
  for (int count = 1; count <= 100; ++count) {
    int rows = 0, lanes = 0;
    while (rows < count) {
      const int next = lanes_for(count - rows);
      rows += std::min(next, count - rows);
      lanes += next;
    }
    EXPECT_LT(lanes - count, 8 + count % 8) << count;
  }
}

}  // namespace tape_sets_test
}  // namespace rhec
