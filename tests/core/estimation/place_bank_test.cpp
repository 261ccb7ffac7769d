#include "rhec/core/estimation/place_bank.hpp"

#include <gtest/gtest.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/prior/standard_bank.hpp"
#include "rhec/core/prior/walk_prior.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace place_bank_test {

using namespace testing;

/// A straight way along x at 2 m/s with kappa .8, over a map that says `mapped` between 20 m and 60 m.
class PlaceBankTest : public ::testing::Test {
 protected:
  std::shared_ptr<const Model> model_ = host().make_model("bicycle_slip");

  PriorBank::Setup filters() const {
    ModelDescription about = model_->description();
    for (Variable& parameter : about.parameters) parameter.lower = 0.0, parameter.upper = 1.0;
    PriorBank::Setup setup;
    setup.members = standard_bank(about);
    setup.output_variances = {4e-4, 4e-4, 1e-4};
    setup.input_variances = {1e-3, 1e-3};
    return setup;
  }
  PlaceBank::Setup places(double mapped) const {
    SlipMap::Setup of_two;
    of_two.parameters = 2;
    of_two.capacity = 1000;
    auto map = std::make_shared<SlipMap>(of_two);
    const double means[] = {mapped, 0.9}, variances[] = {1e-4, 1e-2};
    for (double x = 20.0; x < 60.0; x += 0.25) map->add(x, 0.0, means, variances);
    map->begin_drive(0.0);
    PlaceBank::Setup setup;
    setup.bank = filters();
    PriorCombination walks;
    for (const Variable& parameter : model_->description().parameters) {
      auto walk = std::make_shared<WalkPrior>(WalkPrior::Walk{});
      walk->set_up(parameter);
      walks.push_back(std::move(walk));
    }
    setup.bank.members.assign(2, walks);
    setup.bank.map = map;
    setup.bank.deviations = {{{3.0, 1.0}, {6.0, 1.0}}, {{8.0, 2.0}, {8.0, 2.0}}};
    return setup;
  }
  /// Drives to an x [m].
  static void drive_to(double x, BankHistory& history, PlaceBank& places) {
    const double inputs[] = {2.5, 0.0};
    while (true) {
      const std::int64_t next = history.newest() + 1;
      const double at = 0.4 * static_cast<double>(next);
      if (at > x) return;
      const double outputs[] = {at - 0.4 + 0.01 * static_cast<double>(next % 3 - 1), 0.0, 0.0};
      if (next == 0)
        history.start(outputs);
      else
        history.add(0.2, inputs, outputs);
      places.follow(history, next);
    }
  }
  BankHistory fresh() const {
    BankHistory history(PriorBank(model_, filters()), 16, 64);
    history.bank().reset(Eigen::Vector4d::Zero(), 1e-4 * Eigen::Matrix4d::Identity());
    return history;
  }
};

TEST_F(PlaceBankTest, IsTheBankWhereTheMapKnowsNothing) {
  BankHistory history = fresh();
  PlaceBank places(model_, this->places(0.8));
  drive_to(15.0, history, places);
  EXPECT_FALSE(places.knows_place());
  EXPECT_EQ(places.probability(), this->places(0.8).before);
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  history.bank().moments(mean, covariance);
  const Eigen::VectorXd before = mean;
  places.fuse(mean, covariance);
  EXPECT_EQ(mean, before);
}

TEST_F(PlaceBankTest, BelievesAMapThatIsRightMoreThanOneThatIsWrong) {
  double right = 0.0, wrong = 0.0;
  for (const double mapped : {0.8, 0.6}) {
    BankHistory history = fresh();
    PlaceBank places(model_, this->places(mapped));
    drive_to(50.0, history, places);
    ASSERT_TRUE(places.knows_place());
    (mapped == 0.8 ? right : wrong) = places.probability();
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    history.bank().moments(mean, covariance);
    places.fuse(mean, covariance);
    EXPECT_NEAR(mean[4], 0.8, 0.03) << mapped;
  }
  EXPECT_GT(right, 10.0 * wrong);
  EXPECT_LT(wrong, 0.01);
}

TEST_F(PlaceBankTest, FollowsAnAmendedHistoryAsIfItHadBeenSoFromTheStart) {
  BankHistory in_time = fresh(), late = fresh();
  PlaceBank one(model_, places(0.8)), other(model_, places(0.8));
  drive_to(40.0, in_time, one);
  drive_to(40.0, late, other);
  const std::int64_t node = late.newest() - 4;
  const double outputs[] = {0.4 * static_cast<double>(node) - 0.38, 0.02, nan};
  ASSERT_TRUE(late.amend(4, outputs));
  other.follow(late, node);
  EXPECT_NE(one.probability(), other.probability());
  // The same again changes nothing.
  const double probability = other.probability();
  ASSERT_TRUE(late.amend(4, outputs));
  other.follow(late, node);
  EXPECT_EQ(probability, other.probability());
}

TEST_F(PlaceBankTest, RefusesWhatDoesNotFit) {
  const auto refused = [&](auto change) {
    PlaceBank::Setup setup = places(0.8);
    change(setup);
    EXPECT_THROW(PlaceBank(model_, setup), Error);
  };
  refused([](PlaceBank::Setup& s) { s.bank.map = nullptr; });
  refused([](PlaceBank::Setup& s) { s.change = 0.0; });
  refused([](PlaceBank::Setup& s) { s.before = 1.0; });
  refused([&](PlaceBank::Setup& s) { s.bank.members = filters().members; });
}

}  // namespace place_bank_test
}  // namespace rhec
