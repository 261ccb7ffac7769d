#include "sim/check/samples.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace samples_test {

ModelDescription about() {
  ModelDescription made = unicycle_description();
  made.states[1].lower = -2.0;
  made.states[1].upper = 4.0;
  return made;
}

TEST(Samples, BeginAtZeroStayInsideAndHaveEdges) {
  Samples samples(about(), 1, "test"), same(about(), 1, "test");
  const std::size_t size = samples.dimensions().size();
  EXPECT_EQ(size, 4U + 2U + 2U);
  int at_bounds = 0;
  for (int i = 0; i < 200; ++i) {
    const Samples::Point z = samples.sample(i);
    EXPECT_EQ(z, same.sample(i));
    ASSERT_EQ(z.size(), size);
    for (std::size_t j = 0; j < size; ++j) {
      const Samples::Dimension& d = samples.dimensions()[j];
      EXPECT_TRUE(d.lower <= z[j] && z[j] <= d.upper) << d.name;
      if (i == 0) {
        EXPECT_EQ(z[j], std::clamp(0.0, d.lower, d.upper));
      }
    }
    at_bounds += z[1] == -2.0 || z[1] == 4.0;
  }
  EXPECT_GT(at_bounds, 10);
}

TEST(Samples, DrawOneVariableAnew) {
  Samples samples(about(), 1, "test");
  Samples::Point z = samples.sample(2);
  z.push_back(17.0);  // more than the variables
  const Samples::Point other = samples.redrawn(z, 1);
  EXPECT_NE(other[1], z[1]);
  EXPECT_EQ(other.back(), 17.0);
  EXPECT_TRUE(std::equal(z.begin() + 2, z.end(), other.begin() + 2));
}

TEST(RegionOf, NamesTheVariableThatDecides) {
  Samples samples(about(), 1, "test");
  const auto is_bad = [](const Samples::Point& z) { return z[1] > 1.0 && z[1] < 2.0; };
  std::vector<Samples::Point> bad;
  for (int i = 0; i < 500; ++i)
    if (Samples::Point z = samples.sample(i); is_bad(z)) bad.push_back(std::move(z));
  ASSERT_GT(bad.size(), 10U);
  const std::string region = region_of(samples, bad, [&](std::span<const Samples::Point> points) {
    std::vector<bool> judged;
    for (const Samples::Point& z : points) judged.push_back(is_bad(z));
    return judged;
  });
  EXPECT_THAT(region, testing::StartsWith(samples.dimensions()[1].name + " in [1."));
  EXPECT_EQ(region.find(';'), std::string::npos) << region;
}

}  // namespace samples_test
}  // namespace rhec::sim
