#include "rhec/core/model/model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/cart.hpp"
#include "support/other_model.hpp"

namespace rhec {
namespace model_test {

using testing::cart;
using ::testing::ElementsAre;
using Numbers = std::vector<double>;

TEST(Variables, AreListedInTheirOrder) {
  const ModelDescription about = cart()->description();
  EXPECT_THAT(names_of(about.states), ElementsAre("x", "v"));
  EXPECT_THAT(nominal_values(about.parameters), ElementsAre(0.0, 1.0));
  EXPECT_TRUE(names_of({}).empty());
}

TEST(Roles, PlaceAndTurnAllBodiesAndNothingElse) {
  const Roles roles{.position_x = 1, .position_y = 0, .heading = 3, .other_headings = {4}};
  Numbers state(6, 9.0);
  roles.place(1.0, 2.0, 0.5, state.data());
  EXPECT_THAT(state, ElementsAre(2.0, 1.0, 9.0, 0.5, 0.5, 9.0));
  state[4] = 0.7;
  roles.turn(0.25, state.data());
  EXPECT_THAT(state, ElementsAre(2.0, 1.0, 9.0, 0.75, 0.95, 9.0));
  const Numbers before = state;
  const Roles none;
  none.place(5.0, 5.0, 5.0, state.data());
  none.turn(5.0, state.data());
  EXPECT_EQ(state, before);
}

/// A model without its own row functions: it uses the base class's.
class WithoutRows final : public OtherModel {
 public:
  using OtherModel::OtherModel;
  void integrate_rows(const IntervalRows& request) const noexcept override { Model::integrate_rows(request); }
  void observe_rows(const NodeRows& request) const noexcept override { Model::observe_rows(request); }
  std::size_t rows_scratch(int count) const noexcept override { return Model::rows_scratch(count); }
};

constexpr int count = 3, nx = 2, nu = 1, np = 2, ny = 2, row = 8;

/// Rows [x; p; u; p at the end], and the same dense.
struct Stages {
  Stages() {
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < nx; ++j) x.push_back(0.5 + 0.3 * std::sin(i + 2 * j));
      u.push_back(0.4 * std::cos(1.0 + i));
      for (int j = 0; j < np; ++j) {
        p.push_back(0.3 + 0.1 * i + 0.2 * j);
        p_end.push_back(0.25 + 0.12 * i + 0.2 * j);
      }
      double* z = rows.data() + i * row;
      std::copy_n(x.data() + i * nx, nx, z);
      std::copy_n(p.data() + i * np, np, z + nx);
      std::copy_n(u.data() + i * nu, nu, z + nx + np);
      std::copy_n(p_end.data() + i * np, np, z + nx + np + nu);
    }
  }
  Numbers x, u, p, p_end, durations = Numbers{0.1, 0.2, 0.3}, multipliers = Numbers{0.3, -0.7, 0.9, 0.2, -0.4, 1.0};
  Numbers rows = Numbers(count * row, 7.0);  // a row's padding is not read
};

TEST(Model, IntegratesRowsAsItIntegrates) {
  const WithoutRows model(cart());
  const Stages stages;
  for (const bool ramp : {false, true}) {
    const int nz = nx + nu + np + (ramp ? np : 0);
    Numbers next(count * nx), jacobians(count * nx * nz), hessians(count * nz * nz);
    model.integrate({.count = count,
                     .states = stages.x.data(),
                     .inputs = stages.u.data(),
                     .parameters = stages.p.data(),
                     .parameters_end = ramp ? stages.p_end.data() : nullptr,
                     .durations = stages.durations.data(),
                     .substeps = 2,
                     .next_states = next.data(),
                     .jacobians = jacobians.data(),
                     .multipliers = stages.multipliers.data(),
                     .hessians = hessians.data()});
    Numbers next_rows(count * row, 7.0), jacobian_rows(count * nx * row, 7.0), hessian_rows(count * row * row, 7.0),
        multipliers(count * row), scratch(model.rows_scratch(count));
    for (int i = 0; i < count; ++i) std::copy_n(stages.multipliers.data() + i * nx, nx, multipliers.data() + i * row);
    model.integrate_rows({.count = count,
                          .z = stages.rows.data(),
                          .z_step = row,
                          .ramp = ramp,
                          .durations = stages.durations.data(),
                          .substeps = 2,
                          .next_states = next_rows.data(),
                          .next_step = row,
                          .jacobians = jacobian_rows.data(),
                          .jacobian_step = nx * row,
                          .jacobian_row = row,
                          .multipliers = multipliers.data(),
                          .multiplier_step = row,
                          .hessians = hessian_rows.data(),
                          .hessian_step = row * row,
                          .hessian_row = row,
                          .scratch = scratch.data()});
    // Where the entries of [x; u; p; p at the end] are in a row.
    const Numbers place = {0, 1, 4, 2, 3, 5, 6};
    for (int i = 0; i < count; ++i) {
      for (int r = 0; r < nx; ++r) {
        EXPECT_EQ(next_rows[i * row + r], next[i * nx + r]);
        for (int c = 0; c < nz; ++c)
          EXPECT_EQ(jacobian_rows[(i * nx + r) * row + static_cast<int>(place[c])], jacobians[(i * nz + c) * nx + r]);
        EXPECT_EQ(jacobian_rows[(i * nx + r) * row + 7], 0.0) << "up to the next multiple of eight there are zeros";
      }
      EXPECT_EQ(next_rows[i * row + nx], 0.0);
      for (int r = 0; r < nz; ++r)
        for (int c = 0; c < nz; ++c)
          EXPECT_EQ(hessian_rows[(i * row + static_cast<int>(place[r])) * row + static_cast<int>(place[c])],
                    hessians[(i * nz + c) * nz + r]);
    }
  }
}

