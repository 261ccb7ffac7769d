// Models with one fault each: every check finds its own fault, and nothing else.
#include "rhec/sim/check/model_check.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/sim/check/derivative_check.hpp"

namespace rhec::sim {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

/// A unicycle with slip. What it has beside that is the fault of a derived formula.
struct Unicycle {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 2, output_count = 2;
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::sin, std::cos;
    dxdt[0] = p[0] * u[0] * cos(x[2]);
    dxdt[1] = p[0] * u[0] * sin(x[2]);
    dxdt[2] = p[1] * x[3];
    dxdt[3] = 5.0 * (u[1] - x[3]);  // the yaw rate follows its command
  }
  template <class Scalar>
  constexpr void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1];
  }
};

struct RootOfAState : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::sqrt;
    Unicycle::dynamics(x, u, p, dxdt);
    dxdt[3] = 0.1 * (u[1] - x[3]) - 0.01 * sqrt(x[3] + 0.5);  // not a number below -0.5
  }
};

struct PoleOfAState : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::tan;
    Unicycle::dynamics(x, u, p, dxdt);
    dxdt[2] = p[1] * tan(x[3]);
  }
};

struct LogOfAnOutput : Unicycle {
  template <class Scalar>
  constexpr void outputs(const Scalar* x, Scalar* y) const {
    using std::log;
    y[0] = x[0];
    y[1] = x[1] + 0.01 * log(0.9 - x[3]);
  }
};

struct UnseenParameter : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    Unicycle::dynamics(x, u, p, dxdt);
    dxdt[2] = x[3] + 0.0 * p[1];
  }
};

/// Two parameters of which only the product matters.
struct ProductOfParameters : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    Unicycle::dynamics(x, u, p, dxdt);
    const Scalar both[2] = {p[0] * p[1], p[0]};
    Unicycle::dynamics(x, u, both, dxdt);
    dxdt[2] = x[3];
  }
};

struct KnowsItsHeading : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos;
    Unicycle::dynamics(x, u, p, dxdt);
    dxdt[3] = dxdt[3] + 0.1 * cos(x[2]);  // a slope that pulls to one side of the world
  }
};

struct KnowsItsPlace : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::tanh;
    Unicycle::dynamics(x, u, p, dxdt);
    dxdt[3] = dxdt[3] + 0.1 * tanh(x[1]);
  }
};

struct PullsAside : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    Unicycle::dynamics(x, u, p, dxdt);
    dxdt[2] = dxdt[2] + 0.1;
  }
};

/// Nothing to steer, learn or place: a tank that runs empty.
struct Tank {
  static constexpr int state_count = 1, input_count = 0, parameter_count = 0, output_count = 1;
  template <class Scalar>
  void dynamics(const Scalar* x, const Scalar*, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = x[0] * -0.5;
  }
  template <class Scalar>
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
  }
};

ModelDescription unicycle_description() {
  ModelDescription about;
  about.name = "unicycle";
  about.source = "this test";
  about.states = {{.name = "x", .unit = "m", .meaning = "x", .scale = 2.0},
                  {.name = "y", .unit = "m", .meaning = "y", .scale = 2.0},
                  {.name = "psi", .unit = "rad", .meaning = "heading", .is_angle = true},
                  {.name = "rate", .unit = "rad/s", .meaning = "yaw rate", .lower = -0.8, .upper = 0.8, .scale = 0.5}};
  about.inputs = {{.name = "v", .unit = "m/s", .meaning = "speed", .scale = 2.0},
                  {.name = "w", .unit = "rad/s", .meaning = "yaw rate", .lower = -0.8, .upper = 0.8, .scale = 0.5}};
  about.parameters = {
      {.name = "kappa", .unit = "1", .meaning = "speed factor", .lower = 0.2, .upper = 1.0, .scale = 0.5},
      {.name = "mu", .unit = "1", .meaning = "yaw factor", .lower = 0.2, .upper = 1.0, .scale = 0.5}};
  about.outputs = {{.name = "x_gps", .unit = "m", .meaning = "x", .scale = 2.0},
                   {.name = "y_gps", .unit = "m", .meaning = "y", .scale = 2.0}};
  about.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  return about;
}

/// A model that is described by somebody else: a formula's own would be refused where roles point nowhere.
template <class Formula>
class Described : public FormulaModel<Formula> {
 public:
  explicit Described(ModelDescription about)
      : FormulaModel<Formula>({}, unicycle_description()), about_(std::move(about)) {}
  const ModelDescription& description() const noexcept override { return about_; }

 private:
  ModelDescription about_;
};

