#include "rhec/sim/maps/map_keeper.hpp"

#include <unistd.h>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace map_keeper_test {

namespace fs = std::filesystem;
using testing::HasSubstr;

class MapKeeperTest : public FolderTest {
 protected:
  Scenario scenario(const std::vector<std::string>& more) const {
    Settings settings = load_yaml(SCENARIOS "/second_lap.yaml");
    apply_assignment(settings, "path.laps=1");
    apply_assignment(settings, fmt::format("estimator.memory={{name: place, file: {}}}", file().string()));
    for (const std::string& assignment : more) apply_assignment(settings, assignment);
    return {Host(), settings};
  }
  fs::path file() const { return folder_ / "field.sqlite"; }
  static RunSummary drive(const Scenario& scenario, const std::shared_ptr<MapKeeper>& keeper) {
    return summarise(run_closed_loop(scenario, {.robot = keeper}), scenario);
  }
};

TEST_F(MapKeeperTest, TheSecondDriveKnowsWhatTheFirstOneFound) {
  const auto first = std::make_shared<MapKeeper>();
  drive(scenario({}), first);
  EXPECT_GT(first->cells(), 300U);
  EXPECT_FALSE(fs::exists(file()));
  first->save();
  const std::vector<std::string> other_noise = {
      "seed=2", "terrain={name: gaussian, correlation_length: 10, lower: 0.5, upper: 1, seed: 1}"};
  const auto second = std::make_shared<MapKeeper>();
  const RunSummary with = drive(scenario(other_noise), second);
  std::vector<std::string> without = other_noise;
  without.emplace_back("estimator.memory=none");
  const RunSummary alone = drive(scenario(without), std::make_shared<MapKeeper>());
  EXPECT_LT(with.mae.parameters.at("kappa"), 0.75 * alone.mae.parameters.at("kappa"));
  EXPECT_LT(with.nees, 9.0);
  second->save();
  const SlipMapContent content = read_slip_map(file());
  EXPECT_GE(content.cells.size(), first->cells());
  EXPECT_GT(content.newest(), 50.0);
}

TEST_F(MapKeeperTest, RefusesTheMapOfAnotherVehicle) {
  const auto keeper = std::make_shared<MapKeeper>();
  SlipMapContent content;
  content.identity = scenario({}).robot().memory().identity();
  content.identity.vehicle = "another one";
  content.cell = 0.5;
  write_slip_map(file(), content);
  EXPECT_THAT(error_of([&] { drive(scenario({}), keeper); }), HasSubstr("another one"));
}

TEST_F(MapKeeperTest, WithoutAMemoryThereIsNothingToSave) {
  const auto keeper = std::make_shared<MapKeeper>();
  drive(scenario({"estimator.memory=none", "path={name: zigzag, legs: 1, leg_length: 20}"}), keeper);
  keeper->save();
  EXPECT_EQ(keeper->cells(), 0U);
  EXPECT_FALSE(fs::exists(file()));
}

}  // namespace map_keeper_test
}  // namespace rhec::sim
