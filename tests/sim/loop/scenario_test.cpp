#include "rhec/sim/loop/scenario.hpp"

#include <gmock/gmock.h>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "sim/support/figure8.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace scenario_test {

using testing::AllOf;
using testing::Contains;
using testing::Ge;
using testing::HasSubstr;
using testing::Le;

/// The ground's kappa and mu at a place.
std::array<double, 2> slip_at(const Scenario& scenario, double x, double y) {
  std::array<double, 2> values{};
  scenario.terrain().sample(x, y, values.data());
  return values;
}

TEST(Scenario, TheVehicleStartsOnThePathAndFacesAlongIt) {
  const Scenario scenario = figure8_with({"path.radius=12"});
  const PathPoint start = scenario.path().point_at(0.0);
  const Eigen::VectorXd& state = scenario.initial_state();
  ASSERT_EQ(state.size(), 4);
  EXPECT_EQ(state[0], start.x);
  EXPECT_EQ(state[1], start.y);
  EXPECT_EQ(state[2], start.heading);
  EXPECT_EQ(state[3], 0.0);
  EXPECT_NEAR(scenario.path().length(), 2 * 4.0 * M_PI * 12.0, 1.0) << "two laps of two circles";
  EXPECT_EQ(start.speed, 8.0);
}

TEST(Scenario, NotesWhatLooksLikeAWrongUnit) {
  EXPECT_THAT(figure8_with({}).notes(), testing::IsEmpty());
  EXPECT_THAT(figure8_with({"speed=60"}).notes(),
              testing::ElementsAre(HasSubstr("216 km/h"), HasSubstr("lateral acceleration")));
  EXPECT_THAT(figure8_with({"step=5", "speed=1"}).notes(), testing::ElementsAre(HasSubstr("step: 5 s")));
  EXPECT_THAT(figure8_with({"model.outputs=[x_gps, y_gps]"}).notes(),
              testing::ElementsAre(HasSubstr("noise.outputs.delta: passed over")));
}

TEST(Scenario, NotesBendsThatTheVehicleCannotTake) {
  EXPECT_THAT(figure8_with({"path.radius=1.5", "speed=1"}).notes(),
              testing::ElementsAre(testing::AllOf(HasSubstr("bends of a radius of 1.5 m"), HasSubstr("with 'delta'"),
                                                  HasSubstr("turns on 2 m"))));
  EXPECT_THAT(figure8_with({"path.radius=2.1", "speed=1"}).notes(), testing::IsEmpty());
  EXPECT_THAT(figure8_with({"path.radius=2.1", "speed=1", "bounds.delta=[-0.2, 0.2]"}).notes(),
              testing::ElementsAre(HasSubstr("turns on 6.9")));
  // One that an input turns can turn on the spot.
  EXPECT_THAT(figure8_with({"path={name: figure8, radius: 0.3, spacing: 0.02}", "speed=0.2", "model={name: skid_steer}",
                            "noise={}", "bounds={}", "estimator={}", "controller={}"})
                  .notes(),
              testing::IsEmpty());
}

TEST(Scenario, ThoseThatComeWithRhecHaveNothingToNote) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SCENARIOS)) {
    if (entry.path().extension() != ".yaml") continue;
    const Settings settings = load_yaml(entry.path());
    if (settings.find("grid") || settings.find("log")) continue;
    EXPECT_THAT(Scenario(Host(), settings).notes(), testing::IsEmpty()) << entry.path();
    ++count;
  }
  EXPECT_GT(count, 7);
}

TEST(Scenario, OtherFilesSayWhatTheyAre) {
  EXPECT_THAT(error_of([] { figure8_with({"log={}"}); }), HasSubstr("'rhec estimate'"));
  EXPECT_THAT(error_of([] { figure8_with({"grid=[]"}); }), HasSubstr("'rhec sweep'"));
  EXPECT_THAT(error_of([] { figure8_with({"equations=x"}); }), HasSubstr("model: {equations: FILE}"));
}

