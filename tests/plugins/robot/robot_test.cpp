// A robot out of a configuration: its sections together, its estimators and its hooks.
#include "rhec/plugins/robot/robot.hpp"

#include <gmock/gmock.h>

#include <string>
#include <utility>

#include "plugins/robot/robots.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace robot_test {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

Robot robot(const std::string& text) { return {host(), RobotOptions::table().parse(settings(text), "robot")}; }

const Path& path() {
  static const Path straight({{0.0, 0.0, 2.0}, {50.0, 0.0, 2.0}});
  return straight;
}

TEST(Robot, IsMadeOfDefaultsAlone) {
  const Robot made = robot("");
  EXPECT_EQ(made.step(), RobotOptions{}.step);
  EXPECT_EQ(made.model_choice().name, "bicycle_slip");
  EXPECT_EQ(made.solver_choice("rhe").name, "gn_rti");
  EXPECT_EQ(made.solver_choice("rhc").name, "gn_rti");
  EXPECT_EQ(made.blocking_choice(0).name, "full_horizon");
  EXPECT_EQ(made.output_sigmas().size(), 3U);
  EXPECT_EQ(made.input_sigmas().size(), 2U);
  EXPECT_NE(made.make_estimator(), nullptr);
  EXPECT_NE(made.make_controller(path()), nullptr);
}

TEST(Robot, HandsItsSectionsOn) {
  const Robot made = robot(R"(
step: 0.5
noise: {outputs: {x_gps: 2}}
bounds: {kappa: [0.25, 0.75]}
blocking: {mu: unblocked}
estimator: {horizon: 6, solver: {name: gn_rti, iterations: 2}}
controller: {horizon: 9}
smoother: {deadline: 3})");
  EXPECT_EQ(made.output_sigmas()[0], 2.0);
  EXPECT_EQ(made.bounded_description().parameters[0].upper, 0.75);
  EXPECT_FALSE(made.make_blockings()[1]->is_one_block());
  EXPECT_EQ(made.smoother_options().deadline, 3.0);
  EXPECT_EQ(made.solver_choice("rhe").options.find("iterations")->as_integer(), 2);
  const PluginChoice plain = made.solver_choice("rhc");
  EXPECT_EQ(plain.options.find("iterations")->as_integer(), 5) << "of a controller that names no solver";

  const auto estimator = made.make_estimator();
  const auto& window = dynamic_cast<const WindowedEstimation&>(estimator->method()).problem().setup();
  EXPECT_EQ(window.max_intervals, 6);
  EXPECT_EQ(window.output_weights[0], 0.25);
  EXPECT_EQ(window.parameter_lower[0], 0.25);
  EXPECT_EQ(made.make_controller(path())->problem().setup().max_intervals, 9);
}

/// A vehicle whose motor follows with a lag of 1 ms.
Robot with_fast_motor(const std::string& integrators) {
  return robot(R"(
model:
  equations:
    name: motor
    states: {x: {role: position_x}, y: {role: position_y}, psi: {role: heading, angle: true}, v: {unit: m/s}}
    inputs: {wanted: {unit: m/s, role: speed}, turn: {unit: rad/s}}
    outputs: {x: {}, y: {}}
    equations: |
      x' = v * cos(psi)
      y' = v * sin(psi)
      psi' = turn
      v' = (wanted - v) / 0.001
)" + integrators);
}

TEST(Robot, NotesExplicitStepsThatCostMuch) {
  EXPECT_THAT(with_fast_motor("").notes(),
              ElementsAre(testing::AllOf(StartsWith("estimator, controller: an interval of 0.2 s takes 7"),
                                         HasSubstr("'motor' has a time constant of 0.001 s, in the state 'v'"),
                                         HasSubstr("integrator: implicit"))));
  EXPECT_THAT(with_fast_motor("estimator: {integrator: implicit}").notes(),
              ElementsAre(StartsWith("controller: an interval")));
  EXPECT_THAT(with_fast_motor("controller: {integrator: auto}").notes(), ElementsAre(StartsWith("estimator: ")));
  EXPECT_THAT(with_fast_motor("estimator: {integrator: implicit}\ncontroller: {integrator: implicit}").notes(),
              testing::IsEmpty())
      << "the remedy works";
  EXPECT_THAT(robot("").notes(), testing::IsEmpty());
}

TEST(Robot, NotesTermsThatDoNothing) {
  const std::string corridor = "{name: corridor, left: 2, right: 2}";
  const auto notes = [](const std::string& terms) { return robot("controller: {terms: [" + terms + "]}").notes(); };
  EXPECT_THAT(notes(corridor), testing::IsEmpty());
  for (const char* const name : {"keep_out", "effort", "obstacles"})
    EXPECT_THAT(notes(corridor + ", {name: " + name + "}"),
                ElementsAre(testing::AllOf(HasSubstr("controller.terms"), HasSubstr("the term '" + std::string(name)),
                                           HasSubstr("does nothing"))));
}

