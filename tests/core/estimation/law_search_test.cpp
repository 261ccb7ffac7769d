#include "core/estimation/law_search.hpp"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <random>

#include "rhec/core/prior/parameter_law.hpp"
#include "support/bank_case.hpp"

namespace rhec {
namespace law_search_test {

using namespace testing;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// A drive of the boat, one metre a second, whose parameter varies by a law.
NodeLog drive(const Model& model, const Prior& law, unsigned seed, int steps) {
  std::mt19937_64 bits(seed);
  std::normal_distribution<double> normal;
  const int n = law.state_count();
  const auto noise = noise_of(model);
  Eigen::VectorXd z(n), x = initial_mean(model).head(3), next(3), y(2);
  Eigen::MatrixXd F(n, n), Q(n, n);
  law.start(z.data(), Q.data());
  const double duration = 0.4;
  NodeLog log;
  for (int k = 0; k <= steps; ++k) {
    if (k > 0) {
      law.advance(duration, F.data(), Q.data());
      const Eigen::LDLT<Eigen::MatrixXd> factor(Q);
      Eigen::VectorXd w(n);
      for (double& each : w) each = normal(bits);
      const Eigen::VectorXd roots = factor.vectorD().cwiseMax(0.0).cwiseSqrt();
      const Eigen::MatrixXd L = factor.matrixL();
      const double start = z[0];
      z = F * z + factor.transpositionsP().transpose() * (L * roots.cwiseProduct(w));
      const double end = law.course() == Course::ramp ? z[0] : start, input = std::sin(0.3 * k);
      model.integrate({.count = 1,
                       .states = x.data(),
                       .inputs = &input,
                       .parameters = &start,
                       .parameters_end = &end,
                       .durations = &duration,
                       .next_states = next.data()});
      x = next;
      log.durations.push_back(duration);
      log.inputs.push_back(input + noise.inputs[0] * normal(bits));
    }
    model.observe({.count = 1, .states = x.data(), .outputs = y.data()});
    for (int j = 0; j < 2; ++j) log.outputs.push_back(y[j] + noise.outputs[j] * normal(bits));
  }
  return log;
}

class LawSearch : public ::testing::Test {
 protected:
  LawSearch() {
    filters_.bank = bank_setup(*model_, {{prior("walk", "{sigma: 1}")}});
    filters_.bank.least_speed = 1.0;
    filters_.initial_state = initial_mean(*model_).head(3);
    filters_.initial_covariance = 0.01 * Eigen::MatrixXd::Identity(3, 3);
    filters_.parameter_lower = {-infinity};
    filters_.parameter_upper = {infinity};
  }
  std::vector<WeighedLaws> found(const Prior& law, const std::vector<PriorCombination>& given, int most = 24) {
    return search_laws(model_, filters_, given, drive(*model_, law, 3, 600), most, 0.01);
  }

  std::shared_ptr<const Model> model_ = linear_model<Boat>();
  BankEstimation::Setup filters_;
};

TEST_F(LawSearch, FindsTheLawOfADriveAmongThoseGiven) {
  const PriorCombination choices = {prior("walk", "{sigma: 0.001}"), prior("matern", "{length: 8, sigma: 0.5}"),
                                    prior("jumps", "{length: 1, sigma: 2}")};
  for (std::size_t k = 0; k < choices.size(); ++k) {
    const auto laws = found(*choices[k], {choices});
    EXPECT_EQ(laws.front().priors[0], choices[k]) << k;
    EXPECT_GT(laws.front().probability, 0.9);
    EXPECT_EQ(laws.front().texts[0], "prior " + std::to_string(k + 1) + " of those given");
  }
}

TEST_F(LawSearch, FindsOneOfTheSameKindWhereNoneIsGiven) {
  const Variable& parameter = model_->description().parameters[0];
  const ParameterLaw constant{ParameterLaw::Kind::walk, 0.0005, 0.0}, quick{ParameterLaw::Kind::jumps, 3.0, 0.5};
  EXPECT_THAT(found(*constant.make(parameter), {{}}).front().texts[0], HasSubstr("walk of 0.001"));
  EXPECT_THAT(found(*quick.make(parameter), {{}}).front().texts[0], HasSubstr("jumps"));
}

TEST_F(LawSearch, ReturnsNoMoreThanAskedForAndSharesOutAllProbability) {
  const PriorCombination alike = {prior("walk", "{sigma: 0.1}"), prior("walk", "{sigma: 0.11}"),
                                  prior("walk", "{sigma: 0.12}")};
  for (const int most : {1, 2, 3}) {
    const auto laws = found(*alike[1], {alike}, most);
    ASSERT_THAT(laws, SizeIs(most));
    double sum = 0.0;
    for (const WeighedLaws& each : laws) sum += each.probability;
    EXPECT_NEAR(sum, 1.0, 1e-12);
    for (int k = 1; k < most; ++k) EXPECT_GE(laws[k - 1].probability, laws[k].probability);
  }
  EXPECT_THAT(found(*alike[1], {{alike[0]}}), SizeIs(1));
}

/// Where a bank is too small for all combinations, each parameter is searched with the best of the others.
TEST_F(LawSearch, SearchesParameterByParameterWhereThereAreManyCombinations) {
  const auto model = linear_model<Hovercraft>();
  BankEstimation::Setup filters = filters_;
  filters.bank = bank_setup(*model, {{prior("walk", "{sigma: 1}"), prior("walk", "{sigma: 1}")}});
  filters.initial_state = initial_mean(*model).head(4);
  filters.initial_covariance = initial_covariance(*model).topLeftCorner(4, 4);
  filters.parameter_lower.assign(2, -infinity);
  filters.parameter_upper.assign(2, infinity);
  NodeLog log;
  for (const auto& sample : simulate(*model, 120, true, 4)) {
    if (sample.duration > 0.0) {
      log.durations.push_back(sample.duration);
      log.inputs.insert(log.inputs.end(), sample.inputs.begin(), sample.inputs.end());
    }
    log.outputs.insert(log.outputs.end(), sample.outputs.begin(), sample.outputs.end());
  }
  PriorCombination walks;
  for (int k = 0; k < 8; ++k)
    walks.push_back(prior("walk", "{along: time, sigma: " + std::to_string(0.002 * std::pow(3.0, k)) + "}"));
  const auto laws = search_laws(model, filters, {walks, walks}, log, 24, 1e-6);
  // The best one of all 64, from banks of those that fit.
  double best = -infinity;
  PriorCombination expected;
  for (const auto& first : walks) {
    BankEstimation::Setup row = filters;
    row.bank.members.clear();
    for (const auto& second : walks) row.bank.members.push_back({first, second});
    const Passage passage = pass(model, row, log);
    for (std::size_t k = 0; k < walks.size(); ++k)
      if (passage.log_likelihoods[k] > best) {
        best = passage.log_likelihoods[k];
        expected = {first, walks[k]};
      }
  }
  EXPECT_EQ(laws.front().priors, expected);
}

}  // namespace law_search_test
}  // namespace rhec
