#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/kit/manifest.hpp"

#include <elf.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <system_error>
#include <thread>
#include <tuple>

#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/kit/fingerprint.hpp"

namespace rhec {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

fs::path fixture(const std::string& name) { return fs::path(FIXTURES) / name; }

template <class Call>
std::string message(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

/// What the host says of the files in its first place.
std::vector<PluginRecord> records_in(const fs::path& directory) {
  const Host host({directory});
  std::vector<PluginRecord> records;
  for (const PluginRecord& record : host.discover()) {
    if (record.path.parent_path() == fs::canonical(directory)) records.push_back(record);
  }
  return records;
}

std::string refusal_of(const std::string& name) {
  const auto records = records_in(fixture(name));
  return records.size() == 1 ? records[0].refusal : "not one file";
}

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = testing::TempDir() + "rhec_host_XXXXXX";
    path_ = mkdtemp(pattern.data());
  }
  ~TemporaryFolder() { fs::remove_all(path_); }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

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

TEST(Host, AGoodPluginIsToldAsItsManifestSays) {
  const auto records = records_in(fixture("good"));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_TRUE(records[0].accepted()) << records[0].refusal;
  EXPECT_EQ(records[0].kind, PluginKind::blocking);
  EXPECT_EQ(records[0].name, "toy");
  EXPECT_EQ(records[0].version, "1.0");
  EXPECT_EQ(records[0].licence, "MIT");
  EXPECT_EQ(records[0].backend_version, "7");
  EXPECT_EQ(records[0].path.filename(), "toy.so");
}

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
  EXPECT_THAT(message([&] { host.make_blocking("toy", settings); }),
              HasSubstr("field.yaml:7: sise: blocking 'toy' has no option 'sise'; did you mean 'size'?"));
  Settings thirteen;
  thirteen.set("size", Settings::scalar("13"));
  EXPECT_EQ(message([&] { host.make_blocking("toy", thirteen); }), "size 13 does not fit; take 12");
}

