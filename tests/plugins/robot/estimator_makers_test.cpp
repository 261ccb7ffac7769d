// The estimators that a configuration can name, and those that a program adds.
#include "rhec/plugins/robot/estimator_makers.hpp"

#include <gmock/gmock.h>

#include <utility>

#include "plugins/robot/robots.hpp"
#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/core/estimation/banked_covariance.hpp"
#include "rhec/core/estimation/filter_estimation.hpp"
#include "rhec/core/estimation/prior_horizon_estimation.hpp"
#include "rhec/plugins/robot/estimator_section.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace estimator_makers_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

/// An estimator of a program's own: it believes in its initial mean, whatever is measured.
class Stubborn final : public EstimationMethod {
 public:
  explicit Stubborn(const EstimatorParts& parts) : model_(parts.context->model), mean_(parts.initial_mean) {}
  const Model& model() const noexcept override { return *model_; }
  int substeps() const noexcept override { return 1; }
  void start(Measured) noexcept override {}
  void add(const MeasuredInterval&, Measured) noexcept override {}
  void estimate(Estimate& result, Clock::time_point) noexcept override {
    result.state = mean_.head(model_->state_count());
    result.parameters = mean_.tail(model_->parameter_count());
  }
  void reset() noexcept override {}

 private:
  std::shared_ptr<const Model> model_;
  Eigen::VectorXd mean_;
};

EstimatorMaker stubborn() {
  return {"stubborn", "keeps its first opinion",
          [](const EstimatorParts& parts) { return std::make_unique<Stubborn>(parts); }};
}

EstimatorSection section(const std::string& text, EstimatorMakers makers) {
  const auto context = context_with();
  return {context, BlockingSection(context, {}), settings(text), std::move(makers)};
}

TEST(EstimatorMakers, HaveTheRobotsOwn) {
  const EstimatorMakers makers;
  ASSERT_EQ(makers.all().size(), 3U);
  EXPECT_EQ(makers.all()[0].name, "rhe");
  EXPECT_EQ(makers.all()[1].name, "ekf");
  EXPECT_EQ(makers.all()[2].name, "bank");
  const EstimatorParts parts = section("", makers).parts();
  EXPECT_NE(dynamic_cast<PriorHorizonEstimation*>(makers.named("rhe").make(parts).get()), nullptr);
  const auto context = context_with();
  const EstimatorSection blocked(context, BlockingSection(context, settings("{kappa: structured}")), settings(""));
  EXPECT_NE(dynamic_cast<BankedCovariance*>(makers.named("rhe").make(blocked.parts()).get()), nullptr);
  const EstimatorSection alone(context, BlockingSection(context, settings("{kappa: structured}")),
                               settings("{covariance: blocks}"));
  EXPECT_NE(dynamic_cast<RecedingHorizonEstimation*>(makers.named("rhe").make(alone.parts()).get()), nullptr);
  EXPECT_NE(dynamic_cast<FilterEstimation*>(makers.named("ekf").make(parts).get()), nullptr);
  const auto bank = makers.named("bank").make(parts);
  ASSERT_NE(dynamic_cast<BankEstimation*>(bank.get()), nullptr);
  EXPECT_EQ(dynamic_cast<BankEstimation&>(*bank).bank().member_count(), 24);
}

TEST(EstimatorMakers, TakeThoseOfAProgram) {
  const EstimatorSection chosen =
      section("{name: stubborn, initial: {state: {beta: 0.5}}}", EstimatorMakers().add(stubborn()));
  const auto estimator = chosen.make();
  const double outputs[3] = {7.0, 7.0, 0.1};
  estimator->push_measurement(0.0, outputs);
  EXPECT_EQ(estimator->estimate(0.0).state, Eigen::Vector4d(0.0, 0.0, 0.5, 0.0));

  const OptionRow row = EstimatorSection::documentation(EstimatorMakers().add(stubborn())).rows.front();
  EXPECT_EQ(row.constraint, "one of rhe, ekf, bank, stubborn");
  EXPECT_THAT(row.meaning, HasSubstr("stubborn: keeps its first opinion"));
}

TEST(EstimatorMakers, AreOnlyThoseOfTheRobotThatHasThem) {
  EXPECT_THAT(error_of([] { section("name: stubborn", {}); }),
              AllOf(StartsWith("robot.yaml:1: name: found 'stubborn', expected one of rhe, ekf, bank"),
                    testing::Not(HasSubstr("ekf, stubborn"))));
  EstimatorSection chosen = section("name: stubborn", EstimatorMakers().add(stubborn()));
  chosen.use({});
  EXPECT_THAT(error_of([&] { chosen.make(); }), HasSubstr("no estimator 'stubborn'; expected one of rhe, ekf, bank"));
}

TEST(EstimatorMakers, HaveEachNameOnce) {
  EstimatorMakers makers;
  makers.add(stubborn());
  const std::size_t count = makers.all().size();
  EXPECT_THAT(error_of([&] { makers.add(stubborn()); }), HasSubstr("an estimator 'stubborn' already"));
  EXPECT_EQ(makers.all().size(), count);
}

TEST(EstimatorMakers, MakeNothingOfABlockingThatDoesNotFitTheHorizon) {
  const auto context = context_with();
  const BlockingSection wide(context, settings("mu: {name: structured, size: 3, overlap: 16}"));
  EXPECT_THAT(error_of([&] { EstimatorSection(context, wide, {}).make(); }),
              AllOf(StartsWith("robot.yaml:1: mu: "), HasSubstr("change it or estimator.horizon")));
  EstimatorSection(context, wide, settings("name: ekf")).make();  // a filter has no blocks
}

}  // namespace estimator_makers_test
}  // namespace rhec
