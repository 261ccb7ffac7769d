#include "rhec/plugins/equations/equations.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "models/drive.hpp"
#include "rhec/core/model/chosen_outputs.hpp"
#include "rhec/core/model/motion_outputs.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec {
namespace equations_test {

using ::testing::ElementsAre;

const std::string vehicles = RHEC_SOURCE "/examples/vehicles/";

/// A file that is there for a test.
class TextFile {
 public:
  explicit TextFile(const std::string& text) : path_(folder_.put("written.yaml", text)) {}
  const std::filesystem::path& path() const { return path_; }

 private:
  TemporaryFolder folder_;
  std::filesystem::path path_;
};

std::shared_ptr<Model> load(const std::string& text, const std::string& options = "{}") {
  const TextFile file(text);
  return load_vehicle(file.path(), parse_yaml(options, "scenario.yaml"));
}
/// Without the folder of the file.
std::string why_not(const std::string& text, const std::string& options = "{}") {
  const std::string message = error_of([&] { load(text, options); });
  const std::size_t at = message.find("written.yaml");
  return at == std::string::npos ? message : message.substr(at);
}

const std::string cart = R"(
options:
  gain: {default: 2, unit: 1/s, above: 0, meaning: of the motor}
  limit: gain * 3
states:
  x: {unit: m, bounds: [-limit, limit]}
inputs:
  u: {unit: m/s}
parameters:
  k:
outputs:
  x: {unit: m}
  far: {unit: m, usual: false}
equations: |
  x' = gain * k * u
  far = x + limit
)";

/// Pendulums in a row, each coupled to the next, the first one pushed: two states each.
std::string pendulums(int count) {
  std::string states, equations;
  for (int k = 0; k < count; ++k) {
    const std::string n = std::to_string(k);
    states += "  a" + n + ":\n  w" + n + ":\n";
    equations += "  a" + n + "' = w" + n + "\n  w" + n + "' = -sin(a" + n + ") - drag * w" + n;
    if (k > 0) equations += " - 4 * (a" + n + " - a" + std::to_string(k - 1) + ")^3";
    if (k + 1 < count) equations += " + 4 * (a" + std::to_string(k + 1) + " - a" + n + ")^3";
    equations += k == 0 ? " + push * cos(a0)\n" : "\n";
  }
  return "states:\n" + states + "inputs:\n  push:\nparameters:\n  drag:\noutputs:\n  a0:\n  bent:\nequations: |\n" +
         equations + "  bent = a0 * a1\n";
}

// Forty states and a hundred and twenty, with the interpreter alone: derivatives along a direction against differences.
TEST(LoadVehicle, TakesManyStates) {
  for (const int count : {20, 60}) {
    SCOPED_TRACE(count);
    const std::shared_ptr<Model> model = load(pendulums(count));
    const int nx = model->state_count(), nz = nx + 2;
    ASSERT_EQ(nx, 2 * count);
    EXPECT_TRUE(model->has_second_derivatives());
    const auto states = static_cast<std::size_t>(nx), all = static_cast<std::size_t>(nz);
    const double h = 1e-5, duration = 0.1;
    std::vector<double> weights(states), direction(all);
    for (std::size_t c = 0; c < all; ++c) direction[c] = std::sin(1.3 * static_cast<double>(c) + 0.2);
    for (std::size_t r = 0; r < states; ++r) weights[r] = std::cos(0.7 * static_cast<double>(r));
    struct Results {
      std::vector<double> next, jacobian, hessian;
    };
    const auto at = [&](double along) {
      std::vector<double> x(states);
      for (std::size_t r = 0; r < states; ++r) x[r] = 0.4 * std::sin(static_cast<double>(r)) + along * direction[r];
      const double u = 0.3 + along * direction[states], p = 0.2 + along * direction[states + 1];
      Results made{std::vector<double>(states), std::vector<double>(states * all), std::vector<double>(all * all)};
      model->integrate({.count = 1,
                        .states = x.data(),
                        .inputs = &u,
                        .parameters = &p,
                        .durations = &duration,
                        .next_states = made.next.data(),
                        .jacobians = made.jacobian.data(),
                        .multipliers = weights.data(),
                        .hessians = made.hessian.data()});
      return made;
    };
    const Results here = at(0.0), ahead = at(h), behind = at(-h);
    for (std::size_t r = 0; r < states; ++r) {
      double slope = 0.0;
      for (std::size_t c = 0; c < all; ++c) slope += here.jacobian[c * states + r] * direction[c];
      ASSERT_NEAR(slope, (ahead.next[r] - behind.next[r]) / (2 * h), 1e-8);
    }
    for (std::size_t d = 0; d < all; ++d) {
      double bend = 0.0, expected = 0.0;
      for (std::size_t c = 0; c < all; ++c) bend += here.hessian[d * all + c] * direction[c];
      for (std::size_t r = 0; r < states; ++r)
        expected += weights[r] * (ahead.jacobian[d * states + r] - behind.jacobian[d * states + r]) / (2 * h);
      ASSERT_NEAR(bend, expected, 1e-7);
    }
  }
}

