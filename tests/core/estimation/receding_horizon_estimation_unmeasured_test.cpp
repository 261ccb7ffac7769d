// Blocks that the measurements hardly determine: driving straight with zero steering gives no information on the side
// slip mu, and a single interval little on the longitudinal slip kappa. The estimate must stay plausible.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace receding_horizon_estimation_unmeasured_test {

using namespace rhec::testing;

struct Drive {
  int size = 1, overlap = 0;
  std::string more;  ///< options of the blockings
  bool side_slip_in_one_block = false;
  ParameterWalk walk = {};
  double noise = 1.0;  ///< factor on all standard deviations
  unsigned seed = 1;
};

struct Result {
  double kappa_error = 0.0;  ///< mean absolute error over the second half
  double kappa_bias = 0.0;   ///< mean error over the second half
  double least_mu = 1.0, greatest_mu = 0.0;
  int at_bound = 0;  ///< samples with mu at a bound, of 61
};

constexpr int samples = 61;

Result drive_straight(const Drive& drive) {
  static const std::shared_ptr<Model> model = host().make_model("bicycle_slip");
  constexpr double kappa = 0.8, speed = 4.0, interval = 0.2, antenna = 0.4;
  const double sigma_y[] = {0.03, 0.03, 0.01745}, sigma_u[] = {0.1, 0.1};
  RecedingHorizonEstimation::Setup setup;
  for (const double sigma : sigma_y) setup.problem.output_weights.push_back(1.0 / (sigma * sigma));
  for (const double sigma : sigma_u) setup.problem.input_weights.push_back(1.0 / (sigma * sigma));
  const std::string options =
      "{size: " + std::to_string(drive.size) + ", overlap: " + std::to_string(drive.overlap) + drive.more + "}";
  setup.blockings = {blocking("structured", options),
                     drive.side_slip_in_one_block ? blocking("full_horizon") : blocking("structured", options)};
  setup.walks = {drive.walk, drive.walk};
  setup.initial_mean = Eigen::VectorXd::Zero(6);
  setup.initial_mean.tail(2).setConstant(0.5);
  setup.initial_covariance = Eigen::MatrixXd::Zero(6, 6);
  setup.initial_covariance.diagonal() << 0.01, 0.01, 0.01, 0.001, 0.25, 0.25;
  RecedingHorizonEstimation method(model, gn_rti(), setup);
  std::mt19937_64 bits(drive.seed);
  std::normal_distribution<double> normal;
  Estimate estimate = empty_estimate(*model);
  Result result;
  for (int k = 0; k < samples; ++k) {
    double u[] = {speed, 0.0}, y[] = {kappa * speed * interval * k - antenna, 0.0, 0.0};
    for (int j = 0; j < 2; ++j) u[j] += drive.noise * sigma_u[j] * normal(bits);
    for (int j = 0; j < 3; ++j) y[j] += drive.noise * sigma_y[j] * normal(bits);
    if (k == 0) method.start(y);
    if (k > 0) method.add_node(interval, u, y);
    method.estimate(estimate, Clock::time_point::max());
    method.prepare();
    EXPECT_FALSE(estimate.fallback);
    EXPECT_TRUE(estimate.state.allFinite() && estimate.parameters.allFinite() && estimate.covariance.allFinite());
    EXPECT_TRUE((estimate.covariance.diagonal().array() > 0.0).all());
    EXPECT_NEAR(estimate.state[0], kappa * speed * interval * k, 0.3);
    const double mu = estimate.parameters[1];
    result.least_mu = std::min(result.least_mu, mu);
    result.greatest_mu = std::max(result.greatest_mu, mu);
    result.at_bound += mu <= 0.0 || mu >= 1.0;
    if (k > samples / 2) {
      result.kappa_error += std::abs(estimate.parameters[0] - kappa) / (samples / 2);
      result.kappa_bias += (estimate.parameters[0] - kappa) / (samples / 2);
    }
  }
  return result;
}

template <class Check>
void for_each_blocking(const Check& check) {
  for (int size = 1; size <= 6; ++size) {
    for (int overlap = 0; overlap <= 6; ++overlap) {
      SCOPED_TRACE("S = " + std::to_string(size) + ", o = " + std::to_string(overlap));
      check(Drive{.size = size, .overlap = overlap, .more = ""});
    }
  }
}