template <class Formula = Unicycle>
ModelCheck check(const std::function<void(ModelDescription&)>& spoil = {}, const ModelCheckOptions& options = {}) {
  ModelDescription about = unicycle_description();
  if (spoil) spoil(about);
  Described<Formula> model(std::move(about));
  return check_model(model, options);
}

/// "check: where" of the findings that are neither passed nor skipped.
std::vector<std::string> faults(const ModelCheck& check) {
  std::vector<std::string> all;
  for (const Finding& finding : check.findings)
    if (finding.verdict == Verdict::fail || finding.verdict == Verdict::warn)
      all.push_back(std::string(word_of(finding.verdict)) + " " + finding.check + ": " + finding.where);
  return all;
}

const Finding& finding_of(const ModelCheck& check, const std::string& name) {
  for (const Finding& finding : check.findings)
    if (finding.check == name) return finding;
  throw Error("no finding of " + name);
}

const DriveInformation& drive_of(const ModelCheck& check, const std::string& name) {
  for (const DriveInformation& drive : check.drives)
    if (drive.name == name) return drive;
  throw Error("no drive " + name);
}

/// Passes on all that it is asked to another model, then spoils some of it.
class Spoilt : public FormulaModel<Unicycle> {
 public:
  Spoilt() : FormulaModel({}, unicycle_description()) {}
  std::function<void(const Intervals&, int)> spoil_step = [](const Intervals&, int) {};
  std::function<void(const Nodes&)> spoil_node = [](const Nodes&) {};
  bool second = true;

  void integrate(const Intervals& request) const noexcept override {
    FormulaModel::integrate(request);
    spoil_step(request, 6 + (request.parameters_end ? 4 : 2));
  }
  void observe(const Nodes& request) const noexcept override {
    FormulaModel::observe(request);
    spoil_node(request);
  }
  bool has_second_derivatives() const noexcept override { return second; }
};

TEST(ModelCheck, FindsNothingWrongWithAGoodModel) {
  const ModelCheck found = check();
  EXPECT_THAT(faults(found), ElementsAre());
  EXPECT_EQ(found.verdict(), Verdict::pass);
  EXPECT_EQ(found.count(Verdict::skip), 0);
  std::set<std::string> checks;
  for (const Finding& finding : found.findings) checks.insert(finding.check);
  EXPECT_THAT(checks, ElementsAre("derivatives", "description", "numbers", "observability", "scaling",
                                  "straight_motion", "symmetry", "time"));
  EXPECT_EQ(found.drives.size(), 4u);
  EXPECT_EQ(found.times.size(), FormulaModel<Unicycle>({}, unicycle_description()).instruction_sets().size());
}