TEST(Model, ObservesChosenOutputsByRows) {
  const WithoutRows model(cart());
  const Stages stages;
  Numbers outputs(count * ny), jacobians(count * ny * nx);
  model.observe({.count = count, .states = stages.x.data(), .outputs = outputs.data(), .jacobians = jacobians.data()});
  const int chosen = 1;
  const Numbers multipliers = {2.0, 0, 0, 0, 0, 0, 0, 0, 3.0, 0, 0, 0, 0, 0, 0, 0, 4.0, 0, 0, 0, 0, 0, 0, 0};
  Numbers output_rows(count * row, 7.0), jacobian_rows(count * row, 7.0), hessian_rows(count * row * row, 5.0),
      scratch(model.rows_scratch(count));
  model.observe_rows({.count = count,
                      .states = stages.rows.data(),
                      .state_step = row,
                      .chosen = &chosen,
                      .chosen_count = 1,
                      .outputs = output_rows.data(),
                      .output_step = row,
                      .jacobians = jacobian_rows.data(),
                      .jacobian_row = row,
                      .multipliers = multipliers.data(),
                      .multiplier_step = row,
                      .hessians = hessian_rows.data(),
                      .hessian_step = row * row,
                      .hessian_row = row,
                      .scratch = scratch.data()});
  for (int i = 0; i < count; ++i) {
    EXPECT_EQ(output_rows[i * row], outputs[i * ny + 1]);
    EXPECT_EQ(output_rows[i * row + 1], 0.0);
    EXPECT_EQ(jacobian_rows[i * row + 1], jacobians[(i * nx + 1) * ny + 1]);
    // d2(v^2)/dv2 = 2, by the output's multiplier, is added to what was there.
    EXPECT_EQ(hessian_rows[(i * row + 1) * row + 1], 5.0 + 2.0 * multipliers[i * row]);
    EXPECT_EQ(hessian_rows[i * row * row], 5.0);
  }
}

/// A model that says with which variables it goes straight on.
class Wheeled final : public OtherModel {
 public:
  explicit Wheeled(Roles roles) : OtherModel(cart()), about_(cart()->description()) { about_.roles = std::move(roles); }
  const ModelDescription& description() const noexcept override { return about_; }

 private:
  ModelDescription about_;
};

TEST(Model, GoesStraightOnByItsWheelSpeedWhereverThatIs) {
  const Numbers slip{0.4, 0.5};
  Numbers state(nx, 0.0), inputs(nu, 9.0);
  Wheeled({.speed = 0, .speed_factor = 1}).straight_motion(2.0, slip.data(), state.data(), inputs.data());
  EXPECT_THAT(inputs, ElementsAre(4.0));
  EXPECT_THAT(state, ElementsAre(0.0, 0.0));
  Wheeled({.speed_state = 1, .speed_factor = 0}).straight_motion(2.0, slip.data(), state.data(), inputs.data());
  EXPECT_THAT(inputs, ElementsAre(0.0));
  EXPECT_THAT(state, ElementsAre(0.0, 5.0));
  Wheeled({.speed = 0}).straight_motion(2.0, slip.data(), state.data(), inputs.data());
  EXPECT_THAT(inputs, ElementsAre(2.0)) << "a model without such a parameter does not slip";
}

}  // namespace model_test
}  // namespace rhec
