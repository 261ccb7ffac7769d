#include "rhec/sim/tuning/innovations.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rhec/sim/numbers/random.hpp"
#include "sim/support/weaving_drive.hpp"

namespace rhec::sim {
namespace innovations_test {

TEST(Innovations, DensitiesAreStudentsAndTheNormalOne) {
  const Innovation pair{.size = 2, .squared = 3.0, .log_determinant = 0.7};
  EXPECT_NEAR(log_density(pair, normal_degrees), -0.5 * (3.0 + 0.7) - std::log(2.0 * std::numbers::pi), 1e-12);
  EXPECT_NEAR(log_density(pair, 999.0), log_density(pair, normal_degrees), 3e-3);
  const Innovation single{.size = 1, .squared = 2.0, .log_determinant = 0.0};
  EXPECT_NEAR(log_density(single, 1.0), -std::log(std::numbers::pi * (1.0 + 2.0)), 1e-12);  // Cauchy
  EXPECT_EQ(log_density({}, 3.0), 0.0);
  // Over the plane, the density of a pair adds up to 1: integrated over rings.
  double sum = 0.0;
  for (double r = 0.0005; r < 200.0; r += 0.001)
    sum += 2.0 * std::numbers::pi * r * 0.001 * std::exp(log_density({2, r * r, 0.0}, 3.0));
  EXPECT_NEAR(sum, 1.0, 1e-4);
}

TEST(Innovations, TailsAreAsHeavyAsTheLogHasThem) {
  RandomStream random(5, "tails");
  std::vector<Innovation> normal, heavy;
  for (int i = 0; i < 3000; ++i) {
    const double a = random.normal(), b = random.normal();
    normal.push_back({2, a * a + b * b, 0.0});
    double scale = 0.0;  // chi squared of 4 degrees of freedom, over 4
    for (int k = 0; k < 4; ++k) {
      const double c = random.normal();
      scale += 0.25 * c * c;
    }
    heavy.push_back({2, (a * a + b * b) / scale, 0.0});
  }
  const std::vector<bool> all(normal.size(), true);
  EXPECT_GT(log_likelihood(normal, all).degrees, 30.0);
  EXPECT_NEAR(log_likelihood(heavy, all).degrees, 4.0, 0.6);
  EXPECT_EQ(log_likelihood(heavy, all).count, 3000);
}

TEST(Innovations, AreThoseOfAConsistentFilter) {
  const WeavingDrive drive;
  Settings settings = weaving_settings();
  settings.set("noise.outputs.x_gps", Settings::scalar("0.1"));
  settings.set("noise.outputs.y_gps", Settings::scalar("0.1"));
  settings.set("model.gps_offset", Settings::scalar("0.7"));
  settings.set("log.fix_delay", Settings::scalar("0.15"));
  settings.set("log.steering_bias", Settings::scalar("0.02"));
  const LogScenario scenario(Host(), settings);
  const RecordedLog log = recorded_log(drive.tables(), scenario);
  const HoldOut hold_out{5, 4};
  const std::vector<Innovation> found = innovations(scenario.variants().front().robot, log, scenario.log(), hold_out);
  ASSERT_EQ(found.size(), log.fixes.size());
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_TRUE(found[i].size == 2 || hold_out.holds(i) || i < 2) << i;
    if (found[i].size != 2 || log.fixes[i].time < 20.0) continue;
    sum += found[i].squared;
    ++count;
  }
  EXPECT_NEAR(sum / count, 2.0, 4.0 * 2.0 / std::sqrt(count));
}

TEST(Innovations, TakeACoordinateAlone) {
  const WeavingDrive drive{.seconds = 30.0};
  const LogScenario scenario(Host(), weaving_settings());
  RecordedLog log = recorded_log(drive.tables(), scenario);
  log.fixes[100].x = std::nan("");
  log.fixes[101].x = log.fixes[101].y = std::nan("");
  const auto found = innovations(scenario.variants().front().robot, log, scenario.log(), {});
  EXPECT_EQ(found[100].size, 1);
  EXPECT_EQ(found[101].size, 0);
  EXPECT_EQ(found[102].size, 2);
}

}  // namespace innovations_test
}  // namespace rhec::sim
