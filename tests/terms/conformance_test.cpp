// What every term promises, over every plugin that is found, on every model that is found.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "support/allocations.hpp"
#include "support/random_problem.hpp"
#include "view.hpp"

namespace rhec {
namespace conformance_test {

using namespace testing;

/// Options with which a term says something, where it has no such defaults.
std::string options_of(const std::string& name, const Model& model) {
  if (name == "obstacles") return "{most: 2, obstacles: [{x: 3, y: 1, length: 3, width: 1, velocity_x: 0.5}]}";
  if (name == "keep_out") return "{lines: [{x: 3, y: -1, direction: 0.4}]}";
  if (name == "effort") return "{delta: 0.5, weights: {" + model.description().inputs.front().name + ": 2}}";
  return "{}";
}

struct Case {
  std::string term, model;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const std::string& term : host().names(PluginKind::term))
    for (const std::string& model : host().names(PluginKind::model)) all.push_back({term, model});
  return all;
}

class EveryTerm : public ::testing::TestWithParam<Case> {
 protected:
  const std::shared_ptr<const Model> model_ = host().make_model(GetParam().model);
  const std::shared_ptr<Term> term_ = make(GetParam().term, options_of(GetParam().term, *model_));
  /// Null if the vehicle does not suit; then it says so.
  std::unique_ptr<TermFunctions> functions_ = [&]() -> std::unique_ptr<TermFunctions> {
    try {
      return std::make_unique<TermFunctions>(*model_, std::vector<NamedTerm>{{GetParam().term, term_}});
    } catch (const Error& refusal) {
      EXPECT_THAT(refusal.what(),
                  ::testing::StartsWith("term '" + GetParam().term + "': the model '" + model_->description().name));
      return nullptr;
    }
  }();
  const std::vector<Obstacle> seen_ = {{.x = 2.0, .y = 3.0, .semi_axis_along = 1.0, .semi_axis_across = 0.5}};
  const TermPlace place_{.time = 3.0,
                         .x = 1.0,
                         .y = 2.0,
                         .heading = 0.3,
                         .speed = 2.0,
                         .arc_length = 7.0,
                         .obstacles = seen_,
                         .seen = 2.5};
};

TEST_P(EveryTerm, WritesAllOfItsDataAndBoundsWithoutAllocation) {
  if (!functions_) GTEST_SKIP() << "the vehicle does not suit";
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto limits = static_cast<std::size_t>(functions_->limit_count());
  const auto numbers = static_cast<std::size_t>(functions_->data_count());
  ASSERT_GT(functions_->rows(TermFunctions::Stage::middle).count(), 0) << "it says nothing";
  std::vector<double> data(numbers + 1, nan), lower(limits + 1, nan), upper(limits + 1, nan);
  const long before = allocation_count();
  term_->write_data(place_, data.data(), lower.data(), upper.data());
  EXPECT_EQ(allocation_count(), before);
  for (std::size_t k = 0; k < numbers; ++k) EXPECT_TRUE(std::isfinite(data[k])) << k;
  for (std::size_t k = 0; k < limits; ++k) EXPECT_LE(lower[k], upper[k]) << k;
  EXPECT_TRUE(std::isnan(data[numbers]) && std::isnan(lower[limits]) && std::isnan(upper[limits])) << "behind the end";
  std::vector<double> again(numbers);
  term_->write_data(place_, again.data(), lower.data(), upper.data());
  EXPECT_TRUE(std::equal(again.begin(), again.end(), data.begin()));
}

TEST_P(EveryTerm, HasTheDerivativesOfItsValues) {
  if (!functions_) GTEST_SKIP() << "the vehicle does not suit";
  RandomProblem random(model_, 7);
  const TermFunctions::Rows& rows = functions_->rows(TermFunctions::Stage::middle);
  const auto count = static_cast<std::size_t>(rows.count());
  const int decided = model_->state_count() + model_->parameter_count() + model_->input_count();
  std::vector<double> arguments, scratch(functions_->scratch_size());
  for (const auto* variables :
       {&model_->description().states, &model_->description().parameters, &model_->description().inputs})
    for (const Variable& each : *variables) arguments.push_back(random.typical(each));
  arguments.push_back(0.2);
  std::vector<double> bounds(static_cast<std::size_t>(functions_->limit_count()));
  const std::size_t first_data = arguments.size();
  arguments.resize(static_cast<std::size_t>(functions_->argument_row()), 0.0);
  term_->write_data(place_, arguments.data() + first_data, bounds.data(), bounds.data());
  struct Values {
    std::vector<double> values, slopes;
  };
  const auto at = [&](const std::vector<double>& where) {
    Values made{std::vector<double>(count), std::vector<double>(rows.slopes.size())};
    functions_->evaluate(TermFunctions::Stage::middle, 1, where.data(), made.values.data(), made.slopes.data(),
                         scratch.data());
    return made;
  };
  std::vector<double> weights, bends(rows.bends.size());
  for (std::size_t r = 0; r < count; ++r) weights.push_back(0.5 + 0.25 * static_cast<double>(r));
  functions_->curve(TermFunctions::Stage::middle, 1, arguments.data(), weights.data(), bends.data(), scratch.data());
  const Values here = at(arguments);
  constexpr double h = 1e-6;
  for (int c = 0; c < decided; ++c) {
    std::vector<double> up = arguments, down = arguments;
    up[static_cast<std::size_t>(c)] += h;
    down[static_cast<std::size_t>(c)] -= h;
    const Values above = at(up), below = at(down);
    std::vector<double> slopes(count, 0.0);
    std::vector<double> bend(static_cast<std::size_t>(decided), 0.0), expected_bend(bend);
    for (std::size_t e = 0; e < rows.slopes.size(); ++e) {
      const auto& [r, column] = rows.slopes[e];
      if (column == c) slopes[static_cast<std::size_t>(r)] = here.slopes[e];
      expected_bend[static_cast<std::size_t>(column)] +=
          weights[static_cast<std::size_t>(r)] * (above.slopes[e] - below.slopes[e]) / (2.0 * h);
    }
    for (std::size_t r = 0; r < count; ++r) {
      const double slope = (above.values[r] - below.values[r]) / (2.0 * h);
      EXPECT_NEAR(slopes[r], slope, 1e-6 * (1.0 + std::abs(slope))) << "row " << r << " by " << c;
    }
    for (std::size_t e = 0; e < rows.bends.size(); ++e) {
      const auto& [r, column] = rows.bends[e];
      if (column == c) bend[static_cast<std::size_t>(r)] = bends[e];
      if (r == c) bend[static_cast<std::size_t>(column)] = bends[e];
    }
    for (int k = 0; k < decided; ++k) {
      const double expected = expected_bend[static_cast<std::size_t>(k)];
      EXPECT_NEAR(bend[static_cast<std::size_t>(k)], expected, 1e-5 * (1.0 + std::abs(expected))) << k << ", " << c;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Found, EveryTerm, ::testing::ValuesIn(cases()),
                         [](const auto& about) { return about.param.term + "_on_" + about.param.model; });

TEST(Terms, OfTheHouseAreFound) {
  EXPECT_THAT(host().names(PluginKind::term),
              ::testing::IsSupersetOf({"corridor", "effort", "keep_out", "lateral_acceleration", "obstacles"}));
}

}  // namespace conformance_test
}  // namespace rhec
