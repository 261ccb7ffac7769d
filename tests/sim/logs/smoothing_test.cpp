#include "rhec/sim/logs/smoothing.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "sim/support/recorded_drive.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace smoothing_test {

using testing::HasSubstr;

class SmoothingTest : public RecordedDriveTest {
 protected:
  static constexpr HoldOut hold_out{5, 4};
  const LogScenario scenario_ = scenario_of(scenario_text, {"rhe"});

  SmoothedReplay smoothed(const RecordedLog& drive) const {
    const LogVariant& variant = scenario_.variants().front();
    return smooth(variant.name, variant.robot, drive, scenario_.log(), hold_out);
  }
};

TEST_F(SmoothingTest, EstimatesTheWholeDriveAtTheTimesOfTheEstimator) {
  const RecordedLog drive = log(scenario_);
  const SmoothedReplay result = smoothed(drive);
  EXPECT_EQ(result.report.status, Status::solved);
  EXPECT_TRUE(result.has_sigmas);
  EXPECT_EQ(result.smoothed.name, "rhe");
  EXPECT_EQ(result.causal.name, "rhe causal");
  EXPECT_EQ(result.smoothed.counts.estimates, 1);
  EXPECT_EQ(result.smoothed.counts.fallbacks, 0);
  ASSERT_EQ(result.smoothed.estimates.size(), result.causal.estimates.size());
  std::ptrdiff_t nodes = 0;
  for (std::size_t i = 0; i < result.smoothed.estimates.size(); ++i) {
    const LoggedEstimate &now = result.smoothed.estimates[i], &then = result.causal.estimates[i];
    EXPECT_EQ(now.time, then.time);
    EXPECT_EQ(now.fix, then.fix);
    EXPECT_EQ(now.held_out, then.held_out);
    EXPECT_TRUE(now.values.allFinite());
    EXPECT_EQ(now.sigmas.allFinite(), !now.held_out) << "sigmas are those of nodes";
    if (now.fix >= 0) {
      const Fix& fix = drive.fixes[static_cast<std::size_t>(now.fix)];
      // The receiver is where the vehicle's position is.
      EXPECT_NEAR(now.residual, std::hypot(now.values[0] - fix.x, now.values[1] - fix.y), 1e-9);
    }
    nodes += !now.held_out;
  }
  EXPECT_EQ(result.intervals, nodes - 1);
}

TEST_F(SmoothingTest, KnowsFromTheStartWhatTheEstimatorLearnsOnItsWay) {
  const RecordedLog drive = log(scenario_);
  const SmoothedReplay result = smoothed(drive);
  EXPECT_LT(summarise(result.smoothed, drive).all.median, 0.02);
  // Of a drive whose speed factor is one number: soon after the vehicle has begun to move.
  const auto error_at = [&](const Replay& replay, double time) {
    for (const LoggedEstimate& entry : replay.estimates)
      if (!entry.held_out && entry.time >= time) return std::abs(entry.values[4] - kappa);
    throw Error("the drive ends before");
  };
  EXPECT_LT(error_at(result.smoothed, 2.2), 0.05);
  EXPECT_GT(error_at(result.causal, 2.2), error_at(result.smoothed, 2.2));
}

TEST_F(SmoothingTest, AWithheldFixLeavesNoTrace) {
  const RecordedLog drive = log(scenario_);
  RecordedLog bent = drive;
  for (std::size_t i = 0; i < bent.fixes.size(); ++i)
    if (hold_out.holds(i)) bent.fixes[i].x += 100.0;
  const SmoothedReplay straight = smoothed(drive), other = smoothed(bent);
  ASSERT_EQ(straight.smoothed.estimates.size(), other.smoothed.estimates.size());
  for (std::size_t i = 0; i < straight.smoothed.estimates.size(); ++i)
    EXPECT_EQ(straight.smoothed.estimates[i].values, other.smoothed.estimates[i].values) << i;
  EXPECT_GT(summarise(other.smoothed, bent).all.median, 1.0) << "what is predicted is not what was bent";
}

TEST_F(SmoothingTest, WithoutAFixNothingCanBeEstimated) {
  RecordedLog drive = log(scenario_);
  drive.fixes.resize(5);
  drive.fixes.erase(drive.fixes.begin(), drive.fixes.begin() + 4);
  const LogVariant& variant = scenario_.variants().front();
  EXPECT_THAT(error_of([&] {
                smooth(variant.name, variant.robot, drive, scenario_.log(), {1, 0});
              }),
              HasSubstr("the log has no fix that is not withheld"));
}

}  // namespace smoothing_test
}  // namespace rhec::sim
