#include "rhec/plugins/host/host.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <system_error>
#include <thread>

#include "plugins/host/fixtures.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/model/model.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace host_test {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// Sets a variable of the environment, and puts back what was there.
class Environment {
 public:
  Environment(const char* name, const std::string& value) : name_(name) {
    if (const char* before = getenv(name)) before_ = before;
    setenv(name, value.c_str(), 1);
  }
  ~Environment() {
    if (before_) {
      setenv(name_, before_->c_str(), 1);
    } else {
      unsetenv(name_);
    }
  }

 private:
  const char* name_;
  std::optional<std::string> before_;
};

TEST(Host, AGoodPluginWorks) {
  const Host host({fixture("good")});
  Settings settings;
  settings.set("name", Settings::scalar("toy"));
  settings.set("size", Settings::scalar("2"));
  settings.set("sigma", Settings::scalar("0.5"));
  const std::shared_ptr<Blocking> toy = host.make_blocking("toy", settings);
  std::array<std::uint8_t, 4> begins{};
  EXPECT_EQ(toy->starts({.first = 3, .intervals = 4}, begins.data()), 2);
  EXPECT_THAT(begins, ElementsAre(1, 1, 0, 1));
  EXPECT_EQ(toy->neighbour_sigma(), 0.5);
}

TEST(Host, AnObjectOutlivesTheHost) {
  std::shared_ptr<Blocking> toy = Host({fixture("good")}).make_blocking("toy");
  std::uint8_t begins = 0;
  EXPECT_EQ(toy->starts({.first = 4, .intervals = 1}, &begins), 3);
}

TEST(Host, OptionsAreTold) {
  const auto rows = Host({fixture("good")}).options(PluginKind::blocking, "toy");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].name, "size");
  EXPECT_EQ(rows[0].default_value, "3");
  EXPECT_EQ(rows[0].constraint, "at least 1");
}

TEST(Host, WrongOptionsAreToldWithTheirPlace) {
  const Host host({fixture("good")});
  Settings settings;
  settings.set("sise", Settings::scalar("2", {"field.yaml", 7}));
  EXPECT_THAT(error_of([&] { host.make_blocking("toy", settings); }),
              HasSubstr("field.yaml:7: sise: blocking 'toy' has no option 'sise'; did you mean 'size'?"));
  Settings thirteen;
  thirteen.set("size", Settings::scalar("13"));
  EXPECT_EQ(error_of([&] { host.make_blocking("toy", thirteen); }), "size 13 does not fit; take 12");
}

TEST(Host, APluginThatIsNotThereIsAnsweredWithAllThatWasTried) {
  TemporaryFolder empty;
  const Environment path("RHEC_PLUGIN_PATH", "relative/folder::/no/such/folder");
  const Host host({fixture("good"), fixture("old_abi"), empty.path()});
  Settings settings;
  settings.set("blocking.name", Settings::scalar("tpy", {"field.yaml", 4}));
  const std::string text = error_of([&] { host.make_blocking("tpy", *settings.find("blocking")); });
  EXPECT_THAT(text, HasSubstr("field.yaml:4: blocking.name: there is no blocking plugin 'tpy'; did you mean 'toy'?"));
  EXPECT_THAT(text, HasSubstr("available: toy"));
  EXPECT_THAT(text, HasSubstr(fixture("good").string() + " (given)\n"));
  EXPECT_THAT(text, HasSubstr("bad.so: refused: its manifest has ABI 0"));
  EXPECT_THAT(text, HasSubstr("no file that ends in .so"));
  EXPECT_THAT(text, HasSubstr("relative/folder (RHEC_PLUGIN_PATH): a relative entry"));
  EXPECT_THAT(text, HasSubstr("'' (RHEC_PLUGIN_PATH): an empty entry"));
  EXPECT_THAT(text, HasSubstr("/no/such/folder (RHEC_PLUGIN_PATH): no such directory"));
  EXPECT_THAT(text, HasSubstr("(installed)"));
}

TEST(Host, APluginOfAnotherKindIsNotTaken) {
  const Host host({fixture("good")});
  EXPECT_THAT(error_of([&] { host.make_model("toy"); }), HasSubstr("there is no model plugin 'toy'"));
  EXPECT_THAT(error_of([&] { host.make_solver("toy"); }), HasSubstr("there is no solver plugin 'toy'"));
}

