// What the measurements along a drive tell of its first state and of the parameters.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdint>
#include <memory>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace drive_information_test {

using testing::Contains;
using testing::HasSubstr;

TEST(DriveInformation, KnowsThatAParameterIsSeenOnlyWhileTurning) {
  const ModelCheck found = check();
  const DriveInformation &straight = drive_of(found, "straight"), &turn = drive_of(found, "turn"),
                         &standing = drive_of(found, "standing");
  EXPECT_TRUE(std::isfinite(straight.parameter_sigma[0]));
  EXPECT_TRUE(std::isinf(straight.parameter_sigma[1]));
  EXPECT_TRUE(std::isfinite(turn.parameter_sigma[1]));
  EXPECT_TRUE(std::isinf(standing.parameter_sigma[0]));
  EXPECT_THAT(standing.undetermined, Contains("psi"));
  EXPECT_THAT(finding_of(found, "observability").found, HasSubstr("(turn, slalom)"));
}

/// Standing on a straight: positions measured N + 1 times, a speed factor that is the slope of a line.
TEST(DriveInformation, AttainsTheStandardDeviationOfAStraightLine) {
  ModelCheckOptions options;
  options.horizon = 12;
  options.interval = 0.25;
  options.speed = 1.5;
  options.output_sigmas = {0.02, 0.02};
  options.input_sigmas = {1e-12, 1e-12};  // as good as known
  const ModelCheck found = check({}, options);
  // Along the line: position = start + kappa u t, with u = 1.5 / kappa at kappa = 0.6; by regression the slope in time
  // has the variance sigma^2 / sum (t - mean)^2.
  double sum = 0.0;
  for (int k = 0; k <= 12; ++k) sum += 0.25 * 0.25 * (k - 6.0) * (k - 6.0);
  const double expected = 0.02 / std::sqrt(sum) / (1.5 / 0.6);
  EXPECT_NEAR(drive_of(found, "straight").parameter_sigma[0], expected, 1e-4 * expected);
  // A constant offset of the speed's noise cannot be told from the factor: less is known with noise.
  options.input_sigmas = {0.5, 1e-12};
  EXPECT_GT(drive_of(check({}, options), "straight").parameter_sigma[0], 1.2 * expected);
}

TEST(DriveInformation, BearsAnyNoiseAndHorizon) {
  for (const double sigma : {1e-300, 1e-12, 1e12, 1e300}) {
    for (const int horizon : {1, 2, 1000}) {
      ModelCheckOptions options;
      options.samples = 16;
      options.horizon = horizon;
      options.output_sigmas = {sigma, 0.01};
      options.input_sigmas = {0.01, sigma};
      const ModelCheck found = check({}, options);
      for (const DriveInformation& drive : found.drives) {
        EXPECT_EQ(drive.unusable, "");
        EXPECT_LE(drive.rank, drive.unknowns);
        EXPECT_TRUE(std::isfinite(drive.condition));
      }
    }
  }
}

class BlocksOfFive : public Blocking {
 public:
  explicit BlocksOfFive(Transition transition) : transition_(transition) {}
  std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept override {
    for (int i = 0; i < window.intervals; ++i) begins[i] = i % 5 == 0;
    return window.first;
  }
  Transition transition() const noexcept override { return transition_; }

 private:
  Transition transition_;
};

TEST(DriveInformation, KnowsLessOfAParameterInBlocks) {
  const ModelCheck one = check();
  for (const Transition transition : {Transition::step, Transition::ramp}) {
    ModelCheckOptions options;
    options.blockings = {std::make_shared<BlocksOfFive>(transition), std::make_shared<BlocksOfFive>(transition)};
    const ModelCheck blocks = check({}, options);
    EXPECT_EQ(drive_of(blocks, "turn").unknowns, 4 + 3 + 3);
    EXPECT_GT(drive_of(blocks, "turn").parameter_sigma[0], drive_of(one, "turn").parameter_sigma[0]);
    EXPECT_THAT(drive_of(blocks, "straight").undetermined, Contains("mu[2]"));
  }
}

}  // namespace drive_information_test
}  // namespace rhec::sim
