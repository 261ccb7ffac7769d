#include "plugins/host/verdict_cache.hpp"

#include <gmock/gmock.h>

#include <fstream>

#include "plugins/host/fixtures.hpp"

namespace rhec {
namespace verdict_cache_test {

class Cache : public testing::Test {
 protected:
  Cache()
      : plugin_(folder_.path() / "plugin.so"), needed_(folder_.path() / "needed.so"), place_(folder_.path() / "cache") {
    std::ofstream(plugin_) << "a plugin";
    std::ofstream(needed_) << "a library";
    verdict_.record.path = plugin_;
    verdict_.record.name = "name";
    verdict_.libraries = {{needed_, *stamp_of(needed_)}, {plugin_, *stamp_of(plugin_)}};
    VerdictCache(place_).keep(verdict_, *stamp_of(plugin_));
  }
  std::optional<Verdict> found() const { return VerdictCache(place_).find(plugin_); }
  fs::path only_file() const { return fs::directory_iterator(place_)->path(); }

  TemporaryFolder folder_;
  fs::path plugin_, needed_, place_;
  Verdict verdict_;
};

TEST_F(Cache, AVerdictIsFoundAgain) {
  const auto verdict = found();
  ASSERT_TRUE(verdict);
  EXPECT_EQ(verdict->record.path, plugin_);
  EXPECT_EQ(verdict->record.name, "name");
  EXPECT_FALSE(VerdictCache(place_).find(needed_)) << "of another plugin";
}

TEST_F(Cache, ItHoldsWhereTheFileWasOnlyTouched) {
  fs::last_write_time(plugin_, fs::last_write_time(plugin_) + std::chrono::hours(1));
  ASSERT_TRUE(found());
  EXPECT_TRUE(found()) << "with the new time";
}

TEST_F(Cache, ItDoesNotHoldWhereSomethingHasChanged) {
  std::ofstream(needed_) << "another library";
  EXPECT_FALSE(found()) << "a library that it needs";
  verdict_.libraries.clear();
  VerdictCache(place_).keep(verdict_, *stamp_of(plugin_));
  EXPECT_TRUE(found());
  const auto before = *stamp_of(plugin_);
  std::ofstream(plugin_) << "b plugin";
  EXPECT_FALSE(found()) << "the plugin";
  VerdictCache(place_).keep(verdict_, before);
  EXPECT_FALSE(found()) << "a verdict of the file that was there before";
}

TEST_F(Cache, DamagedFilesAreAsGoodAsNone) {
  std::string whole;
  std::getline(std::ifstream(only_file()), whole, '\0');
  for (std::size_t kept = 0; kept < whole.size(); kept += 7) {
    std::ofstream(only_file()) << whole.substr(0, kept);
    EXPECT_FALSE(found()) << kept;
  }
  std::ofstream(only_file()) << whole << "colour red\n";
  EXPECT_FALSE(found());
  std::ofstream(only_file()) << std::string(3'000'000, 'x');
  EXPECT_FALSE(found());
  std::ofstream(only_file()) << whole;
  EXPECT_TRUE(found());
}

TEST_F(Cache, AFolderThatOthersMayWriteToIsNotUsed) {
  fs::permissions(place_, fs::perms::others_write, fs::perm_options::add);
  EXPECT_FALSE(found());
}

TEST_F(Cache, NothingIsLeftAside) {
  EXPECT_EQ(std::distance(fs::directory_iterator(place_), fs::directory_iterator()), 1);
}

TEST_F(Cache, AFolderThatCannotBeWrittenToIsTolerated) {
  const VerdictCache none(needed_ / "below_a_file");
  none.keep(verdict_, *stamp_of(plugin_));
  EXPECT_FALSE(VerdictCache(needed_ / "below_a_file").find(plugin_));
}

}  // namespace verdict_cache_test
}  // namespace rhec