TEST(Host, OfTwoWithOneNameTheFirstIsTaken) {
  for (const bool other_way : {false, true}) {
    const fs::path first = fixture(other_way ? "good_too" : "good"), second = fixture(other_way ? "good" : "good_too");
    const Host host({first, second});
    std::vector<PluginRecord> records;
    for (const auto& record : host.discover()) {
      if (record.name == "toy") records.push_back(record);
    }
    ASSERT_EQ(records.size(), 2u);
    EXPECT_TRUE(records[0].accepted());
    EXPECT_EQ(records[0].version, other_way ? "2.0" : "1.0");
    EXPECT_THAT(records[1].refusal, AllOf(HasSubstr("shadowed"), HasSubstr(records[0].path.string()),
                                          HasSubstr("its directory is searched before")));
    EXPECT_EQ(records[1].used_instead, records[0].path);
    EXPECT_EQ(records[1].version, other_way ? "1.0" : "2.0");
    EXPECT_NE(host.make_blocking("toy"), nullptr);
  }
}

TEST(Host, OfTwoWithOneNameInOneDirectoryTheFirstByFileNameIsTaken) {
  TemporaryFolder folder;
  fs::copy_file(fixture("good_too") / "also_toy.so", folder.path() / "a.so");
  fs::copy_file(fixture("good") / "toy.so", folder.path() / "b.so");
  const auto records = records_in(folder.path());
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[0].version, "2.0");
  EXPECT_TRUE(records[0].accepted());
  EXPECT_THAT(records[1].refusal, HasSubstr("its file name sorts before"));
  EXPECT_EQ(records[1].used_instead, records[0].path);
}

TEST(Host, ThePathIsSearchedInOrder) {
  const Environment path("RHEC_PLUGIN_PATH", fixture("good_too").string() + ":" + fixture("good").string());
  const Host host({fixture("old_abi")});
  ASSERT_GE(host.places().size(), 3u);
  EXPECT_EQ(host.places()[0].origin, "given");
  EXPECT_EQ(host.places()[1].directory, fs::canonical(fixture("good_too")));
  EXPECT_EQ(host.places()[2].directory, fs::canonical(fixture("good")));
  EXPECT_EQ(host.places().back().origin, "installed");
  EXPECT_THAT(host.names(PluginKind::blocking), Contains("toy"));
}

TEST(Host, OnePlaceIsSearchedOnce) {
  const Host host({fixture("good"), fixture("good") / ".." / "good"});
  EXPECT_EQ(host.places()[1].skipped, "searched already");
  EXPECT_THAT(host.diagnosis(), Not(HasSubstr("shadowed")));
}

TEST(Host, PlacesThatCannotBeSearchedAreToldWithTheReason) {
  TemporaryFolder folder;
  const fs::path file = folder.path() / "file", loop = folder.path() / "loop";
  std::ofstream(file) << "no directory";
  fs::create_symlink("loop", loop);
  const Host host({file, folder.path() / "none", loop, file / "below"});
  EXPECT_EQ(host.places()[0].skipped, "a file, not a directory");
  EXPECT_EQ(host.places()[1].skipped, "no such directory");
  EXPECT_EQ(host.places()[2].skipped, std::make_error_code(std::errc::too_many_symbolic_link_levels).message());
  EXPECT_EQ(host.places()[3].skipped, std::make_error_code(std::errc::not_a_directory).message());
  EXPECT_THAT(host.found_in(host.places()[0]), testing::IsEmpty());
}

TEST(Host, WhatEveryUserMayWriteToIsRefused) {
  TemporaryFolder folder;
  // A folder for each case: a library that is loaded must not be written over.
  const auto copy_with = [&](const char* name, fs::perms of_folder, fs::perms of_file) {
    const fs::path place = folder.path() / name;
    fs::copy(fixture("good"), place, fs::copy_options::recursive);
    for (const auto& entry : fs::directory_iterator(place))
      fs::permissions(entry.path(), fs::perms::owner_all | of_file);
    fs::permissions(place, fs::perms::owner_all | of_folder);
    return Host({place});
  };
  const Host safe = copy_with("safe", fs::perms::none, fs::perms::none);
  EXPECT_THAT(safe.names(PluginKind::blocking), Contains("toy"));
  EXPECT_EQ(safe.places()[0].warning, "");

  const Host open = copy_with("open", fs::perms::others_write, fs::perms::none);
  EXPECT_THAT(open.names(PluginKind::blocking), Not(Contains("toy")));
  EXPECT_THAT(open.places()[0].skipped, HasSubstr("chmod o-w " + fs::canonical(folder.path() / "open").string()));

  const Host shared = copy_with("shared", fs::perms::group_write, fs::perms::none);
  EXPECT_THAT(shared.names(PluginKind::blocking), Contains("toy"));
  EXPECT_THAT(shared.places()[0].warning, HasSubstr("chmod g-w"));
  EXPECT_THAT(shared.diagnosis(), HasSubstr("warning: its group may write to it"));

  const Host open_file = copy_with("open_file", fs::perms::none, fs::perms::others_write);
  EXPECT_THAT(open_file.names(PluginKind::blocking), Not(Contains("toy")));
  EXPECT_THAT(open_file.diagnosis(), HasSubstr("every user may write to it"));
}

