#include "core/estimation/recent_samples.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/linear_case.hpp"
#include "support/sensor_faults.hpp"

namespace rhec {
namespace recent_samples_test {

using namespace rhec::testing;

WalkingFilter make_filter() {
  const auto model = linear_model<Boat>();
  WalkingFilter filter(model, {.noise = {.output_variances = {0.04, 0.01},
                                         .input_variances = {1e-4},
                                         .parameter_lower = {-1e3},
                                         .parameter_upper = {1e3}},
                               .walk = {0.05},
                               .step = 0.1,
                               .substeps = 4});
  filter.mean() = initial_mean(*model);
  filter.covariance() = initial_covariance(*model);
  return filter;
}

/// A filter that goes by a slow output and a quick one, and remembers.
struct Drive {
  WalkingFilter filter = make_filter();
  RecentSamples recent{filter};
  std::vector<double> expected{0.0, 0.0};
  double time = 0.0;

  void sample(double after, double slow, double quick) {
    const std::vector<double> input{0.7 + 0.5 * std::sin(3.0 * time)};
    filter.predict(input.data(), after);
    recent.note_inputs(input);
    time += after;
    const double outputs[] = {slow, quick}, none[] = {nan, nan};
    filter.update(outputs);
    filter.expect();
    for (int j = 0; j < 2; ++j) expected[static_cast<std::size_t>(j)] = filter.expected(j);
    recent.remember(time, filter, expected, outputs, {none, none}, !std::isnan(slow));
  }
  /// A slow one each second, and so many quick ones; they say the same, but for something that changes sign.
  void second(int quick) {
    sample(1.0 / quick, 0.3 * time, nan);
    for (int k = 1; k < quick; ++k) sample(1.0 / quick, nan, filter.expected(1) + (k % 2 ? 0.05 : -0.04));
  }
};

TEST(RecentSamples, AreOneByOneWhereTheyAreFarApart) {
  Drive drive;
  drive.recent.join_within(0.01);
  for (int k = 0; k < 3; ++k) drive.second(10);
  EXPECT_EQ(drive.recent.known(), 30);
  EXPECT_EQ(drive.recent.connected(), 30);
  EXPECT_EQ(drive.recent.with_positions(1), 10);
  EXPECT_EQ(drive.recent.with_positions(2), 20);
  EXPECT_EQ(drive.recent.with_positions(3), 0);  // nothing is known of what was before
  EXPECT_EQ(drive.recent.since_position(), 9);
  EXPECT_EQ(drive.recent.behind(drive.time), 0);
  EXPECT_EQ(drive.recent.behind(drive.time - 0.25), 3);
  EXPECT_EQ(drive.recent.behind(-1.0), -1);
  EXPECT_EQ(drive.recent.since(drive.time - 0.25), 3);
  drive.recent.disconnect();
  EXPECT_EQ(drive.recent.known(), 30);
  EXPECT_EQ(drive.recent.connected(), 0);
  EXPECT_EQ(drive.recent.with_positions(1), 0);
  EXPECT_EQ(drive.recent.since_position(), 0);
}

/// However quick the other sensors are, so many positions are remembered.
TEST(RecentSamples, OfQuickSensorsDoNotPushPositionsOut) {
  Drive drive;
  drive.recent.join_within(1.0 / 16.0);
  for (int k = 0; k < 40; ++k) drive.second(200);
  const int entries = drive.recent.with_positions(24);
  ASSERT_GT(entries, 0);
  EXPECT_LE(entries, 24 * 18);
  EXPECT_NEAR(drive.recent.entry(entries).time, drive.time - 24.0, 0.1);
  EXPECT_TRUE(drive.recent.entry(entries - 1).has_position);
}

/// What is tried anew from the past ends where the filter is, as if they had not been joined.
TEST(RecentSamples, ThatAreJoinedSayWhatTheyHaveSaidOneByOne) {
  Drive drive, apart;
  drive.recent.join_within(0.05);
  for (int k = 0; k < 5; ++k) {
    drive.second(100);
    apart.second(100);
  }
  ASSERT_LT(drive.recent.known(), apart.recent.known() / 3);
  ASSERT_EQ(drive.filter.mean(), apart.filter.mean());
  const auto replayed = [](Drive& of) {
    WalkingFilter filter = make_filter();
    const int back = of.recent.with_positions(3);
    of.recent.go_back(back, filter);
    of.recent.replay(back, filter, [&](const RecentSamples::Entry& entry) { filter.update(entry.outputs.measured()); });
    return filter;
  };
  const WalkingFilter joined = replayed(drive), single = replayed(apart);
  for (Eigen::Index j = 0; j < joined.mean().size(); ++j) {
    const double sigma = std::sqrt(single.covariance()(j, j));
    EXPECT_NEAR(single.mean()[j], drive.filter.mean()[j], 1e-6 * sigma) << j;
    EXPECT_NEAR(joined.mean()[j], single.mean()[j], 0.05 * sigma) << j;
    EXPECT_NEAR(std::sqrt(joined.covariance()(j, j)), sigma, 0.05 * sigma) << j;
  }
}

/// Where something has begun behind a sample, that stays the last one of its entry; a position is always one of its
/// own.
TEST(RecentSamples, ThatAreKeptStayOneOfTheirOwn) {
  Drive drive;
  drive.recent.join_within(1.0);
  drive.sample(0.1, 0.1, nan);
  drive.sample(0.1, nan, 0.2);
  drive.sample(0.1, nan, 0.2);
  ASSERT_EQ(drive.recent.known(), 2);
  EXPECT_DOUBLE_EQ(drive.recent.keep_newest(), drive.time);
  EXPECT_EQ(drive.recent.entry(0).samples, 2);
  EXPECT_NE(drive.recent.entry(0).outputs.measured().weights, nullptr);
  EXPECT_EQ(drive.recent.entry(0).outputs.measured().weight(1), 2.0);
  EXPECT_EQ(drive.recent.entry(0).judged().weight(1), 1.0);
  drive.sample(0.1, nan, 0.2);
  EXPECT_EQ(drive.recent.known(), 3);
  drive.sample(0.1, 0.5, nan);
  drive.sample(0.1, nan, 0.2);
  EXPECT_EQ(drive.recent.known(), 5);
  drive.recent.forget();
  EXPECT_EQ(drive.recent.known(), 0);
}

}  // namespace recent_samples_test
}  // namespace rhec
