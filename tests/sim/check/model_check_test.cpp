// Models with one fault each: every check finds its own fault, and nothing else.
#include <gmock/gmock.h>

#include <set>
#include <string>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/sim/files/json.hpp"
#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace model_check_test {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

/// Nothing to steer, learn or place: a tank that runs empty.
template <class Scalar>
struct Tank {
  static constexpr int state_count = 1, input_count = 0, parameter_count = 0, output_count = 1;
  void dynamics(const Scalar* x, const Scalar*, const Scalar*, Scalar* dxdt) const { dxdt[0] = x[0] * -0.5; }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

/// What turns it settles far within an interval: explicit steps as long as that explode.
template <class Scalar>
struct Stiff {
  static constexpr int state_count = 2, input_count = 1, parameter_count = 0, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    using std::sin;
    dxdt[0] = sin(x[0] + x[1]) * x[1];
    dxdt[1] = (u[0] - x[1]) / 0.005;
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

ModelDescription about_stiff() {
  ModelDescription about;
  about.name = "stiff";
  about.source = "this test";
  about.states = {{.name = "angle", .unit = "1", .meaning = "turned"},
                  {.name = "rate", .unit = "1/s", .meaning = "speed"}};
  about.inputs = {{.name = "set_point", .unit = "1/s", .meaning = "wanted speed", .lower = -2.0, .upper = 2.0}};
  about.outputs = {{.name = "angle", .unit = "1", .meaning = "measured"}};
  return about;
}

TEST(ModelCheck, LooksAtDerivativesOfStiffModelsInStepsThatDoNotGrow) {
  FormulaModel<Stiff> model({}, about_stiff());
  const Finding derivatives =
      finding_of(check_model(model, ModelCheckOptions{.samples = 16, .substeps = 1}), "derivatives");
  EXPECT_EQ(derivatives.verdict, Verdict::pass) << derivatives.found;
}

TEST(ModelCheck, SaysAtHowManySamplesItLookedAtSecondDerivatives) {
  FormulaModel<Stiff> model({}, about_stiff());
  const auto numbers = [&model](int substeps) {
    return finding_of(check_model(model, ModelCheckOptions{.samples = 300, .substeps = substeps}), "numbers").found;
  };
  EXPECT_THAT(numbers(16), testing::Not(HasSubstr("second derivatives")));
  EXPECT_THAT(numbers(40), HasSubstr("second derivatives, which take 40 substeps, at 128 of them"));
  EXPECT_THAT(numbers(400), HasSubstr("at 64 of them"));
}

/// A vehicle whose speed is a state, and which steers.
template <class Scalar>
struct Coasting {
  static constexpr int state_count = 5, input_count = 2, parameter_count = 0, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    using std::cos, std::sin;
    dxdt[0] = x[3] * cos(x[2]);
    dxdt[1] = x[3] * sin(x[2]);
    dxdt[2] = x[4];
    dxdt[3] = u[0] - x[3] - x[4] * x[4] * 0.5;  // turning costs speed
    dxdt[4] = u[1] - x[4];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1];
  }
};

TEST(ModelCheck, TurnsWithASpeedThatIsFarFromTheMiddleOfItsBounds) {
  ModelDescription about;
  about.name = "coasting";
  about.source = "this test";
  about.states = {{.name = "x", .unit = "m", .meaning = "x"},
                  {.name = "y", .unit = "m", .meaning = "y"},
                  {.name = "psi", .unit = "rad", .meaning = "heading"},
                  {.name = "v", .unit = "m/s", .meaning = "speed", .lower = 0.0, .upper = 30.0},
                  {.name = "r", .unit = "rad/s", .meaning = "rate of turn", .lower = -3.0, .upper = 3.0}};
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "wanted speed", .lower = 0.0, .upper = 30.0},
                  {.name = "w", .unit = "rad/s", .meaning = "wanted rate", .lower = -1.0, .upper = 1.0}};
  about.outputs = {{.name = "x", .unit = "m", .meaning = "x"}, {.name = "y", .unit = "m", .meaning = "y"}};
  about.states[2].is_angle = true;
  about.states[3].scale = about.inputs[0].scale = 5.0;
  about.states[4].scale = about.inputs[1].scale = 0.5;
  about.roles.position_x = 0;
  about.roles.position_y = 1;
  about.roles.heading = 2;
  about.roles.speed = 0;
  about.roles.speed_state = 3;
  FormulaModel<Coasting> model({}, about);
  const Finding scaling = finding_of(check_model(model, ModelCheckOptions{.samples = 16}), "scaling");
  EXPECT_EQ(scaling.verdict, Verdict::pass) << scaling.where << ": " << scaling.found;
}

TEST(ModelCheck, FindsNothingWrongWithAGoodModel) {
  const ModelCheck found = check();
  EXPECT_THAT(faults(found), ElementsAre());
  EXPECT_EQ(found.verdict(), Verdict::pass);
  EXPECT_EQ(found.count(Verdict::skip), 0);
  std::set<std::string> checks;
  for (const Finding& finding : found.findings) checks.insert(finding.check);
  EXPECT_THAT(checks, ElementsAre("derivatives", "description", "integration", "numbers", "observability", "scaling",
                                  "straight_motion", "symmetry", "time"));
  EXPECT_EQ(found.drives.size(), 4u);
  EXPECT_EQ(found.times.size(), unicycle()->instruction_sets().size());
}

TEST(ModelCheck, SaysTheSameForTheSameSeed) {
  const auto without_times = [](const ModelCheck& check) {
    Json json = Json::parse(check_json(check));
    json.erase("time_ns");
    Json findings = Json::array();
    for (const Json& finding : json["findings"])
      if (finding.at("check") != "time") findings.push_back(finding);
    json["findings"] = findings;
    return json;
  };
  EXPECT_EQ(without_times(check()), without_times(check()));
  EXPECT_NE(without_times(check()), without_times(check({}, {.seed = 2})));
}

