#include "rhec/plugins/equations/vehicle_cpp.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "rhec/core/formula/expression.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "support/error_of.hpp"

// Made by `rhec model --cpp` when this test is built.
#include "bicycle/bicycle.hpp"
#include "odd/odd_2_vehicle.hpp"
#include "skid_steer/skid_steer.hpp"
#include "support/temporary_folder.hpp"

namespace rhec {
namespace vehicle_cpp_test {

std::vector<double> values_of(const VehicleGraph& vehicle, const std::vector<double>& options,
                              const std::vector<double>& z) {
  std::vector<int> inputs, targets = vehicle.rates;
  for (const Tape::Known& option : vehicle.options) inputs.push_back(option.node);
  for (const auto* nodes : {&vehicle.states, &vehicle.inputs, &vehicle.parameters})
    inputs.insert(inputs.end(), nodes->begin(), nodes->end());
  targets.insert(targets.end(), vehicle.outputs.begin(), vehicle.outputs.end());
  std::vector<double> values = options;
  values.insert(values.end(), z.begin(), z.end());
  return vehicle.graph->evaluate(targets, inputs, values);
}

/// Bit by bit where the graph is evaluated; the compiler's own evaluation with double may round otherwise.
template <template <class> class Formula>
void expect_same(const std::string& file) {
  const std::shared_ptr<Model> model = load_vehicle(file);
  const VehicleGraph made = trace<Formula>();
  ASSERT_NE(model->graph(), nullptr);
  const VehicleGraph& graph = *model->graph();
  ASSERT_EQ(made.options.size(), graph.options.size());
  for (std::size_t k = 0; k < made.options.size(); ++k)
    EXPECT_NEAR(made.options[k].value, graph.options[k].value, 1e-15 * std::abs(graph.options[k].value)) << k;
  EXPECT_EQ(made.graph->count_operations(made.rates), graph.graph->count_operations(graph.rates));
  EXPECT_EQ(made.graph->count_operations(made.outputs), graph.graph->count_operations(graph.outputs));
  constexpr int nx = Formula<double>::state_count, nu = Formula<double>::input_count,
                np = Formula<double>::parameter_count, ny = Formula<double>::output_count;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0.3, 2.0);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> options, z;
    Formula<double> formula;
    formula.options([&](const char*, double& value, const char*, const auto&...) {
      value = uniform(random);
      options.push_back(value);
    });
    for (int k = 0; k < nx + nu + np; ++k) z.push_back(uniform(random));
    const std::vector<double> expected = values_of(graph, options, z), found = values_of(made, options, z);
    ASSERT_EQ(expected.size(), found.size());
    std::vector<double> compiled(nx + ny);
    formula.dynamics(z.data(), z.data() + nx, z.data() + nx + nu, compiled.data());
    formula.outputs(z.data(), compiled.data() + nx);
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_TRUE(std::isfinite(expected[k])) << k;
      EXPECT_EQ(std::bit_cast<std::uint64_t>(expected[k]), std::bit_cast<std::uint64_t>(found[k])) << k;
      EXPECT_NEAR(expected[k], compiled[k], 1e-12 * (1.0 + std::abs(expected[k]))) << k;
    }
  }
}

/// All that a simulation takes of a model besides its steps: the same bits of the file as of the formula in C++.
template <template <class> class Formula>
void expect_same_motion(const std::string& file) {
  const std::shared_ptr<Model> model = load_vehicle(file);
  const FormulaModel<Formula> made(Formula<double>{}, model->description());
  const std::size_t nx = model->description().states.size(), nu = model->description().inputs.size();
  std::mt19937 random(6);
  std::uniform_real_distribution<double> uniform(0.3, 2.0);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> z(nx + nu + model->description().parameters.size());
    for (double& value : z) value = uniform(random);
    std::vector<double> rates(nx), found_rates(nx), motion(nx + nu, 7.0), found_motion(nx + nu, 7.0);
    const double* p = z.data() + nx + nu;
    model->rates(z.data(), z.data() + nx, p, rates.data());
    made.rates(z.data(), z.data() + nx, p, found_rates.data());
    EXPECT_EQ(rates, found_rates);
    model->straight_motion(z[0], p, motion.data(), motion.data() + nx);
    made.straight_motion(z[0], p, found_motion.data(), found_motion.data() + nx);
    EXPECT_EQ(motion, found_motion);
  }
}

const std::string vehicles = RHEC_SOURCE "/examples/vehicles/";
const std::string odd = RHEC_SOURCE "/tests/plugins/equations/odd_vehicle.yaml";

TEST(VehicleCpp, IsTheFormulaOfTheFile) {
  expect_same<Bicycle>(vehicles + "bicycle.yaml");
  expect_same<SkidSteer>(vehicles + "skid_steer.yaml");
  expect_same<Odd2Vehicle>(odd);
}

TEST(VehicleCpp, MovesAsTheFileDoes) {
  expect_same_motion<Bicycle>(vehicles + "bicycle.yaml");
  expect_same_motion<SkidSteer>(vehicles + "skid_steer.yaml");
  expect_same_motion<Odd2Vehicle>(odd);
}

std::string content(const VehicleSources& sources, const std::string& name) {
  for (const VehicleSources::File& file : sources.files)
    if (file.name == name) return file.content;
  ADD_FAILURE() << "no file " << name;
  return {};
}