TEST(Host, APluginThatIsNotThereIsAnsweredWithAllThatWasTried) {
  TemporaryFolder empty;
  const Environment path("RHEC_PLUGIN_PATH", "relative/folder::/no/such/folder");
  const Host host({fixture("good"), fixture("old_abi"), empty.path()});
  Settings settings;
  settings.set("blocking.name", Settings::scalar("tpy", {"field.yaml", 4}));
  const std::string text = message([&] { host.make_blocking("tpy", *settings.find("blocking")); });
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
  EXPECT_THAT(message([&] { host.make_model("toy"); }), HasSubstr("there is no model plugin 'toy'"));
  EXPECT_THAT(message([&] { host.make_solver("toy"); }), HasSubstr("there is no solver plugin 'toy'"));
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

TEST(BadPlugin, ALibraryWithoutAManifestIsNotEvenLoaded) {
  EXPECT_THAT(refusal_of("no_manifest"), HasSubstr("exports no data symbol rhec_plugin_manifest"));
  EXPECT_EQ(getenv("RHEC_TEST_NO_MANIFEST_RAN"), nullptr) << "its constructors ran";
}

TEST(BadPlugin, ManifestsOfAnotherTimeAreRefused) {
  EXPECT_THAT(refusal_of("wrong_magic"), HasSubstr("does not start like one of rhec"));
  EXPECT_THAT(refusal_of("old_abi"), HasSubstr("has ABI 0, this rhec reads 1: the plugin is older"));
  EXPECT_THAT(refusal_of("new_abi"), HasSubstr("has ABI 99, this rhec reads 1: the plugin is newer"));
  EXPECT_THAT(refusal_of("ends_after_head"), HasSubstr("has 16 bytes, expected"));
  EXPECT_THAT(refusal_of("ends_before_head"), HasSubstr("has 4 bytes, expected 16 at least"));
  EXPECT_THAT(refusal_of("other_revision"),
              HasSubstr("blocking 'wrong' implements revision 77 of the interfaces, this rhec has " +
                        std::to_string(kInterfaceRevision)));
}

TEST(BadPlugin, AnotherAlignmentOfEigenIsToldWithThePluginAndBothValues) {
  const std::string own =
      std::string(RHEC_BUILD_FINGERPRINT).substr(std::string(RHEC_BUILD_FINGERPRINT).rfind(", ") + 2);
  for (const auto& [name, plugin, values] :
       {std::tuple("other_alignment", "blocking 'toy' 3.0", "alignment 32 (static "),
        std::tuple("other_static_alignment", "blocking 'toy' 4.0", "(static 0)")}) {
    const auto records = records_in(fixture(name));
    ASSERT_EQ(records.size(), 1u) << name;
    EXPECT_THAT(records[0].refusal, AllOf(HasSubstr(plugin), HasSubstr(values), HasSubstr("rhec with " + own)));
    EXPECT_THAT(records[0].refusal, Not(HasSubstr("gcc"))) << "what is alike is not told";
    EXPECT_THAT(records[0].remedy, HasSubstr("-march"));
    EXPECT_EQ(records[0].name, "toy");
  }
}

TEST(BadPlugin, AnotherBuildIsRefusedWithBothFingerprints) {
  EXPECT_THAT(refusal_of("other_fingerprint"),
              AllOf(HasSubstr("rhec 0.0.1, gcc 4, somewhere else"), HasSubstr(RHEC_BUILD_FINGERPRINT)));
}

TEST(BadPlugin, IncompleteManifestsAreRefused) {
  EXPECT_THAT(refusal_of("unknown_kind"), HasSubstr("kind 9"));
  EXPECT_THAT(refusal_of("null_text"), HasSubstr("null text"));
  EXPECT_THAT(refusal_of("null_factory"), HasSubstr("schema, create or destroy is null"));
}

TEST(BadPlugin, AMissingDependencyIsNamed) {
  const auto records = records_in(fixture("missing_dependency"));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_THAT(records[0].refusal,
              AllOf(HasSubstr("needs the library librhec_test_gone.so, which the loader cannot open"),
                    HasSubstr("librhec_test_gone.so: cannot open shared object file")));
  EXPECT_THAT(records[0].remedy, HasSubstr("install the package that provides librhec_test_gone.so"));
}

TEST(BadPlugin, AMissingSymbolIsNamed) {
  const auto records = records_in(fixture("undefined_symbol"));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_THAT(records[0].refusal,
              HasSubstr("undefined symbol: no library that it is linked to defines rhec_test_gone"));
  EXPECT_EQ(records[0].remedy, "link it to the library that does");
}

TEST(BadPlugin, ASymbolOfAnotherRhecIsToldWithHowThisOneWasBuilt) {
  const auto records = records_in(fixture("other_strings"));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_THAT(records[0].refusal, HasSubstr("defines rhec::"));
  EXPECT_THAT(records[0].remedy, AllOf(HasSubstr("build it again"), HasSubstr(RHEC_BUILD_FINGERPRINT)));
}

TEST(BadPlugin, FilesThatAreNoLibraryAreRefused) {
  TemporaryFolder folder;
  std::ofstream(folder.path() / "a_empty.so").close();
  std::ofstream(folder.path() / "b_text.so") << "GROUP ( libm.so.6 )\n";
  fs::copy_file("/proc/self/exe", folder.path() / "c_program.so");
  fs::create_symlink("nowhere", folder.path() / "d_dangling.so");
  fs::create_directory(folder.path() / "e_folder.so");
  ASSERT_EQ(mkfifo((folder.path() / "f_pipe.so").c_str(), 0600), 0);
  fs::create_symlink("g_loop.so", folder.path() / "g_loop.so");
  std::ofstream(folder.path() / "h_notes.txt") << "not looked at";
  const auto records = records_in(folder.path());
  ASSERT_EQ(records.size(), 7u);
  EXPECT_THAT(records[0].refusal, HasSubstr("empty"));
  EXPECT_THAT(records[1].refusal, HasSubstr("not an ELF file"));
  EXPECT_THAT(records[2].refusal, HasSubstr("a program, not a shared library"));
  EXPECT_THAT(records[3].refusal, HasSubstr("a symbolic link to nowhere, where nothing is"));
  EXPECT_THAT(records[4].refusal, HasSubstr("a directory, not a library"));
  EXPECT_THAT(records[5].refusal, HasSubstr("a pipe"));
  EXPECT_THAT(records[6].refusal, HasSubstr("cannot be looked at"));
  for (const PluginRecord& record : records) EXPECT_NE(record.remedy, "") << record.path;
}

/// A copy of the good plugin with other bytes in the head of the file.
std::string refusal_with_bytes(std::streamoff offset, const std::string& bytes) {
  TemporaryFolder folder;
  const fs::path copy = folder.path() / "toy.so";
  fs::copy_file(fixture("good") / "toy.so", copy);
  std::fstream(copy, std::ios::in | std::ios::out | std::ios::binary).seekp(offset) << bytes;
  const auto records = records_in(folder.path());
  return records.size() == 1 ? records[0].refusal : "not one file";
}

TEST(BadPlugin, ALibraryForAnotherMachineIsToldWithBoth) {
  const std::string other = refusal_with_bytes(offsetof(Elf64_Ehdr, e_machine), {'\x16', '\x00'});  // of S/390
  EXPECT_THAT(other, AllOf(HasSubstr("for another kind of machine (ELF machine 22, "), HasSubstr("expected ")));
  EXPECT_THAT(refusal_with_bytes(EI_CLASS, {sizeof(void*) == 8 ? ELFCLASS32 : ELFCLASS64}),
              HasSubstr(sizeof(void*) == 8 ? ", 32 bits" : ", 64 bits"));
}

TEST(BadPlugin, OtherElfFilesAreToldByTheirType) {
  const auto offset = static_cast<std::streamoff>(offsetof(Elf64_Ehdr, e_type));
  EXPECT_THAT(refusal_with_bytes(offset, {ET_EXEC, 0}), HasSubstr("a program, not a shared library"));
  EXPECT_THAT(refusal_with_bytes(offset, {ET_REL, 0}), HasSubstr("an object file that is not linked yet"));
  EXPECT_THAT(refusal_with_bytes(offset, {ET_CORE, 0}), HasSubstr("an ELF file of another type"));
}

TEST(BadPlugin, ATruncatedCopyIsRefusedWhereverItEnds) {
  TemporaryFolder folder;
  const fs::path good = fixture("good") / "toy.so", copy = folder.path() / "toy.so";
  const auto size = fs::file_size(good);
  Elf64_Ehdr header;
  ASSERT_TRUE(std::ifstream(good, std::ios::binary).read(reinterpret_cast<char*>(&header), sizeof header));
  const auto within_sections = header.e_shoff + header.e_shentsize / 2;
  ASSERT_LT(within_sections, size);
  for (const std::uintmax_t kept : {std::uintmax_t{2}, std::uintmax_t{20}, std::uintmax_t{64}, std::uintmax_t{300},
                                    size / 4, size / 2, std::uintmax_t{within_sections}, size - 1}) {
    fs::copy_file(good, copy, fs::copy_options::overwrite_existing);
    fs::resize_file(copy, kept);
    const auto records = records_in(folder.path());
    ASSERT_EQ(records.size(), 1u);
    const auto expected = kept < sizeof header ? sizeof header : size;
    EXPECT_EQ(records[0].refusal, "the file is truncated: it has " + std::to_string(kept) + " bytes, expected " +
                                      std::to_string(expected) + " at least");
  }
}

TEST(BadPlugin, BytesThatAreWrongDoNotHarmTheReader) {
  TemporaryFolder folder;
  const fs::path good = fixture("no_manifest") / "bad.so", copy = folder.path() / "bad.so";
  for (int offset = 16; offset < 64; ++offset) {  // all of the header behind its first mark
    fs::copy_file(good, copy, fs::copy_options::overwrite_existing);
    std::fstream file(copy, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(offset).put('\xff');
    file.close();
    for (const auto& record : records_in(folder.path())) EXPECT_FALSE(record.accepted()) << offset;
  }
}

TEST(BadPlugin, FailuresOfAFactoryBecomeWords) {
  const auto failure = [](const std::string& name) {
    return message([&] { Host({fixture(name)}).make_blocking("failing"); });
  };
  EXPECT_EQ(failure("throws_exception"), "blocking 'failing' failed: out of tea");
  EXPECT_THAT(failure("throws_int"), HasSubstr("threw something that is no std::exception"));
  EXPECT_EQ(failure("throws_long").size(), 4095u);
  EXPECT_THAT(failure("returns_null"), HasSubstr("blocking 'failing' could not be made: it gave no reason"));
  EXPECT_THAT(message([] { Host({fixture("returns_null")}).options(PluginKind::blocking, "failing"); }),
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
  EXPECT_THAT(message([] { trial_of("other_revision"); }), HasSubstr("revision 77"));
  EXPECT_THAT(message([] { trial_of("other_alignment"); }), HasSubstr("alignment 32"));
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

}  // namespace
}  // namespace rhec