TEST(ModelCheck, SaysTheSameForTheSameSeed) {
  const auto without_times = [](const ModelCheck& check) {
    nlohmann::json json = nlohmann::json::parse(check_json(check));
    json.erase("time_ns");
    json["findings"].erase(json["findings"].size() - 1);  // of times
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

TEST(ModelCheck, FindsWhereNumbersAreNotFinite) {
  const ModelCheck found = check<RootOfAState>();
  ASSERT_THAT(faults(found), testing::SizeIs(1));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_EQ(numbers.verdict, Verdict::fail);
  EXPECT_THAT(numbers.where, testing::MatchesRegex("rate in \\[-0\\.8, -0\\.(4[6-9]|50?).*\\]")) << numbers.where;
  EXPECT_THAT(numbers.where, testing::Not(HasSubstr(";"))) << "no other variable has to do with it";
  EXPECT_THAT(numbers.found, HasSubstr("next states"));
}

TEST(ModelCheck, FindsWhereOutputsAreNotFiniteWithoutBounds) {
  const ModelCheck found = check<LogOfAnOutput>([](ModelDescription& about) {
    about.states[3].lower = -HUGE_VAL;
    about.states[3].upper = HUGE_VAL;
  });
  ASSERT_THAT(faults(found), testing::SizeIs(1));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_THAT(numbers.where, testing::StartsWith("rate in [0.9")) << numbers.where;
  EXPECT_THAT(numbers.found, HasSubstr("outputs"));
  // Within bounds that keep away from it, there is nothing to find.
  EXPECT_THAT(faults(check<LogOfAnOutput>()), ElementsAre());
}

TEST(ModelCheck, FindsAPoleThatIsFiniteEverywhere) {
  const ModelCheck found = check<PoleOfAState>([](ModelDescription& about) {
    about.states[3].unit = "rad";
    about.states[3].lower = -HUGE_VAL;
    about.states[3].upper = HUGE_VAL;
  });
  ASSERT_THAT(faults(found), testing::SizeIs(1)) << testing::PrintToString(faults(found));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_EQ(numbers.verdict, Verdict::warn);
  EXPECT_THAT(numbers.where, HasSubstr("rate in [")) << numbers.where;
  EXPECT_THAT(faults(check<PoleOfAState>()), ElementsAre());
}

TEST(ModelCheck, FindsWhatADescriptionGetsWrong) {
  using About = ModelDescription;
  const std::vector<std::pair<std::function<void(About&)>, std::string>> cases = {
      {[](About& a) { a.name.clear(); }, "fail description: model"},
      {[](About& a) { a.source.clear(); }, "warn description: model"},
      {[](About& a) { a.inputs[1].name = "kappa"; }, "fail description: parameter kappa"},
      {[](About& a) { a.outputs[1].name = "x_gps"; }, "fail description: output x_gps"},
      {[](About& a) { a.states[3].name = "yaw rate"; }, "fail description: state yaw rate"},
      {[](About& a) { a.parameters[1].name = ""; }, "fail description: parameter 1"},
      {[](About& a) { a.parameters[1].unit = ""; }, "fail description: parameter mu"},
      {[](About& a) { a.outputs[0].meaning = ""; }, "warn description: output x_gps"},
      {[](About& a) { a.parameters[1].nominal = 2.0; }, "fail description: parameter mu"},
      {[](About& a) { a.states[0].unit = "cm"; }, "fail description: roles.position_x"},
      {[](About& a) { a.states[2].is_angle = false; }, "fail description: roles.heading"},
      {[](About& a) { a.states[0].scale = 0.0; }, "fail description: state x"},
      {[](About& a) { a.states[0].scale = HUGE_VAL; }, "fail description: state x"},
      {[](About& a) { a.inputs[1].lower = 2.0; }, "fail description: input w"},
      {[](About& a) { a.roles.speed = 2; }, "fail description: roles.speed"},
      {[](About& a) { a.roles.heading = -2; }, "fail description: roles.heading"},
      {[](About& a) { a.roles.other_headings = {-1}; }, "fail description: roles.other_headings"},
  };
  for (const auto& [spoil, expected] : cases) EXPECT_THAT(faults(check(spoil)), ElementsAre(expected));
  // The name of an output may be that of what it measures.
  EXPECT_THAT(faults(check([](About& a) { a.outputs[0].name = "x"; })), ElementsAre());
}

TEST(ModelCheck, DoesNotTryAModelThatHasNoScale) {
  const ModelCheck found = check([](ModelDescription& about) { about.states[0].scale = -1.0; });
  EXPECT_EQ(found.count(Verdict::skip), 7);
  EXPECT_TRUE(found.drives.empty());
  EXPECT_NO_THROW(check_json(found));
}

TEST(ModelCheck, FindsARoleThatPointsAtAnotherVariable) {
  const ModelCheck found = check([](ModelDescription& about) { about.roles.speed = 1; });
  EXPECT_THAT(faults(found), Contains("fail description: roles.speed"));
  EXPECT_THAT(faults(found), Contains("fail straight_motion: at nominal parameters"));
}

TEST(ModelCheck, FindsDynamicsThatKnowWhereTheyAre) {
  const ModelCheck heading = check<KnowsItsHeading>();
  EXPECT_THAT(faults(heading), ElementsAre("fail symmetry: d rate / dt"));
  EXPECT_THAT(finding_of(heading, "symmetry").found, HasSubstr("turned"));
  const ModelCheck place = check<KnowsItsPlace>();
  EXPECT_THAT(faults(place), ElementsAre("fail symmetry: d rate / dt"));
  EXPECT_THAT(finding_of(place, "symmetry").found, HasSubstr("shifted"));
}

TEST(ModelCheck, FindsThatStraightIsNotStraight) {
  EXPECT_THAT(faults(check<PullsAside>()), ElementsAre("fail straight_motion: d psi / dt"));
  // The speed factor is not said: at other parameters the vehicle is slower than it should be.
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.roles.speed_factor = -1; })),
              ElementsAre("warn straight_motion: at other parameters"));
}

TEST(ModelCheck, FindsAParameterThatNothingSees) {
  const ModelCheck found = check<UnseenParameter>();
  EXPECT_THAT(faults(found), ElementsAre("fail observability: parameter mu"));
  EXPECT_THAT(finding_of(found, "observability").found, HasSubstr("can never learn it"));
  EXPECT_THAT(drive_of(found, "slalom").undetermined, ElementsAre("mu"));
}

TEST(ModelCheck, NamesACombinationThatIsNotDetermined) {
  const ModelCheck found = check<ProductOfParameters>();
  EXPECT_THAT(faults(found),
              testing::IsSupersetOf({"fail observability: parameter kappa", "fail observability: parameter mu"}));
  // At kappa = mu and the same scales, what is gained by one is lost by the other.
  EXPECT_THAT(drive_of(found, "slalom").undetermined, ElementsAre("0.71 kappa - 0.71 mu"));
}

