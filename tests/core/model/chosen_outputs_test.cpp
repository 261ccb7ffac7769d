// A vehicle with some of its outputs: the chosen ones equal those of the full model, and everything else is unchanged.
#include "rhec/core/model/chosen_outputs.hpp"
#include "rhec/core/model/formula_model.hpp"

#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace chosen_outputs_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Host& host() {
  static const Host found;
  return found;
}

std::shared_ptr<Model> model_with(const std::string& options) {
  return host().make_model("tractor_trailer", parse_yaml(options, "robot.yaml"));
}

std::string error_of_options(const std::string& options) {
  return error_of([&] { model_with(options); });
}

/// All outputs at random nodes.
struct Observation {
  std::vector<double> outputs, jacobians, hessians;
};
Observation observe(const Model& model, const std::vector<double>& states, const std::vector<double>& multipliers) {
  const std::size_t nx = model.state_count(), ny = model.output_count(), count = states.size() / nx;
  Observation seen{std::vector<double>(count * ny), std::vector<double>(count * ny * nx),
                   std::vector<double>(count * nx * nx)};
  model.observe({.count = static_cast<int>(count),
                 .states = states.data(),
                 .outputs = seen.outputs.data(),
                 .jacobians = seen.jacobians.data(),
                 .multipliers = multipliers.data(),
                 .hessians = seen.hessians.data()});
  return seen;
}

TEST(ChosenOutputs, AreThoseOfAllOutputsInTheOrderAskedFor) {
  const auto all = model_with("outputs: all");
  const std::vector<int> picked = {7, 0, 5};  // tractor_heading, x_trailer_gps, articulation
  const auto some = model_with("outputs: [tractor_heading, x_trailer_gps, articulation]");
  ASSERT_THAT(names_of(some->description().outputs), ElementsAre("tractor_heading", "x_trailer_gps", "articulation"));
  const std::size_t nx = all->state_count(), ny = all->output_count(), chosen = picked.size();
  ASSERT_EQ(ny, 11U);
  testing::RandomProblem random(all, 1);
  // More nodes than are evaluated in one batch.
  for (const std::size_t count : {0U, 1U, 3U, 72U, 73U, 500U}) {
    std::vector<double> states(count * nx), multipliers(count * chosen), spread(count * ny, 0.0);
    for (double& value : states) value = random.uniform(-2.0, 2.0);
    for (std::size_t k = 0; k < multipliers.size(); ++k) {
      multipliers[k] = random.normal();
      spread[k / chosen * ny + static_cast<std::size_t>(picked[k % chosen])] = multipliers[k];
    }
    const Observation whole = observe(*all, states, spread), part = observe(*some, states, multipliers);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < chosen; ++j) {
        const auto from = static_cast<std::size_t>(picked[j]);
        EXPECT_EQ(part.outputs[i * chosen + j], whole.outputs[i * ny + from]);
        for (std::size_t c = 0; c < nx; ++c)
          EXPECT_EQ(part.jacobians[(i * nx + c) * chosen + j], whole.jacobians[(i * nx + c) * ny + from]);
      }
    }
    EXPECT_EQ(part.hessians, whole.hessians);
  }
}

