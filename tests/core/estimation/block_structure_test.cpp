#include "core/estimation/block_structure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <set>

#include "support/cart.hpp"

namespace rhec {
namespace block_structure_test {

using testing::cart_estimation;
using ::testing::ElementsAre;

/// Blocks that start at 0 and at the listed intervals, counted from the start of the run.
class Listed final : public Blocking {
 public:
  explicit Listed(std::set<std::int64_t> starts, std::optional<double> sigma = {}, Transition how = Transition::step)
      : starts_(std::move(starts)), sigma_(sigma), how_(how) {
    starts_.insert(0);
  }
  std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept override {
    for (int i = 0; i < window.intervals; ++i) begins[i] = starts_.contains(window.first + i);
    begins[0] = 1;
    return *--starts_.upper_bound(window.first);
  }
  bool is_one_block() const noexcept override { return starts_.size() == 1; }
  Transition transition() const noexcept override { return how_; }
  std::optional<double> neighbour_sigma() const noexcept override { return sigma_; }

 private:
  std::set<std::int64_t> starts_;
  std::optional<double> sigma_;
  Transition how_;
};

class BlockStructure : public ::testing::Test {
 protected:
  static constexpr int drag = 0, gain = 1;

  void set(const Window& window, std::shared_ptr<const Blocking> of_drag) {
    set_block_structure(window, {std::move(of_drag), std::make_shared<Listed>(std::set<std::int64_t>{})}, walks,
                        first_starts, begins, *problem);
  }
  std::vector<int> borders() const {
    std::vector<int> found;
    for (int i = 0; i < problem->intervals(); ++i)
      if (problem->structure().starts_block(i, drag)) found.push_back(i);
    return found;
  }

  std::unique_ptr<RheProblem> problem = cart_estimation(8);
  std::vector<ParameterWalk> walks = {{.process_noise = 0.0, .restart_sigma = 1.0, .block_sigma = 0.5},
                                      {.process_noise = 0.0, .restart_sigma = 1.0, .block_sigma = 0.7}};
  std::vector<std::int64_t> first_starts = {0, 0};
  std::vector<std::uint8_t> begins = std::vector<std::uint8_t>(8);
};

TEST_F(BlockStructure, MarksTheBordersWithinTheWindow) {
  set({.first = 10, .intervals = 6}, std::make_shared<Listed>(std::set<std::int64_t>{8, 12, 15, 16}));
  EXPECT_EQ(problem->intervals(), 6);
  EXPECT_THAT(borders(), ElementsAre(2, 5)) << "the first block has begun at the node before";
  EXPECT_THAT(first_starts, ElementsAre(8, 0));
  EXPECT_EQ(problem->control_count(2), 2) << "the problem is finished";
}

TEST_F(BlockStructure, LinksBlocksByTheStepsThatABlockLasts) {
  set({.first = 10, .intervals = 6}, std::make_shared<Listed>(std::set<std::int64_t>{8, 12, 15}, 0.1));
  EXPECT_NEAR(problem->link_variance(2, drag), 0.01 * 4.0, 1e-15) << "from 8 to 12";
  EXPECT_NEAR(problem->link_variance(5, drag), 0.01 * 3.0, 1e-15) << "from 12 to 15";
}

TEST_F(BlockStructure, HoldsBlocksThatNoWalkLinksByTheWidePrior) {
  set({.first = 10, .intervals = 6}, std::make_shared<Listed>(std::set<std::int64_t>{12, 15}));
  EXPECT_NEAR(problem->link_variance(2, drag), 0.25, 1e-15);
  EXPECT_NEAR(problem->link_variance(5, drag), 0.25, 1e-15);
  walks[drag].block_sigma = HUGE_VAL;
  set({.first = 10, .intervals = 6}, std::make_shared<Listed>(std::set<std::int64_t>{12, 15}));
  EXPECT_EQ(problem->link_variance(2, drag), HUGE_VAL) << "as in the paper";
}

TEST_F(BlockStructure, LetsARampStartAtTheWindowsEdgeButNotBeforeTheRun) {
  const auto ramp = std::make_shared<Listed>(std::set<std::int64_t>{4, 8, 12}, 0.1, Transition::ramp);
  set({.first = 4, .intervals = 6}, ramp);
  EXPECT_THAT(borders(), ElementsAre(0, 4));
  EXPECT_TRUE(problem->structure().is_ramp(drag));
  EXPECT_NEAR(problem->link_variance(0, drag), 0.01 * 4.0, 1e-15) << "from the window's block before, at 0";
  EXPECT_THAT(first_starts, ElementsAre(4, 0));
  set({.first = 8, .intervals = 6}, ramp);
  EXPECT_NEAR(problem->link_variance(0, drag), 0.01 * 4.0, 1e-15) << "from 4 to 8";
  set({.first = 0, .intervals = 6}, ramp);
  EXPECT_THAT(borders(), ElementsAre(4));
}

TEST(OneBlockParameters, AreThoseWhoseBlockingSaysSo) {
  const auto one = std::make_shared<Listed>(std::set<std::int64_t>{}),
             more = std::make_shared<Listed>(std::set<std::int64_t>{3});
  EXPECT_THAT(one_block_parameters({more, one, more, one}), ElementsAre(1, 3));
  EXPECT_TRUE(one_block_parameters({}).empty());
}

}  // namespace block_structure_test
}  // namespace rhec