TEST(ModelCheck, FindsAWrongEntryOfAJacobian) {
  Spoilt model;
  model.spoil_step = [](const Model::Intervals& q, int nz) {
    if (!q.jacobians) return;
    for (int i = 0; i < q.count; ++i) q.jacobians[i * 4 * nz + 4 * 4 + 1] *= 1.001;  // column of v, row of y
  };
  const ModelCheck found = check_model(model);
  EXPECT_THAT(faults(found), Contains("fail derivatives: d next y / d v"));
  for (const std::string& fault : faults(found)) EXPECT_THAT(fault, HasSubstr("derivatives: d"));
  const auto& numbers = finding_of(found, "derivatives").numbers;
  ASSERT_THAT(numbers, ElementsAre(testing::Key("error"), testing::Key("given"), testing::Key("expected")));
  EXPECT_NEAR(numbers[1].second / numbers[2].second, 1.001, 1e-6);
}

TEST(ModelCheck, FindsAWrongEntryOfAHessian) {
  Spoilt model;
  model.spoil_step = [](const Model::Intervals& q, int nz) {
    if (!q.hessians) return;
    for (int i = 0; i < q.count; ++i) q.hessians[i * nz * nz + 4 * nz + 2] += 0.01 * q.multipliers[i * 4];
  };
  const ModelCheck found = check_model(model);
  EXPECT_THAT(faults(found), ElementsAre("fail derivatives: d2 next x / d psi d v"));
}

TEST(ModelCheck, FindsMultipliersThatAreNotUsed) {
  Spoilt model;
  model.spoil_step = [](const Model::Intervals& q, int nz) {
    if (!q.hessians) return;
    // Right for one multiplier of 1, wrong for a sum.
    for (int i = 0; i < q.count; ++i)
      if (q.multipliers[i * 4] != 0.0 && q.multipliers[i * 4 + 1] != 0.0)
        for (int k = 0; k < nz * nz; ++k) q.hessians[i * nz * nz + k] *= 1.1;
  };
  const ModelCheck found = check_model(model);
  ASSERT_EQ(faults(found).size(), 1u);
  EXPECT_THAT(faults(found)[0], HasSubstr("fail derivatives: sum of multipliers"));
}

TEST(ModelCheck, FindsAWrongDerivativeOfAnOutput) {
  Spoilt model;
  model.spoil_node = [](const Model::Nodes& q) {
    if (!q.jacobians) return;
    for (int i = 0; i < q.count; ++i) q.jacobians[i * 8 + 2 * 2 + 1] += 0.01;
  };
  EXPECT_THAT(faults(check_model(model)), ElementsAre("fail derivatives: d y_gps / d psi"));
}

TEST(ModelCheck, FindsAnIntegrationThatIsNotThatOfItsRates) {
  Spoilt model;
  model.spoil_step = [](const Model::Intervals& q, int) {
    if (!q.next_states) return;
    for (int i = 0; i < q.count; ++i) q.next_states[i * 4 + 1] += 1e-6;
  };
  EXPECT_THAT(faults(check_model(model)), ElementsAre("fail derivatives: next y"));
}

TEST(ModelCheck, FindsResultsThatAreNotWritten) {
  Spoilt model;
  model.spoil_step = [](const Model::Intervals& q, int nz) {
    if (!q.jacobians) return;
    for (int i = 0; i < q.count; ++i) q.jacobians[i * 4 * nz] = std::nan("");
  };
  EXPECT_THAT(faults(check_model(model)), Contains("fail numbers: anywhere"));
}

TEST(ModelCheck, DoesNotTryAModelThatHasNoScale) {
  const ModelCheck found = check([](ModelDescription& about) { about.states[0].scale = -1.0; });
  EXPECT_EQ(found.count(Verdict::skip), 8);
  EXPECT_TRUE(found.drives.empty());
  EXPECT_NO_THROW(check_json(found));
}

TEST(ModelCheck, TakesModelsThatLackThings) {
  ModelDescription tank;
  tank.name = "tank";
  tank.source = "this test";
  tank.states = {{.name = "level", .unit = "m", .meaning = "level", .lower = 0.1, .upper = 2.0}};
  tank.outputs = {{.name = "measured", .unit = "m", .meaning = "level"}};
  FormulaModel<Tank> model({}, tank);
  const ModelCheck found = check_model(model);
  EXPECT_THAT(faults(found), ElementsAre("warn description: roles"));
  EXPECT_EQ(finding_of(found, "symmetry").verdict, Verdict::skip);
  EXPECT_EQ(finding_of(found, "straight_motion").verdict, Verdict::skip);

  Spoilt first_only;
  first_only.second = false;
  EXPECT_THAT(faults(check_model(first_only)), ElementsAre());
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.roles = {}; })), ElementsAre("warn description: roles"));
}

TEST(ModelCheck, RefusesOptionsThatDoNotFit) {
  EXPECT_THROW(check({}, {.output_sigmas = {1.0}}), Error);
  EXPECT_THROW(check({}, {.input_sigmas = {1.0, 0.0}}), Error);
  EXPECT_THROW(check({}, {.speed = -1.0}), Error);
  EXPECT_THROW(check({}, {.interval = 0.0}), Error);
  EXPECT_THROW(check({}, {.blockings = {nullptr}}), Error);
  const std::unique_ptr<Model> model = unicycle();
  ModelDescription other = unicycle_description();
  other.states[0].name = "z";
  EXPECT_THROW(check_model(*model, other), Error);
}

}  // namespace model_check_test
}  // namespace rhec::sim