TEST(VehicleCpp, KeepsNamesUnitsMeaningsAndBounds) {
  const VehicleSources sources = vehicle_as_cpp(vehicles + "bicycle.yaml");
  EXPECT_EQ(sources.plugin, "bicycle");
  EXPECT_TRUE(sources.notes.empty());
  const std::string header = content(sources, "bicycle.hpp"), source = content(sources, "bicycle.cpp");
  for (const char* part : {"const Scalar speed = named(kappa * u1, \"speed\");", "// steering rate [rad/s]",
                           "dxdt[2] = speed / wheelbase * tan(mu * delta);", "Scalar gps_offset{0.4};",
                           "visit(\"wheelbase\", wheelbase, \"distance of the axles [m]\", rhec::greater_than(0.0));",
                           "///     beta'  = speed / wheelbase * tan(mu * delta)"})
    EXPECT_CONTAINS(header, part);
  for (const char* part :
       {".lower = -35.0 * std::numbers::pi / 180.0", ".usual = false", ".is_angle = true",
        "model.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};", "describe()",
        "rhec::bicycle_kernels()"})
    EXPECT_CONTAINS(source, part);
  EXPECT_CONTAINS(content(sources, "CMakeLists.txt"),
                  "rhec_add_model(bicycle SOURCES bicycle.cpp FORMULA_HEADER bicycle.hpp FORMULA Bicycle)");
  EXPECT_CONTAINS(content(sources, "README.md"), "rhec check bicycle");
}

TEST(VehicleCpp, HasTheSameTextEachTimeInLinesThatFit) {
  for (const std::string& file : {vehicles + "skid_steer.yaml", odd}) {
    const VehicleSources first = vehicle_as_cpp(file), second = vehicle_as_cpp(file);
    for (std::size_t k = 0; k < first.files.size(); ++k) {
      EXPECT_EQ(first.files[k].content, second.files[k].content);
      if (!first.files[k].name.ends_with("pp")) continue;
      const std::string& text = first.files[k].content;
      for (std::size_t at = 0, end = 0; at < text.size(); at = end + 1) {
        end = std::min(text.find('\n', at), text.size());
        const std::string line = text.substr(at, end - at);
        EXPECT_TRUE(line.size() <= 120u || line.find("//") != std::string::npos) << line;
      }
    }
  }
}

// Bounds and straight motion of options, an option that follows another one, names that C++ has taken.
TEST(VehicleCpp, TellsWhatIsOtherwise) {
  const VehicleSources sources = vehicle_as_cpp(odd);
  EXPECT_EQ(sources.plugin, "odd_2_vehicle");
  ASSERT_EQ(sources.notes.size(), 1u);
  EXPECT_CONTAINS(sources.notes[0], "the default of 'limit' is computed of that of 'limit0'");
  const std::string header = content(sources, "odd_2_vehicle.hpp"), source = content(sources, "odd_2_vehicle.cpp");
  EXPECT_CONTAINS(header, "const Scalar& int_ = state[1];");
  EXPECT_CONTAINS(header, "visit(\"double\", double_, ");
  EXPECT_CONTAINS(header, "return Scalar(sqrt(limit0 * 2.0) + hypot(Scalar(3.0), Scalar(4.0)));");
  EXPECT_EQ(header.find("const Scalar zero"), std::string::npos);  // an exponent's part, which is a number there
  EXPECT_CONTAINS(header, "rhec::Range{.lower = 0.0, .upper = 5.0, .lower_is_open = true}");
  EXPECT_CONTAINS(header, "rhec::between(-1.0, 2.0)");
  EXPECT_CONTAINS(source, ".upper = sqrt(double(4.0)) * vehicle.limit");
  EXPECT_CONTAINS(source, "describe(const Odd2Vehicle<double>& vehicle)");
  EXPECT_CONTAINS(source, "A \\\"quoted\\\" source \\\\ with everything");
  EXPECT_CONTAINS(header, "const Scalar v = ground_speed * double_ + sin(Scalar(1.0));");
  EXPECT_CONTAINS(header, "const Scalar u = v / p[0];");
}

TEST(VehicleCpp, RefusesWhatIsNoVehicle) {
  EXPECT_CONTAINS(error_of([] { vehicle_as_cpp("nowhere.yaml"); }), "nowhere.yaml: no such file");
}

TEST(VehicleCpp, AsksForAnOptionWithoutDefault) {
  const TemporaryFolder folder;
  const std::filesystem::path file =
      folder.put("needy.yaml",
                 "options: {mass: {unit: kg, meaning: of it all}}\nstates: {v: {}}\noutputs: {v: {}}\n"
                 "equations: |\n  v' = v / mass\n");
  const VehicleSources sources = vehicle_as_cpp(file);
  EXPECT_CONTAINS(content(sources, "needy.hpp"), "Scalar mass{std::numeric_limits<double>::quiet_NaN()};");
  EXPECT_CONTAINS(content(sources, "needy.hpp"), "#include <limits>");
  EXPECT_CONTAINS(content(sources, "needy.cpp"), "if (std::isnan(options.mass))");
  EXPECT_CONTAINS(content(sources, "needy.cpp"), "set it in the section 'model' (of it all [kg])");
}

}  // namespace vehicle_cpp_test
}  // namespace rhec
