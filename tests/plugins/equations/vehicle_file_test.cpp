#include "plugins/equations/vehicle_file.hpp"

#include <gmock/gmock.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::equations {
namespace vehicle_file_test {

using ::testing::ElementsAre;

const std::string good = R"(
states:
  x: {unit: m, typical: 10, role: position_x}
  psi: {unit: rad, angle: true, role: heading, meaning: heading}
  phi: {unit: rad, role: other_heading}
inputs:
  v: {unit: m/s, role: speed, bounds: [-1, 2 * pi]}
parameters:
  kappa: {nominal: 0.9, role: speed_factor}
options:
  length: {default: 1 + 1, unit: m, above: 0, meaning: of the bar}
  width: 3
outputs:
  x_gps: {unit: m}
  psi: {unit: rad, usual: false}
equations: |
  x' = kappa * v
  psi' = 0
  phi' = 0
  x_gps = x
)";

class VehicleFileTest : public FolderTest {
 protected:
  VehicleFile read(const std::string& text) const { return VehicleFile(put("a_vehicle.yaml", text)); }
  /// What is wrong with the good file if `part` of it is another one, without the folder.
  std::string why_not(const std::string& part, const std::string& other) {
    std::string text = good;
    text.replace(text.find(part), part.size(), other);
    const std::string message = error_of([&] { read(text); });
    return message.starts_with(folder_.path().string()) ? message.substr(message.find("a_vehicle")) : message;
  }
};

TEST_F(VehicleFileTest, SaysWhatAVehicleIs) {
  const VehicleFile vehicle = read(good);
  const ModelDescription& about = vehicle.description();
  EXPECT_EQ(about.name, "a_vehicle");  // that of the file, since it gives none
  EXPECT_THAT(names_of(about.states), ElementsAre("x", "psi", "phi"));
  EXPECT_THAT(names_of(about.outputs), ElementsAre("x_gps", "psi"));
  EXPECT_EQ(about.states[0].scale, 10.0);
  EXPECT_TRUE(about.states[1].is_angle);
  EXPECT_FALSE(about.outputs[1].usual);
  EXPECT_EQ(about.parameters[0].nominal, 0.9);
  EXPECT_EQ(about.parameters[0].unit, "1");
  EXPECT_EQ(about.roles.position_x, 0);
  EXPECT_EQ(about.roles.position_y, -1);
  EXPECT_EQ(about.roles.heading, 1);
  EXPECT_THAT(about.roles.other_headings, ElementsAre(2));
  EXPECT_EQ(about.roles.speed, 0);
  EXPECT_EQ(about.roles.speed_factor, 0);
  ASSERT_EQ(vehicle.options().size(), 2u);
  EXPECT_EQ(vehicle.options()[0].range.text(), "greater than 0");
  EXPECT_EQ(vehicle.options()[0].otherwise.size(), 3u);
  EXPECT_EQ(vehicle.equations().size(), 4u);
  EXPECT_EQ(vehicle.equations()[0].place.line, 17);
  EXPECT_EQ(vehicle.equations()[0].place.column, 3);
  EXPECT_EQ(vehicle.bounds().size(), 5u);
  EXPECT_TRUE(vehicle.bounds()[0].lower.empty());
  EXPECT_EQ(vehicle.bounds()[3].upper.size(), 3u);
}

TEST_F(VehicleFileTest, MistakesNameFileAndLine) {
  EXPECT_CONTAINS(why_not("unit: m, typical", "units: m, typical"),
                  "a_vehicle.yaml:3: states.x.units: 'x' of states has no option 'units'; did you mean 'unit'?");
  EXPECT_CONTAINS(why_not("typical: 10", "typical: -1"), "found '-1', expected a typical magnitude, greater than 0");
  EXPECT_CONTAINS(why_not("role: heading", "role: heding"), "heading");
  EXPECT_CONTAINS(why_not("role: other_heading", "role: heading"), "two of the states have the role 'heading'");
  EXPECT_CONTAINS(why_not("[-1, 2 * pi]", "[-1]"), "expected a list [lower, upper]; null for no bound");
  EXPECT_CONTAINS(why_not("2 * pi", "2 * * pi"), "a_vehicle.yaml:7:");
  EXPECT_CONTAINS(why_not("2 * pi", ".inf"), "a bound that there is not is null");
  EXPECT_CONTAINS(why_not("  width: 3", "  x: 3"), "'x' is a variable or an option already");
  EXPECT_CONTAINS(why_not("  width: 3", "  outputs: 3"), "'outputs' is a key of the section 'model'");
  EXPECT_CONTAINS(why_not("  width: 3", "  2w: 3"), "'2w' is no name");
  EXPECT_CONTAINS(why_not("  width: 3", "  sin: 3"), "'sin' is a function or a constant");
  EXPECT_CONTAINS(why_not("above: 0", "above: 0, at_least: 1"), "expected one of them");
  EXPECT_CONTAINS(why_not("kappa * v", "kappa v"), "a_vehicle.yaml:17:14: found 'v', expected an operator");
  EXPECT_CONTAINS(why_not("equations: |", "equation: |"), "did you mean 'equations'?");
  EXPECT_CONTAINS(error_of([&] { read("states: {x: }\noutputs: {x: }\n"); }), "it has no equations");
  EXPECT_CONTAINS(error_of([&] { read("outputs: {x: }\nequations: x' = 1\n"); }), "it has no states");
  EXPECT_CONTAINS(error_of([&] { read("states: {x: }\nequations: x' = 1\n"); }), "it has no outputs");
  EXPECT_CONTAINS(error_of([&] { read("- 1\n"); }), "expected a vehicle: a map with the keys states");
  EXPECT_CONTAINS(error_of([&] { read("states: {x: }\noutputs: {x: }\nequations: [a]\n"); }),
                  "expected equations as text, one a line, below 'equations: |'");
}

