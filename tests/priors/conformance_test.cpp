// What every prior promises, over every plugin that is found and some of their options.
#include <Eigen/Eigenvalues>
#include <cmath>
#include <set>
#include <vector>

#include "support/largest.hpp"
#include "view.hpp"

namespace rhec {
namespace conformance_test {

using namespace testing;

struct Case {
  std::string name, options;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const std::string& name : host().names(PluginKind::prior)) {
    all.push_back({name, "{}"});
    for (const OptionRow& row : host().options(PluginKind::prior, name)) {
      if (row.name == "smoothness")
        for (const char* value : {"1/2", "5/2"}) all.push_back({name, std::string("{smoothness: ") + value + "}"});
      if (row.name == "length") all.push_back({name, "{length: 0.3}"});
      if (row.name == "mean_walk") all.push_back({name, "{mean_walk: 0.2, mean_sigma: 0}"});
      if (row.name == "along") all.push_back({name, "{along: time, course: held}"});
    }
  }
  return all;
}

class EveryPrior : public ::testing::TestWithParam<Case> {
 protected:
  const std::shared_ptr<Prior> prior_ = make(GetParam().name, GetParam().options);
};

/// The least eigenvalue of a covariance whose variances have been scaled to 1.
double least_eigenvalue(const Eigen::MatrixXd& covariance) {
  Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt();
  for (double& each : scale)
    if (!(each > 0.0)) each = 1.0;
  const Eigen::MatrixXd scaled = scale.cwiseInverse().asDiagonal() * covariance * scale.cwiseInverse().asDiagonal();
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled).eigenvalues()[0];
}

TEST_P(EveryPrior, HasStatesOfWhichEachIsOfAnotherKind) {
  ASSERT_GE(prior_->state_count(), 1);
  ASSERT_LE(prior_->state_count(), Prior::max_states);
  const auto states = prior_->states();
  EXPECT_EQ(states[0], ProcessState::value);
  EXPECT_EQ(std::set<ProcessState>(states.begin(), states.end()).size(), states.size());
}

/// The slope is what the value changes by, and the curvature what the slope changes by.
TEST_P(EveryPrior, HasDerivativesThatAreThose) {
  constexpr double d = 1e-6;
  const Advance step(*prior_, d);
  const auto states = prior_->states();
  for (std::size_t k = 1; k < states.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    if (states[k] == ProcessState::slope) {
      EXPECT_NEAR(step.F(0, column) / d, 1.0, 1e-4);
    } else if (states[k] == ProcessState::curvature) {
      EXPECT_NEAR(step.F(column - 1, column) / d, 1.0, 1e-4);
    } else {
      EXPECT_NEAR(step.F(column, column), 1.0, 1e-4);
    }
  }
}

TEST_P(EveryPrior, StartsWithACovariance) {
  const Start start(*prior_);
  EXPECT_TRUE(start.mean.allFinite() && start.covariance.allFinite());
  EXPECT_EQ(largest(start.covariance - start.covariance.transpose()), 0.0);
  EXPECT_GT(least_eigenvalue(start.covariance), -1e-12);
  EXPECT_GT(start.covariance(0, 0) + largest(Advance(*prior_, 1.0).Q), 0.0) << "it can neither be nor become uncertain";
}

TEST_P(EveryPrior, StaysWhereItIsIfNothingIsCovered) {
  const Advance none(*prior_, 0.0);
  EXPECT_EQ(largest(none.F - Eigen::MatrixXd::Identity(none.F.rows(), none.F.cols())), 0.0);
  EXPECT_EQ(largest(none.Q), 0.0);
}

/// The noise of advances from microscopic to endless is a covariance, also where its entries differ by many powers of
/// ten: relative to its own diagonal.
TEST_P(EveryPrior, AddsNoiseThatIsACovariance) {
  for (double d = 1e-6; d < 1e5; d *= 3.0) {
    const Advance step(*prior_, d);
    ASSERT_TRUE(step.F.allFinite() && step.Q.allFinite()) << d;
    EXPECT_EQ(largest(step.Q - step.Q.transpose()), 0.0) << d;
    EXPECT_GE(step.Q.diagonal().minCoeff(), 0.0) << d;
    EXPECT_GT(least_eigenvalue(step.Q), -1e-12) << d;
  }
}

TEST_P(EveryPrior, GivesTheSameMomentsInOneAdvanceOrTwo) {
  for (const double d : {1e-4, 0.03, 1.0, 7.0, 300.0}) {
    for (const double share : {0.5, 0.01}) {
      const Advance whole(*prior_, d), first(*prior_, share * d), second(*prior_, (1.0 - share) * d);
      const Eigen::MatrixXd F = second.F * first.F, Q = second.F * first.Q * second.F.transpose() + second.Q;
      const Eigen::VectorXd sigma = whole.Q.diagonal().cwiseSqrt();
      for (int r = 0; r < F.rows(); ++r) {
        for (int c = 0; c < F.cols(); ++c) {
          EXPECT_NEAR(F(r, c), whole.F(r, c), 1e-12 * (1.0 + std::abs(whole.F(r, c)))) << d << " " << share;
          EXPECT_NEAR(Q(r, c), whole.Q(r, c), 1e-11 * sigma[r] * sigma[c]) << d << " " << share;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Found, EveryPrior, ::testing::ValuesIn(cases()), [](const auto& about) {
  std::string name = about.param.name + "_" + std::to_string(about.index);
  return name;
});

TEST(Priors, OfTheHouseAreFound) {
  EXPECT_THAT(host().names(PluginKind::prior), ::testing::IsSupersetOf({"constant", "jumps", "matern", "walk"}));
}

TEST(Priors, AreRefusedInWords) {
  EXPECT_THAT(error_of([] { make("matern", "{smoothness: 7/2}"); }), HasSubstr("expected one of 1/2, 3/2, 5/2"));
  EXPECT_THAT(error_of([] { make("matern", "{length: 0}"); }), HasSubstr("greater than 0"));
  EXPECT_THAT(error_of([] { make("walk", "{sigam: 1}"); }), HasSubstr("did you mean 'sigma'"));
  EXPECT_THAT(error_of([] { make("mattern"); }), HasSubstr("did you mean 'matern'"));
}

}  // namespace conformance_test
}  // namespace rhec
