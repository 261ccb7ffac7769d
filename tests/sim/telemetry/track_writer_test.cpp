#include "rhec/sim/telemetry/track_writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "logs/support/rows.hpp"
#include "sim/support/driven_log.hpp"

namespace rhec::sim {
namespace track_writer_test {

class TrackWriterTest : public DrivenLogTest {
 protected:
  /// Drives, and writes the estimates by a writer.
  template <class Open>
  RunLog drive_and_write(const Open& open) {
    const Scenario scenario(Host(), settings_of("figure8"));
    const auto writer = open(scenario);
    const RunLog run =
        run_closed_loop(scenario, {.sampled = [&](const LoopSample& sample) {
                          writer->write(track_sample(sample, scenario.robot(), 1'700'000'000'000'000'000));
                        }});
    writer->close();
    return run;
  }
};

TEST_F(TrackWriterTest, MessagesHaveWhatTheRunHad) {
  const RunLog run = drive_and_write(
      [&](const Scenario& scenario) { return open_track_mcap(file("x.mcap"), scenario.robot(), &scenario.path()); });
  const auto log = logs::open_log(file("x.mcap"));
  const logs::Rows odometry =
      logs::rows_of(*log, "/rhec/odometry",
                    {{"pose.pose.position.x", "pose.covariance[0]", "pose.covariance[35]", "twist.twist.linear.x"}});
  const logs::Rows slip = logs::rows_of(*log, "/rhec/slip", {{"position[kappa]", "effort[kappa]", "position[mu]"}});
  const logs::Rows inputs = logs::rows_of(*log, "/rhec/inputs", {{"position[u1]"}});
  const logs::Rows plan =
      logs::rows_of(*log, "/rhec/plan", {{"poses[0].pose.position.x", "poses[15].pose.position.x"}});
  const logs::Rows health = logs::rows_of(*log, "/diagnostics", {{"status[0].level"}});
  ASSERT_EQ(odometry.values.size(), run.samples.size());
  ASSERT_EQ(slip.values.size(), run.samples.size());
  for (std::size_t i = 0; i < run.samples.size(); ++i) {
    const Sample& sample = run.samples[i];
    EXPECT_EQ(odometry.values[i][0], sample.state[0]);
    EXPECT_NEAR(std::sqrt(odometry.values[i][1]), sample.sigma[0], 1e-12);
    EXPECT_NEAR(std::sqrt(odometry.values[i][2]), sample.sigma[2], 1e-12);
    EXPECT_EQ(slip.values[i], (std::vector<double>{sample.parameters[0], sample.sigma[4], sample.parameters[1]}));
    EXPECT_EQ(inputs.values[i][0], sample.inputs[0]);
    EXPECT_EQ(odometry.stamps[i], 1'700'000'000'000'000'000 + std::llround(1e9 * sample.time));
    EXPECT_EQ(health.values[i][0], static_cast<double>(sample.health));
  }
  EXPECT_NEAR(plan.values[20][0], run.samples[20].state[0], 1e-6);
  EXPECT_TRUE(std::isfinite(plan.values[20][1]));
  EXPECT_EQ(logs::rows_of(*log, "/rhec/path", {{"poses[0].pose.position.x"}}).values.size(), 1u);
}

TEST_F(TrackWriterTest, TablesAndTrajectoriesHaveARowForEachSample) {
  const RunLog run =
      drive_and_write([&](const Scenario& scenario) { return open_track_csv(file("x.csv"), scenario.robot()); });
  const auto log = logs::open_log(file("x.csv"));
  const logs::Rows rows = logs::rows_of(*log, "", {{"kappa", "sigma_kappa", "u1"}});
  ASSERT_EQ(rows.values.size(), run.samples.size());
  EXPECT_NEAR(rows.values[30][0], run.samples[30].parameters[0], 1e-9);
  EXPECT_EQ(rows.stamps[30], 1'700'000'006'000'000'000);

  drive_and_write([&](const Scenario& scenario) { return open_track_tum(file("x.tum"), scenario.robot()); });
  std::ifstream tum(file("x.tum"));
  std::string line;
  std::getline(tum, line);
  EXPECT_THAT(line, testing::StartsWith("1700000000.000000000 "));
  EXPECT_EQ(std::count(line.begin(), line.end(), ' '), 7);
}

}  // namespace track_writer_test
}  // namespace rhec::sim