std::string with(const std::string& part, const std::string& other) {
  std::string text = cart;
  return text.replace(text.find(part), part.size(), other);
}

// For those who look at a vehicle: names of definitions, no derivatives, and the outputs that were chosen.
TEST(Equations, KeepTheirGraph) {
  const std::shared_ptr<Model> model = load(with("x' = gain * k * u", "push = gain * k\n  x' = push * u"));
  const VehicleGraph* graph = model->graph();
  ASSERT_NE(graph, nullptr);
  EXPECT_LT(graph->graph->size(), 10);
  EXPECT_EQ(graph->graph->name_of(graph->rates[0]), "x'");
  const Graph::Node& product = (*graph->graph)[graph->rates[0]];
  EXPECT_TRUE(graph->graph->name_of(product.a) == "push" || graph->graph->name_of(product.b) == "push");
  EXPECT_EQ(graph->outputs.size(), 2u);
  const std::shared_ptr<Model> chosen = with_outputs(model, {1});
  ASSERT_NE(chosen->graph(), nullptr);
  EXPECT_EQ(chosen->graph()->outputs.size(), 1u);
  EXPECT_EQ(chosen->graph()->graph->name_of(chosen->graph()->outputs[0]), "far");
}

// The same numbers as the plugin whose equations they are, also at other lengths: two vehicles in one process.
TEST(Equations, AreTheVehicleOfTheirPlugin) {
  const ::rhec::testing::Numbers state{1.0, 2.0, 0.3, 0.2}, inputs{3.0, 0.4}, slip{0.8, 0.7};
  const auto same = [&](const Model& one, const Model& other) {
    ::rhec::testing::expect_near(::rhec::testing::rates(one, state, inputs, slip),
                                 ::rhec::testing::rates(other, state, inputs, slip), 1e-14);
    ::rhec::testing::expect_near(::rhec::testing::seen(one, state), ::rhec::testing::seen(other, state), 1e-14);
    ::rhec::testing::expect_near(::rhec::testing::drive(one, state, inputs, slip, 2.0),
                                 ::rhec::testing::drive(other, state, inputs, slip, 2.0), 1e-11);
  };
  const std::string long_one = "{wheelbase: 2.8, gps_offset: -0.3, outputs: [heading, x_gps, y_gps, delta]}";
  const auto here = ::rhec::testing::vehicle(vehicles + "bicycle.yaml"),
             longer = ::rhec::testing::vehicle(vehicles + "bicycle.yaml", long_one);
  same(*here, *::rhec::testing::vehicle("bicycle_slip"));
  same(*longer, *::rhec::testing::vehicle("bicycle_slip", long_one));
  EXPECT_GT(std::abs(::rhec::testing::rates(*here, state, inputs, slip)[2] -
                     ::rhec::testing::rates(*longer, state, inputs, slip)[2]),
            0.1);
}

TEST(Equations, HaveTheDescriptionOfTheirPlugin) {
  for (const char* name : {"bicycle", "skid_steer"}) {
    const std::string plugin = name == std::string("bicycle") ? "bicycle_slip" : name;
    const auto one = ::rhec::testing::vehicle(vehicles + name + ".yaml"), other = ::rhec::testing::vehicle(plugin);
    const ModelDescription &found = one->description(), &expected = other->description();
    for (auto kind : {&ModelDescription::states, &ModelDescription::inputs, &ModelDescription::parameters,
                      &ModelDescription::outputs}) {
      ASSERT_EQ(names_of(found.*kind), names_of(expected.*kind));
      for (std::size_t j = 0; j < (found.*kind).size(); ++j) {
        const Variable &a = (found.*kind)[j], &b = (expected.*kind)[j];
        EXPECT_EQ(a.unit, b.unit) << a.name;
        EXPECT_EQ(a.scale, b.scale) << a.name;
        EXPECT_EQ(a.is_angle, b.is_angle) << a.name;
        EXPECT_EQ(a.nominal, b.nominal) << a.name;
        EXPECT_EQ(a.lower, b.lower) << a.name;
        EXPECT_EQ(a.upper, b.upper) << a.name;
      }
    }
    EXPECT_EQ(found.roles.position_y, expected.roles.position_y);
    EXPECT_EQ(found.roles.heading, expected.roles.heading);
    EXPECT_EQ(found.roles.speed, expected.roles.speed);
    EXPECT_EQ(found.roles.speed_factor, expected.roles.speed_factor);
  }
}

TEST(Equations, SayHowTheVehicleGoesStraight) {
  const auto one = ::rhec::testing::vehicle(vehicles + "skid_steer.yaml"),
             other = ::rhec::testing::vehicle("skid_steer");
  const auto found = ::rhec::testing::straight(*one, 2.0, {0.1, 0.3, 0.0}),
             expected = ::rhec::testing::straight(*other, 2.0, {0.1, 0.3, 0.0});
  ::rhec::testing::expect_near(found.inputs, expected.inputs, 1e-13);
  ::rhec::testing::expect_near(found.state, expected.state);
}

