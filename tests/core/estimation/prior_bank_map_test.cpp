// A bank whose members follow a map.
#include <gtest/gtest.h>

#include <cmath>

#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/prior_bank.hpp"
#include "rhec/core/prior/walk_prior.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace prior_bank_map_test {

using namespace testing;

constexpr double kappa = 0.7, mu = 0.9, sigma = 0.05;

std::shared_ptr<SlipMap> map_of_a_line() {
  SlipMap::Setup setup;
  setup.parameters = 2;
  setup.capacity = 1000;
  auto map = std::make_shared<SlipMap>(setup);
  const double means[] = {kappa, mu}, variances[] = {sigma * sigma, 4.0 * sigma * sigma};
  for (double x = 0.0; x < 40.0; x += 0.25) map->add(x, 0.0, means, variances);
  map->begin_drive(0.0);
  return map;
}

PriorBank::Setup following(const Model& model, std::shared_ptr<SlipMap> map, int members = 1) {
  PriorBank::Setup setup;
  PriorCombination walks;
  for (const Variable& parameter : model.description().parameters) {
    auto walk = std::make_shared<WalkPrior>(WalkPrior::Walk{});
    walk->set_up(parameter);
    walks.push_back(std::move(walk));
  }
  setup.members.assign(members, walks);
  setup.output_variances = {1e-4, 1e-4, 1e-4};
  setup.input_variances = {1e-4, 1e-4};
  setup.map = std::move(map);
  setup.deviations.assign(members, {{4.0, 1.0, 0.0}, {4.0, 2.0, 0.0}});
  return setup;
}

// Without measurements, what is known of the parameters after many lengths is what the map says: its mean, and its
// variance with the member's inflation. Never more, however many nodes there are.
TEST(PriorBankMap, FallsToTheMapWithoutMeasurements) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  PriorBank bank(model, following(*model, map_of_a_line()));
  bank.reset(Eigen::Vector4d::Zero(), 1e-6 * Eigen::Matrix4d::Identity());
  const double inputs[] = {2.0, 0.0};
  for (int k = 0; k < 100; ++k) bank.predict(inputs, 0.2);
  ASSERT_TRUE(bank.knows_place());
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  bank.moments(mean, covariance);
  EXPECT_NEAR(mean[4], kappa, 1e-3);
  EXPECT_NEAR(mean[5], mu, 1e-3);
  EXPECT_NEAR(covariance(4, 4) / (sigma * sigma), 1.0, 1e-3);
  EXPECT_NEAR(covariance(5, 5) / (16.0 * sigma * sigma), 1.0, 1e-3);
}

// One interval against the formula: p_1 = m + phi (p_0 - m) + w.
TEST(PriorBankMap, IsAnOrnsteinUhlenbeckProcessAboutTheMap) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  PriorBank bank(model, following(*model, map_of_a_line()));
  bank.reset(Eigen::Vector4d(5.0, 0.0, 0.0, 0.0), 1e-6 * Eigen::Matrix4d::Identity());
  Eigen::VectorXd before, after;
  Eigen::MatrixXd spread_before, spread_after;
  bank.moments(before, spread_before);
  const double inputs[] = {2.0, 0.0};
  bank.predict(inputs, 0.5);
  bank.moments(after, spread_after);
  const double phi = std::exp(-bank.distance() / 4.0);
  EXPECT_NEAR(after[4], kappa + phi * (before[4] - kappa), 1e-12);
  EXPECT_NEAR(spread_after(4, 4), phi * phi * spread_before(4, 4) + (1.0 - phi * phi) * sigma * sigma, 1e-12);
}

TEST(PriorBankMap, BesideTheMapItsPriorsHold) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  PriorBank bank(model, following(*model, map_of_a_line()));
  bank.reset(Eigen::Vector4d(5.0, 30.0, 0.0, 0.0), 1e-6 * Eigen::Matrix4d::Identity());
  Eigen::VectorXd before, after;
  Eigen::MatrixXd covariance;
  bank.moments(before, covariance);
  const double inputs[] = {2.0, 0.0};
  bank.predict(inputs, 0.5);
  bank.moments(after, covariance);
  EXPECT_FALSE(bank.knows_place());
  EXPECT_EQ(after.tail(2), before.tail(2));
}