TEST(Scenario, ThePathsSpeedsChangeAsFastAsTheyMay) {
  const Scenario bends = figure8_with({"path.radius=12", "path.lateral_acceleration=3"});
  EXPECT_NEAR(bends.path().point_at(20.0).speed, 6.0, 0.01) << "3 m/s^2 at a radius of 12 m";
  const Scenario rows = figure8_with({"path={name: headland, row_length: 40, turn_radius: 4, acceleration: 0.5}"});
  EXPECT_EQ(rows.path().section_count(), 7);
  const double quarter = rows.path().section_end(0) - 40.0;
  EXPECT_NEAR(quarter, 2.0 * M_PI, 1e-3);
  EXPECT_NEAR(rows.path().point_at(rows.path().section_end(0) - 1.0).speed, 1.0, 0.01);
  const Scenario on_the_way = figure8_with({"path.start=30"});
  EXPECT_EQ(on_the_way.initial_state()[0], on_the_way.path().point_at(30.0).x);
}

TEST(Scenario, TheGroundIsAsItIsNamed) {
  const Scenario constant = figure8_with({"terrain={name: constant, values: {kappa: 0.75}}"});
  EXPECT_EQ(slip_at(constant, 3.0, -7.0), (std::array{0.75, 1.0})) << "mu is where nothing slips";
  const Scenario patches = figure8_with({"terrain={name: patches, lower: 0.6, ranges: {mu: [0.9, 0.95]}}"});
  for (double x = -50.0; x < 50.0; x += 1.0) {
    const auto [kappa, mu] = slip_at(patches, x, 0.0);
    EXPECT_THAT(kappa, AllOf(Ge(0.6), Le(1.0)));
    EXPECT_THAT(mu, AllOf(Ge(0.9), Le(0.95)));
  }
  const std::vector<std::string> same = {"seed=3"}, other = {"seed=4"};
  EXPECT_EQ(slip_at(figure8_with(same), 1.0, 2.0), slip_at(figure8_with(same), 1.0, 2.0));
  EXPECT_NE(slip_at(figure8_with(same), 1.0, 2.0), slip_at(figure8_with(other), 1.0, 2.0));
}

TEST(Scenario, TheGroundMayBeSplit) {
  const std::string constant = "{name: constant, values: {kappa: 0.75}}", below = "{name: patches, upper: 0.7}";
  const Scenario split = figure8_with(
      {"terrain={name: split, across: y, border: 4, below: " + below + ", above: " + constant + "}", "seed=5"});
  const Scenario patches = figure8_with({"terrain=" + below, "seed=5"});
  EXPECT_EQ(slip_at(split, 1.0, 4.1), (std::array{0.75, 1.0}));
  EXPECT_EQ(slip_at(split, 1.0, 3.9), slip_at(patches, 1.0, 3.9)) << "the scenario's seed is its grounds'";
}

TEST(Scenario, TheVehicleIsTheTruth) {
  const Scenario scenario = figure8_with({"vehicle={step: 0.005, mechanical_stops: false}"});
  EXPECT_EQ(scenario.vehicle().step, 0.005);
  EXPECT_FALSE(scenario.vehicle().mechanical_stops);
  EXPECT_TRUE(scenario.vehicle().noise.empty());
  const Scenario disturbed = figure8_with({"vehicle.noise.y_pos=0.1", "seed=4"});
  EXPECT_EQ(disturbed.vehicle().noise, (std::vector{0.0, 0.1, 0.0, 0.0}));
  EXPECT_EQ(disturbed.vehicle().seed, 4U);
}

class ScenarioFileTest : public FolderTest {};

