// A host that examines plugins in a process of its own: what harms that process is told in words, and harms no other.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <string>

#include "plugins/host/fixtures.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace examiner_test {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

// Sanitizers tell of a fault by themselves and then end the program. They need more memory and calls than the
// examination allows without them, so that it has no walls with them.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool is_sanitized = true;
#else
constexpr bool is_sanitized = false;
#endif

/// Copies of the plugin that does what its file is called, in a folder, and a folder for verdicts.
class Examiner : public testing::Test {
 protected:
  void add(const std::string& name) {
    fs::copy_file(fixture("harmful") / "harmful.so", plugins_.path() / (name + ".so"));
  }
  Examination apart() const { return {.apart = true, .time_limit = time_limit_, .verdicts = verdicts_.path()}; }
  Host host() const { return Host({plugins_.path()}, apart()); }
  PluginRecord only_record(const std::string& name) {
    add(name);
    const Host examined = host();
    const auto records = examined.found_in(examined.places()[0]);
    EXPECT_EQ(records.size(), 1u);
    return records.empty() ? PluginRecord() : records[0];
  }

  TemporaryFolder plugins_, verdicts_;
  std::chrono::milliseconds time_limit_ = std::chrono::seconds(10);
};

struct Harm {
  const char* file;
  const char* words;
  bool needs_walls = false;  ///< whether only walls of memory and of calls keep it from its harm
};

class Harmful : public Examiner, public testing::WithParamInterface<Harm> {};

TEST_P(Harmful, IsToldInWords) {
  if (is_sanitized && GetParam().needs_walls) GTEST_SKIP() << "an examination has no walls with sanitizers";
  // Those that do not return are not waited for as long as those that shall not be thought to hang.
  if (std::string(GetParam().words).find("not returned") != std::string::npos)
    time_limit_ = std::chrono::milliseconds(1500);
  const PluginRecord record = only_record(GetParam().file);
  EXPECT_THAT(record.refusal, HasSubstr(GetParam().words));
  EXPECT_THAT(record.remedy, HasSubstr("rhec plugins --doctor"));
}

INSTANTIATE_TEST_SUITE_P(
    All, Harmful,
    testing::Values(
        Harm{"constructor_crashes", is_sanitized ? "it ended the program with exit code 1 while it was loaded"
                                                 : "it crashed (Segmentation fault, SIGSEGV) while it was loaded"},
        Harm{"constructor_hangs", "it had not returned after 1.5 s while it was loaded"},
        Harm{"constructor_computes", "it had not returned after 1.5 s"},
        Harm{"constructor_exits", "it ended the program with exit code 0 while it was loaded"},
        Harm{"constructor_leaves", "it ended the program with exit code 0 while it was loaded"},
        Harm{"constructor_throws", "it crashed (Aborted, SIGABRT) while it was loaded"},
        // How deep it was takes a sanitizer long to tell.
        Harm{"constructor_recurses",
             is_sanitized ? "while it was loaded" : "it crashed (Segmentation fault, SIGSEGV) while it was loaded"},
        Harm{"forks", "it started another process"}, Harm{"forks_forever", "it started another process", true},
        Harm{"runs_program", "it ran another program", true},
        Harm{"kills_parent", "it sent a signal to another process", true},
        Harm{"closes_stdout", "it closed standard output"}, Harm{"replaces_stdout", "it replaced standard output"},
        Harm{"closes_all", "it closed what its examination reports through"},
        Harm{"changes_folder", "it changed the working directory"}, Harm{"stops", "it had not returned after 1.5 s"},
        Harm{"options_crash", "while it was asked for its options"},
        Harm{"factory_crashes", is_sanitized ? "it ended the program with exit code 1 while it made an object"
                                             : "it crashed (Segmentation fault, SIGSEGV) while it made an object"},
        Harm{"factory_hangs", "it had not returned after 1.5 s while it made an object"},
        Harm{"factory_exits", "it ended the program with exit code 0 while it made an object"},
        Harm{"factory_throws", "it crashed (Aborted, SIGABRT) while it made an object"},
        Harm{"factory_allocates", "it asked for more than the 1024 MiB of memory that it may have while it made", true},
        Harm{"factory_allocates_forever", "while it made an object"},
        Harm{"destroy_crashes", "while it deleted an object"}, Harm{"destructor_crashes", "at the end of the program"}),
    [](const auto& harm) { return std::string(harm.param.file); });

TEST_F(Examiner, APluginThatWritesBeyondAnArrayIsRefused) {
  EXPECT_THAT(only_record("factory_overruns").refusal, HasSubstr("while it made an object"));
}

TEST_F(Examiner, WhatItWroteIsTold) {
  EXPECT_THAT(only_record("factory_throws").refusal,
              HasSubstr("it wrote 'terminate called after throwing an instance of"));
}

TEST_F(Examiner, TheOthersAreListedAndWork) {
  for (const char* name : {"constructor_crashes", "constructor_exits", "factory_crashes", "prints"}) add(name);
  fs::copy_file(fixture("good") / "toy.so", plugins_.path() / "toy.so");
  const Host examined = host();
  EXPECT_THAT(examined.names(PluginKind::blocking), Contains("toy"));
  EXPECT_THAT(examined.names(PluginKind::blocking), Contains("harmful")) << "printing harms nobody";
  std::array<std::uint8_t, 4> begins{};
  EXPECT_EQ(examined.make_blocking("toy")->starts({.first = 0, .intervals = 4}, begins.data()), 0);
  EXPECT_EQ(examined.options(PluginKind::blocking, "toy").size(), 2u);
  EXPECT_EQ(examined.try_out(examined.discover().back()).outcome, PluginTrial::Outcome::made);
  EXPECT_THAT(error_of([&] { examined.make_blocking("tox"); }),
              AllOf(HasSubstr("did you mean 'toy'?"),
                    HasSubstr(is_sanitized ? "factory_crashes.so: refused: it ended the program with exit code 1"
                                           : "factory_crashes.so: refused: it crashed")));
}

TEST_F(Examiner, WhatTheManifestSaysIsToldOfACrashInTheFactory) {
  const PluginRecord record = only_record("factory_crashes");
  EXPECT_EQ(record.name, "harmful");
  EXPECT_EQ(record.kind, PluginKind::blocking);
}

TEST_F(Examiner, ItIsTheSameWithAnExaminationAndWithout) {
  for (const char* name :
       {"good", "throws_exception", "null_text", "missing_dependency", "undefined_symbol", "old_abi"}) {
    const Host examined({fixture(name)}, apart()), plain({fixture(name)});
    const PluginRecord one = examined.discover().at(0), other = plain.discover().at(0);
    EXPECT_EQ(one.explanation(), other.explanation()) << name;
    EXPECT_EQ(one.title(), other.title()) << name;
    if (!one.accepted()) continue;
    EXPECT_EQ(examined.try_out(one).outcome, plain.try_out(other).outcome) << name;
    EXPECT_EQ(examined.try_out(one).text, plain.try_out(other).text) << name;
  }
}

TEST_F(Examiner, NothingIsLeftRunning) {
  time_limit_ = std::chrono::milliseconds(500);
  only_record("constructor_hangs");
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "a process that was started has not been waited for";
  EXPECT_EQ(errno, ECHILD);
}

}  // namespace examiner_test
}  // namespace rhec