TEST(PriorBankMap, TakesAShareOfOtherMoments) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  PriorBank bank(model, following(*model, map_of_a_line(), 2));
  bank.reset(Eigen::Vector4d::Zero(), Eigen::Matrix4d::Identity());
  Eigen::VectorXd own, mixed;
  Eigen::MatrixXd own_covariance, mixed_covariance;
  bank.moments(own, own_covariance);
  const Eigen::VectorXd other = Eigen::VectorXd::LinSpaced(6, 1.0, 2.0);
  const Eigen::MatrixXd other_covariance = 2.0 * Eigen::MatrixXd::Identity(6, 6);
  bank.take_share(0.25, other.data(), other_covariance.data());
  bank.moments(mixed, mixed_covariance);
  const Eigen::VectorXd away = other - own;
  EXPECT_LT((mixed - own - 0.25 * away).norm(), 1e-12);
  EXPECT_LT((mixed_covariance - 0.75 * own_covariance - 0.25 * other_covariance - 0.75 * 0.25 * away * away.transpose())
                .norm(),
            1e-12);
  bank.take_share(1.0, other.data(), other_covariance.data());
  bank.moments(mixed, mixed_covariance);
  EXPECT_LT((mixed - other).norm(), 1e-12);
  EXPECT_LT((mixed_covariance - other_covariance).norm(), 1e-12);
}

// What comes from elsewhere is fused with the map once, as two independent sources; from then on the map is a process.
TEST(PriorBankMap, MeetsTheMapOnce) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  PriorBank bank(model, following(*model, map_of_a_line()));
  Eigen::VectorXd mean = (Eigen::VectorXd(6) << 5.0, 0.0, 0.0, 0.0, 0.5, 0.8).finished();
  Eigen::MatrixXd covariance = 1e-8 * Eigen::MatrixXd::Identity(6, 6);
  covariance(4, 4) = covariance(5, 5) = 0.04;
  bank.take_share(1.0, mean.data(), covariance.data());
  const double inputs[] = {2.0, 0.0};
  bank.predict(inputs, 1e-3);
  Eigen::VectorXd after;
  bank.moments(after, covariance);
  const double expected = 1.0 / (1.0 / 0.04 + 1.0 / (sigma * sigma));
  EXPECT_NEAR(after[4], expected * (0.5 / 0.04 + kappa / (sigma * sigma)), 1e-3);
  EXPECT_NEAR(covariance(4, 4) / expected, 1.0, 1e-2);
  bank.predict(inputs, 1e-3);
  Eigen::MatrixXd later;
  bank.moments(after, later);
  EXPECT_NEAR(later(4, 4) / covariance(4, 4), 1.0, 1e-2);
}

// A bank of one member: the likelihood is that of its innovations.
TEST(PriorBankMap, GivesTheLikelihoodOfAnUpdate) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  PriorBank::Setup setup = following(*model, nullptr);
  setup.deviations.clear();
  PriorBank bank(model, setup);
  bank.reset(Eigen::Vector4d(0.4, 0.0, 0.0, 0.0), 0.01 * Eigen::Matrix4d::Identity());
  const double outputs[] = {0.05, nan, nan};
  bank.update(outputs);
  EXPECT_NEAR(bank.log_likelihood(), -0.5 * (0.0025 / 0.0101 + std::log(0.0101)), 1e-9);
  const double nothing[] = {nan, nan, nan};
  bank.update(nothing);
  EXPECT_EQ(bank.log_likelihood(), 0.0);
}

TEST(PriorBankMap, RefusesWhatDoesNotFit) {
  const std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  PriorBank::Setup setup = following(*model, map_of_a_line());
  setup.deviations.clear();
  EXPECT_THROW(PriorBank(model, setup), Error);
  setup = following(*model, map_of_a_line());
  setup.deviations[0].pop_back();
  EXPECT_THROW(PriorBank(model, setup), Error);
  setup = following(*model, map_of_a_line());
  setup.deviations[0][0].length = 0.0;
  EXPECT_THROW(PriorBank(model, setup), Error);
  SlipMap::Setup one;
  one.capacity = 1;
  EXPECT_THROW(PriorBank(model, following(*model, std::make_shared<SlipMap>(one))), Error);
}

}  // namespace prior_bank_map_test
}  // namespace rhec