TEST(ChosenOutputs, MayBeThereTwiceUnderAnotherName) {
  const auto once = model_with("outputs: [x_trailer_gps, articulation]");
  const auto twice = model_with("outputs: [x_trailer_gps, articulation, {x_rough: x_trailer_gps}]");
  ASSERT_THAT(names_of(twice->description().outputs), ElementsAre("x_trailer_gps", "articulation", "x_rough"));
  EXPECT_EQ(twice->description().outputs[2].unit, "m");
  EXPECT_EQ(twice->description().outputs[0].device, 0);
  EXPECT_EQ(twice->description().outputs[2].device, 1);
  const std::size_t nx = once->state_count();
  for (const std::string& set : twice->instruction_sets()) {
    for (const auto& model : {once, twice}) ASSERT_TRUE(model->use_instruction_set(set));
    const std::size_t count = 11;
    testing::RandomProblem random(once, 3);
    std::vector<double> states(count * nx), weights, sums;
    for (double& value : states) value = random.uniform(-2.0, 2.0);
    for (std::size_t i = 0; i < count; ++i) {
      for (int j = 0; j < 3; ++j) weights.push_back(random.uniform(-1.0, 1.0));
      sums.insert(sums.end(), {weights[3 * i] + weights[3 * i + 2], weights[3 * i + 1]});
    }
    const Observation one = observe(*once, states, sums), two = observe(*twice, states, weights);
    for (std::size_t i = 0; i < count; ++i)
      for (const auto& [from, to] : {std::pair{0, 0}, {1, 1}, {0, 2}}) {
        EXPECT_EQ(two.outputs[i * 3 + to], one.outputs[i * 2 + from]);
        for (std::size_t c = 0; c < nx; ++c)
          EXPECT_EQ(two.jacobians[(i * nx + c) * 3 + to], one.jacobians[(i * nx + c) * 2 + from]);
      }
    // The weights of both count.
    for (std::size_t k = 0; k < one.hessians.size(); ++k) EXPECT_NEAR(two.hessians[k], one.hessians[k], 1e-12);
    // So they do in rows as solvers ask for them.
    const std::size_t row = padded(static_cast<int>(nx));
    std::vector<double> rows(count * nx * row), state_rows(count * row), scratch(twice->rows_scratch(count));
    for (std::size_t i = 0; i < count; ++i) std::copy_n(states.data() + i * nx, nx, state_rows.data() + i * row);
    twice->observe_rows({.count = static_cast<int>(count),
                         .states = state_rows.data(),
                         .state_step = static_cast<std::ptrdiff_t>(row),
                         .multipliers = weights.data(),
                         .multiplier_step = 3,
                         .hessians = rows.data(),
                         .hessian_step = static_cast<std::ptrdiff_t>(nx * row),
                         .hessian_row = static_cast<std::ptrdiff_t>(row),
                         .scratch = scratch.data()});
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t r = 0; r < nx; ++r)
        for (std::size_t c = 0; c < nx; ++c)
          EXPECT_NEAR(rows[(i * nx + r) * row + c], one.hessians[(i * nx + c) * nx + r], 1e-12);
  }
}

TEST(ChosenOutputs, AskForNoMoreThanIsAskedFor) {
  const auto some = model_with("outputs: [articulation]");
  const std::vector<double> state = {1.0, 2.0, 0.3, 0.5, 0.1};
  double output = 0.0;
  some->observe({.count = 1, .states = state.data(), .outputs = &output});
  EXPECT_DOUBLE_EQ(output, 0.2);
  std::vector<double> jacobian(5, 9.0);
  some->observe({.count = 1, .states = state.data(), .jacobians = jacobian.data()});
  EXPECT_THAT(jacobian, ElementsAre(0.0, 0.0, -1.0, 1.0, 0.0));
}

/// More outputs of more states than a stack should hold.
template <class Scalar>
struct Bus {
  static constexpr int state_count = 90, input_count = 0, parameter_count = 0, output_count = 60;
  void dynamics(const Scalar* x, const Scalar*, const Scalar*, Scalar* dxdt) const {
    for (int i = 0; i < state_count; ++i) dxdt[i] = -x[i];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    for (int j = 0; j < output_count; ++j) y[j] = x[j] * x[j + 30];
  }
};

TEST(ChosenOutputs, OfManyStates) {
  ModelDescription about;
  about.name = "bus";
  about.states.resize(90);
  about.outputs.resize(60);
  const auto some = with_outputs(std::make_shared<FormulaModel<Bus>>(Bus<double>{}, about), {3, 59});
  std::vector<double> states(2 * 90), outputs(2 * 2), jacobians(2 * 2 * 90);
  for (std::size_t k = 0; k < states.size(); ++k) states[k] = 0.01 * static_cast<double>(k);
  some->observe({.count = 2, .states = states.data(), .outputs = outputs.data(), .jacobians = jacobians.data()});
  for (std::size_t i = 0; i < 2; ++i) {
    const double* x = states.data() + 90 * i;
    EXPECT_EQ(outputs[2 * i], x[3] * x[33]);
    EXPECT_EQ(outputs[2 * i + 1], x[59] * x[89]);
    EXPECT_EQ(jacobians[(i * 90 + 33) * 2], x[3]);
    EXPECT_EQ(jacobians[(i * 90 + 33) * 2 + 1], 0.0);
    EXPECT_EQ(jacobians[(i * 90 + 59) * 2 + 1], x[89]);
  }
}

