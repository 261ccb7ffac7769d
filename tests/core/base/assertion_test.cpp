// Assertions guard the calls between components; without NDEBUG, a violated one ends the program with its message.
#include "rhec/core/base/assertion.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "rhec/core/qp/iterate.hpp"
#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {
namespace assertion_test {

using testing::AllOf;
using testing::HasSubstr;

TEST(Assertion, SaysWhatDidNotHoldAndWhere) {
  std::string text;
  try {
    assertion_failed("a == b", "as many rows as columns");
  } catch (const std::logic_error& error) {
    text = error.what();
  }
  EXPECT_THAT(text, AllOf(HasSubstr("assertion_test.cpp:"), HasSubstr("a == b"), HasSubstr("as many rows as columns")));
}

TEST(Assertion, KnowsFiniteNumbers) {
  std::vector<double> values = {1.0, -2.0, 0.0};
  EXPECT_TRUE(all_finite(values));
  EXPECT_TRUE(all_finite(nullptr, 3)) << "null stands for 'not asked for'";
  values[1] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(all_finite(values));
  EXPECT_TRUE(all_finite(values.data(), 1));
  values[1] = std::nan("");
  EXPECT_FALSE(all_finite(values.data(), 3));
}

#ifdef NDEBUG
TEST(Assertion, CostsNothingInRelease) {
  int evaluations = 0;
  RHEC_ASSERT(++evaluations > 0, "is not evaluated");
  EXPECT_EQ(evaluations, 0);
}
#else
TEST(Assertion, ThrowsWhereThatIsPossible) {
  EXPECT_NO_THROW(RHEC_ASSERT(1 + 1 == 2, "arithmetic"));
  EXPECT_THROW(RHEC_ASSERT(1 + 1 == 3, "arithmetic"), std::logic_error);
}

using AssertionDeathTest = testing::Test;

TEST(AssertionDeathTest, EndsWhatMustNotThrowWithItsMessage) {
  const Capacity capacity{.intervals = 3, .states = 2, .controls = 1};
  StageQp qp(capacity);
  Iterate iterate(capacity);
  EXPECT_DEATH(qp.set_intervals(4), "at most the capacity");
  EXPECT_DEATH(qp.set_sizes(0, 3, 1), "at most the capacity");
  EXPECT_DEATH(static_cast<void>(*iterate.state(4)), "a stage of the capacity");
}
#endif

}  // namespace assertion_test
}  // namespace rhec
