#include "plugins/host/factory.hpp"

#include <gmock/gmock.h>

#include "plugins/host/fixtures.hpp"
#include "plugins/host/library.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace factory_test {

using testing::ElementsAre;
using testing::HasSubstr;

Library library_of(const fs::path& file) {
  return load_library(file, [](std::string_view) {});
}

/// The stages that a trial comes to, and its outcome.
std::pair<std::vector<std::string>, PluginTrial> trial_of(const fs::path& file) {
  std::vector<std::string> stages;
  PluginTrial trial = try_library(library_of(file), [&](std::string_view stage) { stages.emplace_back(stage); });
  return {stages, trial};
}

TEST(Factory, ATrialMakesAnObjectAndDeletesIt) {
  const auto [stages, trial] = trial_of(fixture("good") / "toy.so");
  EXPECT_THAT(stages, ElementsAre("options", "make", "destroy"));
  EXPECT_EQ(trial.outcome, PluginTrial::Outcome::made);
}

TEST(Factory, AFailureIsToldWithTheStageItCameTo) {
  const auto [stages, trial] = trial_of(fixture("throws_exception") / "bad.so");
  EXPECT_THAT(stages, ElementsAre("options", "make"));
  EXPECT_EQ(trial.outcome, PluginTrial::Outcome::failed);
  EXPECT_THAT(trial.text, HasSubstr("out of tea"));
}

TEST(Factory, WrongOptionsAreErrors) {
  Settings settings;
  settings.set("sise", Settings::scalar("2"));
  const Library library = library_of(fixture("good") / "toy.so");
  EXPECT_THAT(error_of([&] { make_object(library, settings); }), HasSubstr("did you mean 'size'?"));
  EXPECT_EQ(options_of(library).size(), 2u);
}

}  // namespace factory_test
}  // namespace rhec