TEST(Host, TheWorkingDirectoryIsNotSearched) {
  const fs::path before = fs::current_path();
  fs::current_path(fixture("good"));
  const Environment path("RHEC_PLUGIN_PATH", ".:");
  const Host host({""});
  EXPECT_THAT(host.names(PluginKind::blocking), Not(Contains("toy")));
  fs::current_path(before);
}

TEST(Host, SeveralThreadsMayAsk) {
  const Host host({fixture("good"), fixture("old_abi")});
  std::array<std::shared_ptr<Blocking>, 4> made;
  std::vector<std::thread> threads;
  threads.reserve(made.size());
  for (auto& each : made) threads.emplace_back([&] { each = host.make_blocking("toy"); });
  for (std::thread& thread : threads) thread.join();
  for (const auto& each : made) EXPECT_NE(each, nullptr);
}

TEST(BadPlugin, FailuresOfAFactoryBecomeWords) {
  const auto failure = [](const std::string& name) {
    return error_of([&] { Host({fixture(name)}).make_blocking("failing"); });
  };
  EXPECT_EQ(failure("throws_exception"), "blocking 'failing' failed: out of tea");
  EXPECT_THAT(failure("throws_int"), HasSubstr("threw something that is no std::exception"));
  EXPECT_EQ(failure("throws_long").size(), 4095u);
  EXPECT_THAT(failure("returns_null"), HasSubstr("blocking 'failing' could not be made: it gave no reason"));
  EXPECT_THAT(error_of([] { Host({fixture("returns_null")}).options(PluginKind::blocking, "failing"); }),
              HasSubstr("cannot be told"));
}

/// What trying the first plugin in a directory says.
PluginTrial trial_of(const std::string& name) {
  const Host host({fixture(name)});
  return host.try_out(host.found_in(host.places().front()).at(0));
}

TEST(Trial, AGoodPluginIsMade) {
  EXPECT_EQ(trial_of("good").outcome, PluginTrial::Outcome::made);
  EXPECT_EQ(trial_of("good").text, "");
}

TEST(Trial, AFailureIsToldInThePluginsWords) {
  EXPECT_EQ(trial_of("throws_exception").outcome, PluginTrial::Outcome::failed);
  EXPECT_EQ(trial_of("throws_exception").text, "blocking 'failing' failed: out of tea");
  EXPECT_EQ(trial_of("throws_int").outcome, PluginTrial::Outcome::failed);
  EXPECT_EQ(trial_of("returns_null").outcome, PluginTrial::Outcome::failed);
  EXPECT_THAT(trial_of("returns_null").text, HasSubstr("options of blocking 'failing' cannot be told"));
}

TEST(Trial, NothingOfARefusedPluginIsCalled) {
  EXPECT_THAT(error_of([] { trial_of("other_revision"); }), HasSubstr("revision 77"));
  EXPECT_THAT(error_of([] { trial_of("other_alignment"); }), HasSubstr("alignment 32"));
}

TEST(Trial, PluginsOfTheHouseAreMadeOrSayWhatTheyNeed) {
  const Host host;
  std::vector<std::string> needing;
  for (const PluginRecord& plugin : host.found_in(host.places().back())) {
    if (!plugin.accepted()) continue;
    const PluginTrial trial = host.try_out(plugin);
    EXPECT_NE(trial.outcome, PluginTrial::Outcome::failed) << plugin.name << ": " << trial.text;
    if (plugin.name == "bicycle_slip") {
      EXPECT_EQ(trial.text, "4 states, 2 inputs, 2 parameters, 3 outputs");
    }
    if (trial.outcome == PluginTrial::Outcome::needs_options) needing.push_back(plugin.name);
  }
  EXPECT_THAT(needing, Contains("pattern"));
}

}  // namespace host_test
}  // namespace rhec