const std::string linked = ", neighbour_sigma: 0.04";

TEST(UnmeasuredBlock, WithoutNoiseTheUnknownKeepsItsValueAndTheKnownIsFound) {
  for (const std::string& more : {std::string(), linked}) {
    for (const bool whole : {false, true}) {
      for_each_blocking([&](Drive drive) {
        drive.more = more;
        drive.side_slip_in_one_block = whole;
        drive.noise = 0.0;
        const Result result = drive_straight(drive);
        EXPECT_LT(result.kappa_error, 1e-3);
        EXPECT_NEAR(result.least_mu, 0.5, 1e-6);
        EXPECT_NEAR(result.greatest_mu, 0.5, 1e-6);
      });
    }
  }
}

TEST(UnmeasuredBlock, LongitudinalSlipConvergesWithEveryBlocking) {
  for (const std::string& more : {std::string(), linked}) {
    for_each_blocking([&](Drive drive) {
      drive.more = more;
      double error = 0.0, bias = 0.0;
      for (drive.seed = 1; drive.seed <= 4; ++drive.seed) {
        const Result result = drive_straight(drive);
        error += result.kappa_error / 4.0;
        bias += result.kappa_bias / 4.0;
      }
      // A single interval of 0.64 m between two fixes of 0.03 m determines kappa to 0.06.
      EXPECT_LT(error, drive.size == 1 && drive.overlap < 2 ? 0.07 : 0.045);
      EXPECT_LT(std::abs(bias), 0.02);
    });
  }
}

// Noise in the steering angle looks like steering without effect, which suggests a small mu: the measurements
// themselves occasionally drive mu to a bound. That must stay rare and brief.
TEST(UnmeasuredBlock, WithALinkOrAsOneBlockSideSlipSeldomReachesABound) {
  for (const bool whole : {false, true}) {
    int at_bound = 0, all = 0;
    for_each_blocking([&](Drive drive) {
      drive.more = linked;
      drive.side_slip_in_one_block = whole;
      for (drive.seed = 1; drive.seed <= 6; ++drive.seed) {
        at_bound += drive_straight(drive).at_bound;
        all += samples;
      }
    });
    std::printf("mu %s: at a bound in %.1f %% of the samples\n", whole ? "in one block" : "linked",
                100.0 * at_bound / all);
    EXPECT_LT(at_bound, (whole ? 0.15 : 0.1) * all);
  }
}

// Blocks that are not linked are regularised by `block_sigma` while they are in the window, and restart when they
// become its first. A hardly observable parameter needs a restart no wider than its bounds.
TEST(UnmeasuredBlock, WithoutALinkTheWalkHoldsTheSideSlip) {
  struct Row {
    double restart_sigma, most;
  };
  for (const Row row : {Row{1.0, 0.25}, Row{0.3, 0.12}, Row{0.1, 0.08}}) {
    int at_bound = 0, all = 0;
    for_each_blocking([&](Drive drive) {
      drive.walk.restart_sigma = row.restart_sigma;
      for (drive.seed = 1; drive.seed <= 6; ++drive.seed) {
        at_bound += drive_straight(drive).at_bound;
        all += samples;
      }
    });
    std::printf("mu restarted at %g: at a bound in %.1f %% of the samples\n", row.restart_sigma,
                100.0 * at_bound / all);
    EXPECT_LT(at_bound, row.most * all);
  }
}

TEST(UnmeasuredBlock, WithNoHoldAtAllNothingIsNaN) {
  for (const double noise : {0.0, 1.0}) {
    for (const char* more : {"", ", transition: ramp"}) {
      for (const bool whole : {false, true}) {
        for_each_blocking([&](Drive drive) {
          drive.more = more;
          drive.noise = noise;
          drive.side_slip_in_one_block = whole;
          drive.walk.block_sigma = std::numeric_limits<double>::infinity();
          const Result result = drive_straight(drive);
          if (*more) {
            EXPECT_LT(result.kappa_error, 0.2);
          }
        });
      }
    }
  }
}

}  // namespace receding_horizon_estimation_unmeasured_test
}  // namespace rhec