TEST(Equations, OptionsSetBoundsAndEquations) {
  const auto usual = load(cart), other = load(cart, "{gain: 5}"), limited = load(cart, "{limit: 1.5, outputs: all}");
  EXPECT_EQ(usual->description().states[0].upper, 6.0);
  EXPECT_EQ(other->description().states[0].lower, -15.0);
  EXPECT_EQ(limited->description().states[0].upper, 1.5);
  EXPECT_THAT(::rhec::testing::rates(*other, {0.0}, {3.0}, {0.5}), ElementsAre(::testing::DoubleEq(7.5)));
  EXPECT_THAT(::rhec::testing::seen(*limited, {1.0}), ElementsAre(1.0, 2.5));
}

TEST(Equations, OptionsAreDescribed) {
  const TextFile file(cart);
  const std::vector<OptionRow> rows = vehicle_options(file.path());
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0].name, "gain");
  EXPECT_EQ(rows[0].default_value, "2");
  EXPECT_EQ(rows[0].constraint, "greater than 0");
  EXPECT_EQ(rows[0].meaning, "of the motor [1/s]");
  EXPECT_EQ(rows[1].default_value, "6");
  EXPECT_EQ(rows[2].name, "outputs");
}

TEST(Equations, RefuseWrongOptionsWithThePlaceInTheScenario) {
  EXPECT_CONTAINS(why_not(cart, "gian: 2"),
                  "scenario.yaml:1: gian: vehicle 'written' has no option 'gian'; did you mean 'gain'?");
  EXPECT_CONTAINS(why_not(cart, "gain: 0"), "scenario.yaml:1: gain: found '0', expected a number, greater than 0");
  EXPECT_CONTAINS(why_not(with("default: 2, ", ""), "{}"), "gain: the vehicle has no default for it");
  EXPECT_CONTAINS(why_not(with("default: 2", "default: -2")), "the default -2 of 'gain' is not greater than 0");
}

TEST(Equations, MayHaveOutputsOfMotion) {
  const std::shared_ptr<Model> model = load(with("far = x + limit", "far = x + 3 * k * u"));
  const MotionOutputs motion(*model);
  ASSERT_EQ(motion.count(), 1);
  const double x = 0.5, u = 2.0, k = 0.25;
  double far = 0.0;
  motion.evaluate({.count = 1, .states = &x, .inputs = &u, .parameters = &k, .outputs = &far});
  EXPECT_DOUBLE_EQ(far, 2.0);
}

TEST(Equations, RefuseAVehicleThatIsNotWhole) {
  EXPECT_EQ(why_not(with("  x' = gain * k * u\n", "")),
            "written.yaml:6: the state 'x' has no equation; expected x' = ... in 'equations'");
  EXPECT_EQ(why_not(with("  far = x + limit\n", "")),
            "written.yaml:13: the output 'far' has no equation; expected far = ... in 'equations'");
  EXPECT_CONTAINS(why_not(with("far = x", "v' = x\n  far = x")), "written.yaml:16:3: 'v' is no state");
  EXPECT_CONTAINS(why_not(with("[-limit, limit]", "[limit, -limit]")),
                  "the bounds of 'x' are [6, -6], expected lower <= upper");
  EXPECT_CONTAINS(why_not(with("[-limit, limit]", "[-k, k]")), "written.yaml:6:26: 'k' is not known");
  EXPECT_CONTAINS(why_not(cart + "straight_motion: |\n  k = 1\n"), "written.yaml:18:3: the value of 'k' is given");
  EXPECT_CONTAINS(why_not(cart + "straight_motion: |\n  x = ground_speed\n"),
                  "written.yaml:17: straight motion has no equation for the input 'u'");
}

TEST(Equations, KnowTheirFiles) {
  EXPECT_TRUE(is_equations_file("a/b.yaml"));
  EXPECT_TRUE(is_equations_file("b.yml"));
  EXPECT_FALSE(is_equations_file("bicycle_slip"));
  EXPECT_CONTAINS(error_of([] { load_vehicle("nowhere/v.yaml"); }), "nowhere/v.yaml: no such file");
}

// A long equation is taken, a very long one refused: both in a moment.
TEST(Equations, ManyTerms) {
  const auto cart_of = [](int terms) {
    std::string equation = "x' = u";
    for (int k = 1; k <= terms; ++k) equation += " + sin(" + std::to_string(k) + " * x)";
    return with("x' = gain * k * u", equation);
  };
  const auto model = load(cart_of(500));
  double expected = 1.0;
  for (int k = 1; k <= 500; ++k) expected += std::sin(k * 0.5);
  EXPECT_NEAR(::rhec::testing::rates(*model, {0.5}, {1.0}, {1.0})[0], expected, 1e-11);
  EXPECT_CONTAINS(why_not(cart_of(100000)), "operations; expected at most");
}

}  // namespace equations_test
}  // namespace rhec
