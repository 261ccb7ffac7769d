// horizons.jsonl: what its first line says of the model, the settings and the ground.
#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "rhec/sim/files/json.hpp"
#include "rhec/sim/horizons/horizon_log.hpp"
#include "sim/support/figure8.hpp"
#include "sim/support/recorded_drive.hpp"

namespace rhec::sim {
namespace horizon_files_test {

using testing::ElementsAre;

Json first_line(const std::string& text) { return Json::parse(text.substr(0, text.find('\n'))); }

std::vector<std::string> names_in(const Json& variables) {
  std::vector<std::string> names;
  for (const Json& variable : variables) names.push_back(variable.at("name").as_text());
  return names;
}

/// A run, and the text of its horizons.
struct ShortRun {
  Scenario scenario = figure8_with({"path.laps=1", "path.radius=8", "speed=10", "name=short",
                                    "blocking.kappa={name: structured, size: 5, transition: ramp}"});
  HorizonLog horizons{scenario.robot(), 1};
  RunLog log = run_closed_loop(scenario, {.sampled = [this](const LoopSample& sample) { horizons.take(sample); }});
  std::string text = horizons_text(horizons, log, scenario);
};

TEST(HorizonsText, BeginsWithWhatWasDriven) {
  const ShortRun run;
  const Json json = first_line(run.text);
  EXPECT_EQ(json.at("form"), "rhec horizons");
  EXPECT_EQ(json.at("version"), 1);
  EXPECT_EQ(json.at("kind"), "run");
  EXPECT_EQ(json.at("name"), "short");
  EXPECT_EQ(json.at("samples"), run.log.samples.size());
  const Json& model = json.at("model");
  EXPECT_EQ(model.at("name"), "bicycle_slip");
  EXPECT_THAT(names_in(model.at("states")), ElementsAre("x_pos", "y_pos", "beta", "delta"));
  EXPECT_THAT(names_in(model.at("parameters")), ElementsAre("kappa", "mu"));
  EXPECT_EQ(model.at("parameters").at(0).at("upper"), 1.0) << "the scenario's bound";
  EXPECT_TRUE(model.at("states").at(0).at("lower").is_null());
  EXPECT_EQ(model.at("roles").at("heading"), 2);
  EXPECT_EQ(model.at("position_outputs"), Json({0, 1})) << "the receiver's coordinates";
  const Json& settings = json.at("settings");
  EXPECT_EQ(settings.at("step"), 0.2);
  EXPECT_EQ(settings.at("speed"), 10.0);
  EXPECT_EQ(settings.at("estimator"), "rhe");
  EXPECT_EQ(settings.at("solvers").at("rhc").at("name"), "gn_rti");
  ASSERT_EQ(settings.at("blocking").size(), 2U);
  const Json &kappa = settings.at("blocking").at(0), &mu = settings.at("blocking").at(1);
  EXPECT_EQ(kappa.at("parameter"), "kappa");
  EXPECT_EQ(kappa.at("name"), "structured");
  EXPECT_EQ(kappa.at("transition"), "ramp");
  EXPECT_EQ(kappa.at("is_one_block"), false);
  EXPECT_EQ(mu.at("is_one_block"), true);
}

TEST(HorizonsText, HasThePathAndTheGroundUnderIt) {
  const ShortRun run;
  const Json json = first_line(run.text);
  const Json &x = json.at("path").at("x"), &y = json.at("path").at("y");
  ASSERT_EQ(x.size(), y.size());
  const PathPoint end = run.scenario.path().point_at(run.scenario.path().length());
  EXPECT_NEAR(x.back().as_number(), end.x, 1e-4);
  EXPECT_NEAR(y.back().as_number(), end.y, 1e-4);
  ASSERT_EQ(json.at("slip").size(), 2U);
  for (const int parameter : {0, 1}) {
    const Json& map = json.at("slip").at(parameter);
    EXPECT_EQ(map.at("parameter"), parameter == 0 ? "kappa" : "mu");
    const auto nx = map.at("nx").as_integer(), ny = map.at("ny").as_integer();
    ASSERT_EQ(std::ssize(map.at("values").get<std::vector<double>>()), nx * ny);
    for (const std::int64_t iy : {std::int64_t{0}, ny / 2, ny - 1})
      for (const std::int64_t ix : {std::int64_t{0}, nx / 3, nx - 1}) {
        double values[2];
        run.scenario.terrain().sample(map.at("x0").as_number() + static_cast<double>(ix) * map.at("dx").as_number(),
                                      map.at("y0").as_number() + static_cast<double>(iy) * map.at("dy").as_number(),
                                      values);
        EXPECT_NEAR(map.at("values").at(iy * nx + ix).as_number(), values[parameter], 1e-3);
      }
  }
}

TEST(HorizonsText, GoesOnWithWhatTheLogKept) {
  const ShortRun run;
  const std::string rest = run.text.substr(run.text.find('\n') + 1);
  EXPECT_EQ(rest, run.horizons.nodes_line(0) + run.horizons.records());
  EXPECT_GT(run.horizons.kept(), 10);
}

TEST(HorizonsText, OfALogHasEachVariantForEachSuffix) {
  const LogScenario scenario = scenario_of(scenario_text, {"rhe", "ekf"});
  RecordedLog log;
  log.fixes.resize(7);
  const Json json = Json::parse(horizons_text(std::vector<HorizonLog>{}, log, scenario, {5, 4}, {"", " causal"}));
  EXPECT_EQ(json.at("kind"), "log");
  EXPECT_EQ(json.at("name"), "circle");
  EXPECT_EQ(json.at("fixes"), 7);
  EXPECT_EQ(json.at("hold_out").at("every"), 5);
  EXPECT_THAT(names_in(json.at("variants")), ElementsAre("rhe", "rhe causal", "ekf", "ekf causal"));
  EXPECT_EQ(json.at("variants").at(2).at("settings").at("estimator"), "ekf");
  EXPECT_TRUE(json.at("variants").at(0).at("settings").at("solvers").at("rhc").is_null()) << "nobody drives";
  EXPECT_EQ(json.at("model").at("name"), "bicycle_slip");
}

}  // namespace horizon_files_test
}  // namespace rhec::sim
