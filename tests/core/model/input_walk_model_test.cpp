#include "rhec/core/model/input_walk_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "rhec/plugins/host/host.hpp"
#include "support/error_of.hpp"
#include "support/random_interval.hpp"

namespace rhec {
namespace input_walk_model_test {

using ::testing::HasSubstr;

std::shared_ptr<const Model> vehicle(const char* name) {
  static const Host host;
  return host.make_model(name);
}

/// Its second input walks, and its first parameter is held, both on this interval alone.
class WithData final : public Model {
 public:
  explicit WithData(const InputWalkModel& model) : model_(model), data(model.data_count(), 0.0) {
    for (std::size_t k = 0; k < model.inputs().size(); ++k)
      InputWalkModel::set_measured(static_cast<int>(k), data.data());
  }
  const ModelDescription& description() const noexcept override { return model_.description(); }
  void integrate(const Intervals& request) const noexcept override {
    Intervals with = request;
    std::vector<double> rows;
    for (int i = 0; i < request.count; ++i) rows.insert(rows.end(), data.begin(), data.end());
    with.data = rows.data();
    model_.integrate(with);
  }
  void observe(const Nodes& request) const noexcept override { model_.observe(request); }
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    model_.rates(x, u, p, dxdt);
  }
  bool has_second_derivatives() const noexcept override { return true; }

 private:
  const InputWalkModel& model_;

 public:
  std::vector<double> data;
};

std::vector<double> next_of(const Model& model, const RandomInterval& at) {
  std::vector<double> next(model.state_count());
  Model::Intervals request = at.request(true);
  request.next_states = next.data();
  model.integrate(request);
  return next;
}

TEST(InputWalkModel, IsTheVehicleWhereInputsAreMeasured) {
  const auto plain = vehicle("bicycle_slip");
  const InputWalkModel model(plain, {0, 1});
  EXPECT_EQ(model.state_count(), 6);
  EXPECT_EQ(model.description().states[5].name, "u2_kept");
  EXPECT_EQ(model.description().states[5].unit, plain->description().inputs[1].unit);
  const RandomInterval at(model, 3);
  const auto next = next_of(WithData(model), at), expected = next_of(*plain, at);
  for (int r = 0; r < 4; ++r) EXPECT_EQ(next[r], expected[r]);
  EXPECT_EQ(next[4], at.u[0]);
  EXPECT_EQ(next[5], at.u[1]);
}

TEST(InputWalkModel, KeepsAnInputThatIsMissing) {
  const auto plain = vehicle("bicycle_slip");
  const InputWalkModel model(plain, {1});
  WithData walking(model);
  InputWalkModel::set_walking(0, 0.25, walking.data.data());
  model.hold(0, 0.6, walking.data.data());
  RandomInterval at(model, 3), acting = at;
  const auto next = next_of(walking, at);
  acting.u[1] = at.x[4] + 0.25 * at.u[1];
  acting.p[0] = acting.p_end[0] = 0.6;
  const auto expected = next_of(*plain, acting);
  for (int r = 0; r < 4; ++r) EXPECT_EQ(next[r], expected[r]);
  EXPECT_EQ(next[4], acting.u[1]);
}

TEST(InputWalkModel, DerivativesAreThoseOfItsValues) {
  for (const char* name : {"bicycle_slip", "tractor_trailer"}) {
    for (const std::vector<int>& inputs : {std::vector{0}, {1}, {0, 1}}) {
      for (const bool ramp : {false, true}) {
        const InputWalkModel model(vehicle(name), inputs);
        WithData at(model);
        expect_derivatives_of_differences(at, RandomInterval(at, 5), ramp, name);
        InputWalkModel::set_walking(static_cast<int>(inputs.size()) - 1, 0.25, at.data.data());
        model.hold(0, 0.6, at.data.data());
        expect_derivatives_of_differences(at, RandomInterval(at, 6), ramp, name);
        expect_the_same_side_by_side(at, 19, ramp);
      }
    }
  }
}

TEST(InputWalkModel, MovesStraightWithItsInputsKept) {
  const InputWalkModel model(vehicle("bicycle_slip"), {0});
  std::vector<double> state(5, 9.0), inputs(2);
  const double p[] = {0.8, 0.9};
  model.straight_motion(2.0, p, state.data(), inputs.data());
  EXPECT_EQ(inputs[0], 2.5);
  EXPECT_EQ(state[4], 2.5);
  std::vector<double> rates(5, 9.0);
  model.rates(std::vector<double>(5, 0.1).data(), inputs.data(), p, rates.data());
  EXPECT_EQ(rates[4], 0.0);
}

TEST(InputWalkModel, SaysWhatIsWrong) {
  const auto plain = vehicle("bicycle_slip");
  const auto with = [&](std::vector<int> inputs) { return error_of([&] { InputWalkModel(plain, inputs); }); };
  EXPECT_EQ(with({1}), "");
  EXPECT_THAT(with({}), HasSubstr("expected indices of 0 .. 1 that increase"));
  EXPECT_THAT(with({1, 0}), HasSubstr("walks of the inputs [1, 0]"));
  EXPECT_THAT(with({2}), HasSubstr("bicycle_slip"));
  EXPECT_THAT(with({-1}), HasSubstr("bicycle_slip"));
  const auto twice = std::make_shared<InputWalkModel>(plain, std::vector{0});
  EXPECT_THAT(error_of([&] { InputWalkModel(twice, {1}); }), HasSubstr("depends on data of the interval"));
}

}  // namespace input_walk_model_test
}  // namespace rhec