TEST_F(ScenarioFileTest, FilesAreMeantBesideTheScenarioThatNamesThem) {
  put("path.csv", "x,y\n0,0\n10,0\n10,20\n");
  put("kappa.csv", "origin_x,origin_y,cell_size\n0,0,1\n0.5\n");
  put("mu.csv", "origin_x,origin_y,cell_size\n0,0,1\n0.75\n");
  const auto yaml = put("mine.yaml",
                        "model: bicycle_slip\npath: {name: file, file: path.csv}\n"
                        "terrain: {name: raster, files: [kappa.csv, mu.csv]}\n");
  const Scenario scenario(Host(), load_yaml(yaml.string()));
  EXPECT_DOUBLE_EQ(scenario.path().length(), 30.0);
  EXPECT_EQ(slip_at(scenario, 5.0, 5.0), (std::array{0.5, 0.75}));
  put("mine.yaml", "model: bicycle_slip\npath:\n  name: file\n  file: none.csv\n");
  EXPECT_THAT(error_of([&] { Scenario(Host(), load_yaml(yaml.string())); }),
              AllOf(HasSubstr("mine.yaml:4: "), HasSubstr("found 'none.csv', expected a file"),
                    HasSubstr(file("none.csv").string())));
}

TEST(Scenario, MistakesAreToldWithTheirKey) {
  const struct {
    std::vector<std::string> assignments;
    std::string key, what;
  } cases[] = {
      {{"path.name=file"}, "path.name", "no path.file"},
      {{"path.spacing=1e-6"}, "path.spacing", "more than 2e+06 of them"},
      {{"path={name: zigzag, spacing: 1e-6}"}, "path.spacing", "more than 2e+06 of them"},
      {{"path.laps=1", "path.radius=0.05", "speed=100"}, "step", "expected between 1 and 1e+06"},
      {{"terrain={name: gaussian, lower: 1, upper: 0.5}"}, "terrain.lower", "expected lower <= upper"},
      {{"terrain={name: raster, files: [a.csv]}"}, "terrain.files", "1 raster files given; expected 2"},
      {{"terrain={name: raster, files: [none.csv, none.csv]}"}, "terrain.files", "there is no none.csv"},
      {{"terrain.ranges.kapa=[0, 1]"}, "terrain", "did you mean 'kappa'"},
      {{"terrain.ranges.kappa=[0, .inf]"}, "terrain.ranges.kappa", "two finite numbers"},
      {{"terrain={name: constant, values: {kapa: 1}}"}, "terrain", "did you mean 'kappa'"},
      {{"terrain={name: swamp}"}, "terrain.name", "gaussian"},
      {{"terrain={name: split, below: {name: constant}}"}, "terrain.name", "no 'above'"},
      {{"terrain={name: split, below: {name: constant}, above: {name: swamp}}"}, "terrain.above.name", "gaussian"},
      {{"path={name: figure9}"}, "path.name", "did you mean 'figure8'"},
      {{"vehicle.stp=1"}, "vehicle", "did you mean 'step'"},
      {{"spede=4"}, "spede", "did you mean 'speed'"},
  };
  for (const auto& each : cases)
    EXPECT_THAT(error_of([&] { figure8_with(each.assignments); }), AllOf(HasSubstr(each.key), HasSubstr(each.what)))
        << each.assignments.front();
}

TEST(ScenarioSections, AreThoseOfTheWorldBeforeThoseOfTheRobot) {
  const std::vector<OptionSection> sections = scenario_sections();
  ASSERT_GE(sections.size(), 5U);
  std::vector<std::string> names;
  for (const OptionSection& section : sections) {
    names.push_back(section.name);
    EXPECT_FALSE(section.meaning.empty()) << section.name;
  }
  EXPECT_THAT(std::vector<std::string>(names.begin(), names.begin() + 4),
              testing::ElementsAre("", "path", "terrain", "vehicle"));
  EXPECT_THAT(names, Contains("estimator"));
  std::vector<std::string> keys;
  for (const OptionRow& row : sections.front().rows) keys.push_back(row.name);
  for (const char* key : {"speed", "seed", "path", "terrain", "vehicle", "estimator"}) EXPECT_THAT(keys, Contains(key));
}

}  // namespace scenario_test
}  // namespace rhec::sim