TEST(Robot, NotesCostsOfLimitsThatAreHard) {
  const auto notes = [](const std::string& more) {
    return robot("controller: {terms: [{name: corridor, left: 2, right: 2, " + more + "}]}").notes();
  };
  EXPECT_THAT(notes("hard: true, soft: {linear: 50}"),
              ElementsAre(testing::AllOf(HasSubstr("soft"), HasSubstr("limits that are hard have no cost"))));
  for (const char* const more : {"hard: true", "soft: {linear: 50}", "hard: false, soft: {linear: 50}"})
    EXPECT_THAT(notes(more), testing::IsEmpty()) << more;
}

TEST(Robot, SaysThatASensorIsNotAmongTheUsualOnes) {
  for (const char* const model : {"", "model: bicycle_slip\n", "model: {name: bicycle_slip, wheelbase: 2}\n"})
    for (const char* const noise :
         {"outputs: {yaw_rate: 0.01}", "biases: {yaw_rate: {sigma: 0.01}}", "scales: {yaw_rate: {sigma: 0.01}}"})
      EXPECT_THAT(
          error_of([&] { robot(std::string(model) + "noise: {" + noise + "}"); }),
          testing::AllOf(HasSubstr("yaw_rate: the vehicle could have this sensor"), HasSubstr("model.outputs")));
  EXPECT_THAT(error_of([] { robot("noise: {biases: {yaw: {sigma: 0.01}}}"); }), HasSubstr("has no option 'yaw'"));
}

TEST(Robot, NamesThePlaceOfAMistakeInAnySection) {
  for (const char* wrong :
       {"modl: bicycle_slip", "model: bicycle_slp", "noise: {output: {}}", "bounds: {kapa: [0, 1]}",
        "blocking: {kapa: unblocked}", "estimator: {horzion: 3}", "controller: {horzion: 3}", "smoother: {deadine: 3}"})
    EXPECT_THAT(error_of([&] { robot(std::string("step: 0.2\n") + wrong); }), StartsWith("robot.yaml:2: ")) << wrong;
  EXPECT_THAT(error_of([] { robot("estimator: {name: truth}"); }),
              StartsWith("robot.yaml:1: estimator.name: found 'truth', expected one of rhe, ekf, bank"));
}

TEST(Robot, DocumentsEachOfItsSections) {
  std::vector<std::string> names, expected;
  for (const OptionSection& section : robot_sections()) names.push_back(section.name);
  for (const OptionRow& row : RobotOptions::table().schema()) {
    const bool is_of_others = row.name == "signals" || row.name == "ros";  // of logs, and of live nodes
    if (row.type == SubtreeValue{}.type() && !is_of_others) expected.push_back(row.name);
  }
  EXPECT_EQ(names, expected);
}

/// Counts what goes through it.
struct Counts {
  int rhe = 0, rhc = 0, methods = 0;
};
class Counter final : public RobotHooks {
 public:
  explicit Counter(std::shared_ptr<Counts> counts) : counts_(std::move(counts)) {}
  std::shared_ptr<Solver> wrap_solver(std::string_view kind, std::shared_ptr<Solver> solver) const override {
    ++(kind == "rhe" ? counts_->rhe : counts_->rhc);
    return solver;
  }
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override {
    ++counts_->methods;
    return method;
  }

 private:
  std::shared_ptr<Counts> counts_;
};

TEST(RobotWithHooks, SendsSolversAndMethodsThroughThem) {
  const auto counts = std::make_shared<Counts>();
  Robot made = robot("");
  made.make_estimator();
  made.add_hooks(std::make_shared<Counter>(counts));
  EXPECT_THAT(std::vector({counts->rhe, counts->rhc, counts->methods}), ElementsAre(0, 0, 0));
  made.make_estimator();
  made.make_controller(path());
  EXPECT_THAT(std::vector({counts->rhe, counts->rhc, counts->methods}), ElementsAre(1, 1, 1));
  made.add_hooks(std::make_shared<Counter>(counts));
  made.make_estimator();
  EXPECT_THAT(std::vector({counts->rhe, counts->rhc, counts->methods}), ElementsAre(3, 1, 3));
}

TEST(RobotWithHooks, HandsThemToItsCopies) {
  const auto counts = std::make_shared<Counts>();
  Robot made = robot("{estimator: {name: ekf}}");
  const Robot before = made;
  made.add_hooks(std::make_shared<Counter>(counts));
  const Robot after = made;
  before.make_estimator();
  EXPECT_EQ(counts->methods, 0);
  after.make_estimator();
  EXPECT_EQ(counts->methods, 1);
  EXPECT_EQ(counts->rhe, 0) << "a filter has no solver";
}

TEST(RobotWithEstimators, UsesThoseThatItIsGiven) {
  const auto given = std::make_shared<int>(0);
  const auto makers_that_say = [&given](int number) {
    EstimatorMakers makers;
    makers.add({"own", "a filter of another name", [given, number](const EstimatorParts& parts) {
                  *given = number;
                  return EstimatorMakers().named("ekf").make(parts);
                }});
    return makers;
  };
  const RobotOptions options = RobotOptions::table().parse(settings("estimator: {name: own}"), "robot");
  Robot made(host(), options, makers_that_say(1));
  made.make_estimator();
  EXPECT_EQ(*given, 1);
  const Robot copy = made;
  made.use_estimators(makers_that_say(2));
  made.make_estimator();
  EXPECT_EQ(*given, 2);
  copy.make_estimator();
  EXPECT_EQ(*given, 1);
}

}  // namespace robot_test
}  // namespace rhec
