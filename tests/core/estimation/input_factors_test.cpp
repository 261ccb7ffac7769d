#include "rhec/core/estimation/input_factors.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/linear_case.hpp"

namespace rhec {
namespace input_factors_test {

using namespace testing;

/// Names of the parameters that are held where one input is not measured.
std::vector<std::string> held(const Model& model, int missing) {
  InputFactors factors(model);
  std::vector<double> inputs(static_cast<std::size_t>(model.input_count()), 1.0);
  inputs[static_cast<std::size_t>(missing)] = nan;
  factors.begin(inputs.data());
  std::vector<std::string> names;
  for (int j = 0; j < model.parameter_count(); ++j)
    if (factors.is_held(j)) names.push_back(model.description().parameters[static_cast<std::size_t>(j)].name);
  return names;
}

TEST(InputFactors, AreWhatNothingTellsFromAnInput) {
  using Names = std::vector<std::string>;
  const auto bicycle = host().make_model("bicycle_slip");
  EXPECT_EQ(held(*bicycle, 0), Names{"kappa"});  // u1
  EXPECT_EQ(held(*bicycle, 1), Names{});         // what the steering angle does to the heading is known by itself
  const auto robot = host().make_model("skid_steer");
  const auto& slip = robot->description().parameters;
  EXPECT_EQ(held(*robot, 0), Names{slip[0].name});
  EXPECT_EQ(held(*robot, 1), Names{slip[1].name});
  EXPECT_EQ(held(*host().make_model("unicycle_traction"), 0), Names{"mu"});
  EXPECT_EQ(held(*host().make_model("tractor_trailer"), 0), Names{"mu"});
  EXPECT_EQ(held(*host().make_model("bicycle_sideslip"), 0), Names{});
  EXPECT_TRUE(InputFactors(*bicycle).is_factor(0, 0));
  EXPECT_FALSE(InputFactors(*bicycle).is_factor(1, 0));
  EXPECT_FALSE(InputFactors(*bicycle).is_factor(0, 1));
  const auto hovercraft = linear_model<Hovercraft>();
  EXPECT_EQ(held(*hovercraft, 0), Names{});
  EXPECT_EQ(held(*hovercraft, 1), Names{});
}

TEST(InputFactors, AreHeldAsLongAsTheInputIsMissing) {
  InputFactors factors(*host().make_model("bicycle_slip"));
  const double known[] = {1.0, 0.0}, unknown[] = {nan, 0.0};
  factors.begin(unknown);
  EXPECT_TRUE(factors.is_held(0));
  factors.begin(known);
  EXPECT_FALSE(factors.is_held(0));
}

}  // namespace input_factors_test
}  // namespace rhec