TEST(ModelCheck, KnowsThatAParameterIsSeenOnlyWhileTurning) {
  const ModelCheck found = check();
  const DriveInformation &straight = drive_of(found, "straight"), &turn = drive_of(found, "turn"),
                         &standing = drive_of(found, "standing");
  EXPECT_TRUE(std::isfinite(straight.parameter_sigma[0]));
  EXPECT_TRUE(std::isinf(straight.parameter_sigma[1]));
  EXPECT_TRUE(std::isfinite(turn.parameter_sigma[1]));
  EXPECT_TRUE(std::isinf(standing.parameter_sigma[0]));
  EXPECT_THAT(standing.undetermined, Contains("psi"));
  EXPECT_THAT(finding_of(found, "observability").found, HasSubstr("(turn, slalom)"));
}

/// Standing on a straight: positions measured N + 1 times, a speed factor that is the slope of a line.
TEST(ModelCheck, AttainsTheStandardDeviationOfAStraightLine) {
  ModelCheckOptions options;
  options.horizon = 12;
  options.interval = 0.25;
  options.speed = 1.5;
  options.output_sigmas = {0.02, 0.02};
  options.input_sigmas = {1e-12, 1e-12};  // as good as known
  const ModelCheck found = check({}, options);
  // Along the line: position = start + kappa u t, with u = 1.5 / kappa at kappa = 0.6; by regression the slope in time
  // has the variance sigma^2 / sum (t - mean)^2.
  double sum = 0.0;
  for (int k = 0; k <= 12; ++k) sum += 0.25 * 0.25 * (k - 6.0) * (k - 6.0);
  const double expected = 0.02 / std::sqrt(sum) / (1.5 / 0.6);
  EXPECT_NEAR(drive_of(found, "straight").parameter_sigma[0], expected, 1e-4 * expected);
  // A constant offset of the speed's noise cannot be told from the factor: less is known with noise.
  options.input_sigmas = {0.5, 1e-12};
  EXPECT_GT(drive_of(check({}, options), "straight").parameter_sigma[0], 1.2 * expected);
}

TEST(ModelCheck, BearsAnyNoiseAndHorizon) {
  for (const double sigma : {1e-300, 1e-12, 1e12, 1e300}) {
    for (const int horizon : {1, 2, 1000}) {
      ModelCheckOptions options;
      options.samples = 16;
      options.horizon = horizon;
      options.output_sigmas = {sigma, 0.01};
      options.input_sigmas = {0.01, sigma};
      const ModelCheck found = check({}, options);
      for (const DriveInformation& drive : found.drives) {
        EXPECT_EQ(drive.unusable, "");
        EXPECT_LE(drive.rank, drive.unknowns);
        EXPECT_TRUE(std::isfinite(drive.condition));
      }
    }
  }
}

class BlocksOfFive : public Blocking {
 public:
  explicit BlocksOfFive(Transition transition) : transition_(transition) {}
  std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept override {
    for (int i = 0; i < window.intervals; ++i) begins[i] = i % 5 == 0;
    return window.first;
  }
  Transition transition() const noexcept override { return transition_; }

 private:
  Transition transition_;
};

TEST(ModelCheck, KnowsLessOfAParameterInBlocks) {
  const ModelCheck one = check();
  for (const Transition transition : {Transition::step, Transition::ramp}) {
    ModelCheckOptions options;
    options.blockings = {std::make_shared<BlocksOfFive>(transition), std::make_shared<BlocksOfFive>(transition)};
    const ModelCheck blocks = check({}, options);
    EXPECT_EQ(drive_of(blocks, "turn").unknowns, 4 + 3 + 3);
    EXPECT_GT(drive_of(blocks, "turn").parameter_sigma[0], drive_of(one, "turn").parameter_sigma[0]);
    EXPECT_THAT(drive_of(blocks, "straight").undetermined, Contains("mu[2]"));
  }
}

TEST(ModelCheck, FindsAScaleThatIsFarOff) {
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.states[1].scale *= 1e4; })),
              Contains("warn scaling: state y"));
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.outputs[1].scale *= 1e4; })),
              Contains("warn scaling: output y_gps"));
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.outputs[1].scale *= 1e-4; })),
              ElementsAre("warn scaling: output y_gps"));
  EXPECT_THAT(faults(check([](ModelDescription& about) { about.parameters[1].scale *= 1e-4; })),
              Contains("warn description: parameter mu"));
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
  FormulaModel<Unicycle> model({}, unicycle_description());
  ModelDescription other = unicycle_description();
  other.states[0].name = "z";
  EXPECT_THROW(check_model(model, other), Error);
}

}  // namespace
}  // namespace rhec::sim