// However a text is written in YAML, a mistake in it is found in its line.
TEST_F(VehicleFileTest, PlacesAreThoseOfTheFile) {
  EXPECT_CONTAINS(error_of([&] { read("states: {x: }\noutputs: {x: }\nequations: x' = 1 +\n"); }),
                  "a_vehicle.yaml:3:20:");
  EXPECT_CONTAINS(error_of([&] { read("states: {x: }\noutputs: {x: }\nequations: |2\n    x' = 1 +\n"); }),
                  "a_vehicle.yaml:4:13:");
  EXPECT_CONTAINS(error_of([&] { read("states: {x: }\noutputs: {x: }\nequations: |\n\n\n   x' = 1\n   y = $\n"); }),
                  "a_vehicle.yaml:7:8:");
}

TEST_F(VehicleFileTest, APlaceOfAVariable) {
  EXPECT_EQ(read(good).place("outputs", "psi").line, 15);
  EXPECT_EQ(read(good).place("outputs", "").line, 13);
}

// A part of a scenario is a vehicle, too; lines and columns are the scenario's.
TEST_F(VehicleFileTest, MayStandInAnotherFile) {
  const auto inside = [&](const std::string& vehicle) {
    std::string text = "speed: 3\nmodel:\n  equations:\n";
    for (std::size_t at = 0, end = 0; at < vehicle.size(); at = end + 1) {
      end = std::min(vehicle.find('\n', at), vehicle.size());
      text += "    " + vehicle.substr(at, end - at) + "\n";
    }
    return load_yaml(put("a_vehicle.yaml", text));
  };
  const Settings settings = inside(good);
  const VehicleFile vehicle(*settings.find_path("model.equations"));
  EXPECT_EQ(vehicle.description().name, "vehicle");
  EXPECT_EQ(vehicle.description().states.size(), 3u);
  EXPECT_EQ(vehicle.equations()[0].place.line, 20);
  EXPECT_EQ(vehicle.equations()[0].place.column, 7);
  std::string wrong = good;
  wrong.replace(wrong.find("kappa * v"), 9, "kappa ** v");
  const Settings mistaken = inside(wrong);
  const std::string message = error_of([&] { VehicleFile(*mistaken.find_path("model.equations")); });
  EXPECT_CONTAINS(message, "a_vehicle.yaml:20:18: found '**'");
}

TEST_F(VehicleFileTest, NeedsNoFile) {
  Settings settings = parse_yaml(good, "--set model");
  const VehicleFile vehicle(settings);
  EXPECT_EQ(vehicle.description().outputs.size(), 2u);
  EXPECT_EQ(vehicle.equations()[0].place.column, 0);
}

TEST_F(VehicleFileTest, TellsWhatYamlMadeOfTheText) {
  EXPECT_CONTAINS(why_not("equations: |", "equations: >"),
                  "write 'equations: |', with one equation on each line below it");
  EXPECT_CONTAINS(why_not("equations: |", "equations:"), "write 'equations: |'");
  EXPECT_EQ(why_not("equations: |", "equations: |-"), "");
  EXPECT_CONTAINS(why_not("default: 1 + 1", "default: hypot(3, 4)"), "write a term that has a comma in quotes");
  EXPECT_CONTAINS(why_not("[-1, 2 * pi]", "[atan2(1, 2), 3]"), "a term with a comma in quotes");
  EXPECT_CONTAINS(why_not("width: 3", "width: .nan"), "found '.nan', expected a finite number");
}

}  // namespace vehicle_file_test
}  // namespace rhec::equations
