#include "rhec/core/horizon/horizon_structure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "rhec/core/base/error.hpp"
#include "support/cart.hpp"

namespace rhec {
namespace horizon_structure_test {

using testing::cart;
using ::testing::ElementsAre;

/// Two states, one input that is lifted, two parameters of which the second has one block.
class Structure : public ::testing::Test {
 protected:
  Structure()
      : structure(*cart(),
                  {.max_intervals = 4, .blocked_inputs = {0}, .parameters_are_decided = true, .one_block = {1}}) {
    structure.set_intervals(4);
    for (int i = 0; i < 4; ++i) structure.set_block_start(i, input, i % 2 == 0);  // blocks of two
    structure.set_block_start(1, drag, true);
    structure.finish();
  }
  static constexpr int drag = 0, gain = 1, input = 2;
  HorizonStructure structure;
};

TEST_F(Structure, SetsAsideWhatTheWidestStageTakes) {
  EXPECT_EQ(structure.capacity(), (Capacity{4, 2 + 3, 1 + 1}));
  EXPECT_EQ(structure.lifted_count(), 3);
  EXPECT_EQ(structure.free_input_count(), 0);
  EXPECT_FALSE(structure.is_direct());
  EXPECT_EQ(structure.lifted_of_input(0), input);
  const HorizonStructure given(*cart(), {.max_intervals = 4, .blocked_inputs = {}, .one_block = {}});
  EXPECT_EQ(given.capacity(), (Capacity{4, 4, 1})) << "parameters that are given take no control";
  EXPECT_TRUE(given.is_direct());
  EXPECT_THROW(HorizonStructure(*cart(), {.max_intervals = 0, .blocked_inputs = {}, .one_block = {}}), Error);
}

TEST_F(Structure, CountsAControlForEveryBlockThatStarts) {
  EXPECT_THAT(std::vector<int>(structure.control_counts(), structure.control_counts() + 4), ElementsAre(1, 1, 1, 0));
  EXPECT_EQ(structure.control_of_lifted(0, input), 0);
  EXPECT_EQ(structure.control_of_lifted(1, drag), 0);
  EXPECT_EQ(structure.control_of_lifted(1, input), -1);
  EXPECT_EQ(structure.control_of_input(0, 0), 0);
  EXPECT_EQ(structure.control_of_input(3, 0), -1);
  EXPECT_EQ(structure.column_of_input(2, 0), structure.capacity().states);
  EXPECT_EQ(structure.column_of_input(3, 0), 2 + input) << "the state carries it";
  EXPECT_TRUE(structure.any_start());
  structure.set_block_start(0, drag, true);
  structure.finish();
  EXPECT_EQ(structure.control_count(0), 2);
  EXPECT_EQ(structure.control_of_lifted(0, drag), 0) << "in the order of lifted variables";
  EXPECT_EQ(structure.control_of_lifted(0, input), 1);
}

TEST_F(Structure, KnowsWhetherItHasChanged) {
  EXPECT_FALSE(structure.finish());
  structure.set_block_start(1, drag, true);
  structure.set_intervals(4);
  EXPECT_FALSE(structure.finish()) << "it is what it was";
  structure.set_block_start(1, drag, false);
  EXPECT_TRUE(structure.finish());
  structure.set_intervals(3);
  EXPECT_TRUE(structure.finish());
}

TEST_F(Structure, WritesDecisionsAndReadsThemBack) {
  Iterate point(structure.capacity());
  const std::vector<double> inputs = {1.0, 2.0, 3.0, 4.0},
                            parameters = {0.1, 0.9, 0.2, 0.8, 0.3, 0.7, 0.4, 0.6};  // of drag and gain
  structure.set_decisions(point, inputs.data(), parameters.data());
  const auto input_on = [&](int interval) {
    double u = -1.0;
    structure.inputs_on(point, interval, &u);
    return u;
  };
  const auto parameters_on = [&](int interval) {
    std::vector<double> p(2);
    structure.parameters_on(point, interval, p.data());
    return p;
  };
  // The row of a block's first interval counts.
  EXPECT_EQ(input_on(0), 1.0);
  EXPECT_EQ(input_on(1), 1.0);
  EXPECT_EQ(input_on(2), 3.0);
  EXPECT_EQ(input_on(3), 3.0);
  EXPECT_THAT(parameters_on(0), ElementsAre(0.1, 0.9));
  EXPECT_THAT(parameters_on(1), ElementsAre(0.2, 0.9));
  EXPECT_THAT(parameters_on(3), ElementsAre(0.2, 0.9));
  EXPECT_EQ(point.state(4)[2 + drag], 0.2) << "and the last node carries them";
}

TEST_F(Structure, CarriesValuesFromNodeToNode) {
  Iterate point(structure.capacity());
  point.state(1)[2 + drag] = 0.5;
  point.state(1)[2 + gain] = 0.75;
  point.control(1)[0] = 0.25;  // drag's new block
  structure.carry_lifted(1, point);
  EXPECT_EQ(point.state(2)[2 + drag], 0.25);
  EXPECT_EQ(point.state(2)[2 + gain], 0.75);
}

TEST_F(Structure, KnowsItsRamps) {
  EXPECT_FALSE(structure.any_ramp());
  structure.set_ramp(drag, true);
  EXPECT_TRUE(structure.any_ramp() && structure.is_ramp(drag) && !structure.is_ramp(gain));
  structure.set_ramp(drag, false);
  EXPECT_FALSE(structure.any_ramp());
}

}  // namespace horizon_structure_test
}  // namespace rhec