TEST(ChosenOutputs, AreTheUsualOnesWhereNoneAreNamed) {
  EXPECT_THAT(names_of(host().make_model("bicycle_slip")->description().outputs),
              ElementsAre("x_gps", "y_gps", "delta"));
  EXPECT_THAT(
      names_of(host().make_model("bicycle_slip", parse_yaml("outputs: all", "robot.yaml"))->description().outputs),
      ElementsAre("x_gps", "y_gps", "delta", "heading", "yaw_rate", "ground_speed"));
}

TEST(ChosenOutputs, LeaveTheVehicleAsItIs) {
  const auto all = model_with("{outputs: all, hitch: -0.7}"), some = model_with("{outputs: [delta], hitch: -0.7}");
  const std::vector<double> x = {1.0, 2.0, 0.3, 0.5, 0.1}, u = {2.0, 0.1}, p = {0.8, 0.7, 0.9};
  std::vector<double> first(5), second(5);
  all->rates(x.data(), u.data(), p.data(), first.data());
  some->rates(x.data(), u.data(), p.data(), second.data());
  EXPECT_EQ(first, second);
  const double dt = 0.2;
  Model::Intervals request{
      .count = 1, .states = x.data(), .inputs = u.data(), .parameters = p.data(), .durations = &dt};
  request.next_states = first.data();
  all->integrate(request);
  request.next_states = second.data();
  some->integrate(request);
  EXPECT_EQ(first, second);
  std::vector<double> straight(2), same(2);
  all->straight_motion(3.0, p.data(), first.data(), straight.data());
  some->straight_motion(3.0, p.data(), second.data(), same.data());
  EXPECT_EQ(straight, same);
  EXPECT_EQ(all->instruction_sets(), some->instruction_sets());
  EXPECT_EQ(all->has_second_derivatives(), some->has_second_derivatives());
  EXPECT_EQ(all->operations().hessians, some->operations().hessians);
  EXPECT_GT(all->operations().hessians, all->operations().jacobians);
}

TEST(ChosenOutputs, MistakesAreNamedWithTheirPlace) {
  EXPECT_THAT(error_of_options("outputs:\n  - delta\n  - x_gps"),
              HasSubstr("robot.yaml:3: outputs[1]: found 'x_gps', expected an output of the model 'tractor_trailer': "
                        "x_trailer_gps, "));
  EXPECT_THAT(error_of_options("outputs: [delta, delta]"), HasSubstr("outputs[1]: 'delta' is named twice"));
  EXPECT_THAT(error_of_options("outputs: [delta, {articulation: delta}]"), HasSubstr("is another output of the model"));
  EXPECT_THAT(error_of_options("outputs: [delta, {1a: delta}]"), HasSubstr("expected letters"));
  EXPECT_THAT(error_of_options("outputs: [delta, {a: delt}]"), HasSubstr("outputs[1].a"));
  EXPECT_THAT(error_of_options("outputs: []"), HasSubstr("expected 'all' or a list of outputs"));
  EXPECT_THAT(error_of_options("outputs: delta"), HasSubstr("expected 'all' or a list of outputs"));
  EXPECT_THROW(with_outputs(host().make_model("bicycle_slip"), {3}), Error);
  EXPECT_THROW(with_outputs(host().make_model("bicycle_slip"), {-1}), Error);
  EXPECT_THROW(with_outputs(host().make_model("bicycle_slip"), {0, 0}), Error);
}

}  // namespace chosen_outputs_test
}  // namespace rhec
