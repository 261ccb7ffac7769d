#include "logs/cdr/field_path.hpp"

#include <gtest/gtest.h>

#include "support/error_of.hpp"

namespace rhec::logs {
namespace field_path_test {

TEST(FieldPath, StepsHaveNamesAndItems) {
  const std::vector<PathStep> steps = parse_path("transforms[arm/wheel.left].pose[3].x");
  ASSERT_EQ(steps.size(), 3u);
  EXPECT_EQ(steps[0].name, "transforms");
  EXPECT_EQ(*steps[0].item, "arm/wheel.left");
  EXPECT_EQ(index_in(*steps[1].item), 3u);
  EXPECT_FALSE(index_in(*steps[0].item));
  EXPECT_FALSE(steps[2].item);
}

TEST(FieldPath, RefusesWhatIsNone) {
  for (const char* text : {"", "a..b", "a[", "a[]", "a[1]b", ".a", "a."})
    EXPECT_NE(error_of([&] { parse_path(text); }), "") << text;
}

}  // namespace field_path_test
}  // namespace rhec::logs
