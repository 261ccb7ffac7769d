#include "rhec/sim/store/sweep_store.hpp"

#include <sqlite3.h>

#include <cmath>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace sweep_store_test {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

class SweepStoreTest : public FolderTest {
 protected:
  fs::path file(const std::string& name = "runs.sqlite") const { return folder_ / name; }
  /// A database with this many rows.
  fs::path filled(int rows) const {
    SweepStore store(file(), "a program");
    std::vector<SweepRow> all;
    all.reserve(static_cast<std::size_t>(rows));
    for (int i = 0; i < rows; ++i) all.push_back(row_of(i));
    store.write(all);
    return file();
  }
  static SweepRow row_of(int i) {
    SweepRow row;
    row.configuration = fmt::format(R"({{"seed":{},"speed":4.5}})", i);
    row.identity = identity_of(row.configuration);
    row.seed = i;
    row.status = RunStatus::completed;
    row.reason = "the end of the path was reached";
    row.steps = 100 + i;
    row.solves = 200;
    row.fallbacks = 1;
    row.nees = 6.25;
    row.mae = R"({"kappa":0.0123})";
    row.rmse = R"({"kappa":0.1})";
    row.mae_after_start = R"({"kappa":null})";
    row.statuses = R"({"rhe":{"solved":3}})";
    row.solve_time_us = R"({"rhe":{"median":1.5}})";
    row.seconds = 0.5;
    return row;
  }
  /// What the store says of a file; empty: it takes it.
  std::string refusal_of(const fs::path& name) const {
    const std::string text = error_of([&] { const SweepStore store(name); });
    if (text.empty()) return text;
    EXPECT_THAT(text, StartsWith(name.string() + ": "));
    return text.substr(name.string().size() + 2);
  }
  static std::string bytes_of(const fs::path& name) {
    std::ifstream stream(name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
};

/// SQLite itself, beside the store.
class Sqlite {
 public:
  explicit Sqlite(const fs::path& file) { EXPECT_EQ(sqlite3_open(file.c_str(), &database_), SQLITE_OK); }
  ~Sqlite() { sqlite3_close(database_); }
  Sqlite(const Sqlite&) = delete;
  Sqlite& operator=(const Sqlite&) = delete;
  /// The rows of an answer, columns joined by '|'.
  std::vector<std::string> operator()(const std::string& statement) {
    std::vector<std::string> rows;
    const auto add = [](void* to, int count, char** values, char**) {
      std::string row;
      for (int i = 0; i < count; ++i) row += (i > 0 ? "|" : "") + std::string(values[i] ? values[i] : "NULL");
      static_cast<std::vector<std::string>*>(to)->push_back(row);
      return 0;
    };
    char* problem = nullptr;
    EXPECT_EQ(sqlite3_exec(database_, statement.c_str(), add, &rows, &problem), SQLITE_OK) << (problem ? problem : "");
    sqlite3_free(problem);
    return rows;
  }

 private:
  sqlite3* database_ = nullptr;
};

TEST_F(SweepStoreTest, KeepsRows) {
  {
    SweepStore store(file(), "a program");
    EXPECT_EQ(store.count(), 0);
    SweepRow refused;
    refused.configuration = R"({"seed":"x"})";
    refused.identity = identity_of(refused.configuration);
    refused.status = RunStatus::refused;
    refused.reason = "it's \"wrong\"";
    store.write(std::vector{row_of(1), row_of(2), refused});
    store.write({});
  }
  const SweepStore store(file());
  EXPECT_EQ(store.count(), 3);
  EXPECT_EQ(store.find(row_of(2).identity), RunStatus::completed);
  EXPECT_EQ(store.find(row_of(3).identity), std::nullopt);
  int summaries = 0;
  RunIdentity last{};
  for (const SweepRow& row : store.rows()) {
    EXPECT_LT(last, row.identity);
    last = row.identity;
    EXPECT_EQ(row.identity, identity_of(row.configuration));
    if (!row.has_summary()) {
      EXPECT_EQ(row.status, RunStatus::refused);
      EXPECT_EQ(row.reason, "it's \"wrong\"");
      EXPECT_FALSE(row.seed.has_value());
      EXPECT_TRUE(std::isnan(row.nees));
      continue;
    }
    ++summaries;
    const SweepRow expected = row_of(*row.seed);
    EXPECT_EQ(row.identity, expected.identity);
    EXPECT_EQ(row.status, expected.status);
    EXPECT_EQ(row.steps, expected.steps);
    EXPECT_EQ(row.solves, 200);
    EXPECT_EQ(row.fallbacks, 1);
    EXPECT_EQ(row.nees, 6.25);
    EXPECT_EQ(row.mae, expected.mae);
    EXPECT_EQ(row.rmse, expected.rmse);
    EXPECT_EQ(row.mae_after_start, expected.mae_after_start);
    EXPECT_EQ(row.statuses, expected.statuses);
    EXPECT_EQ(row.solve_time_us, expected.solve_time_us);
    EXPECT_EQ(row.seconds, 0.5);
  }
  EXPECT_EQ(summaries, 2);
}

TEST_F(SweepStoreTest, KeepsTheFirstOfTwoRowsOfOneIdentity) {
  SweepStore store(file());
  SweepRow again = row_of(1);
  again.reason = "another time";
  store.write(std::vector{row_of(1), again});
  store.write(std::vector{again});
  ASSERT_EQ(store.count(), 1);
  EXPECT_EQ(store.rows().front().reason, row_of(1).reason);
}

TEST_F(SweepStoreTest, IsWhatTheDocumentationSays) {
  filled(3);
  Sqlite sqlite(file());
  EXPECT_THAT(sqlite("PRAGMA application_id"), ElementsAre("1919444323"));
  EXPECT_THAT(sqlite("PRAGMA user_version"), ElementsAre("1"));
  EXPECT_THAT(sqlite("SELECT configuration ->> 'speed', mae ->> 'kappa', program, finished LIKE '20__-__-__T__:__:__Z' "
                     "FROM runs WHERE seed = 2"),
              ElementsAre("4.5|0.0123|a program|1"));
  std::ifstream page(fs::path(SCENARIOS) / "../docs/sweep.md");
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  for (const std::string& column : sqlite("SELECT name FROM pragma_table_info('runs')"))
    EXPECT_THAT(text, HasSubstr("| `" + column + "` |"));
  EXPECT_THAT(text, HasSubstr("`user_version` 1"));
}

TEST_F(SweepStoreTest, RefusesASecondStoreAndLetsOthersRead) {
  filled(2);
  {
    SweepStore store(file());
    EXPECT_THAT(refusal_of(file()), HasSubstr("another sweep writes to it"));
    EXPECT_THAT(Sqlite(file())("SELECT count(*) FROM runs"), ElementsAre("2"));
    store.write(std::vector{row_of(2)});
    EXPECT_THAT(Sqlite(file())("SELECT count(*) FROM runs"), ElementsAre("3"));
    EXPECT_TRUE(fs::exists(file("runs.sqlite.lock")));
  }
  EXPECT_FALSE(fs::exists(file("runs.sqlite.lock")));
  EXPECT_EQ(SweepStore(file()).count(), 3);
}

TEST_F(SweepStoreTest, ALockFileThatWasLeftBehindLocksNothing) {
  filled(2);
  std::ofstream(file("runs.sqlite.lock")) << "";
  EXPECT_EQ(refusal_of(file()), "");
}

TEST_F(SweepStoreTest, RefusesADatabaseThatIsLocked) {
  filled(2);
  Sqlite other(file());
  other("BEGIN EXCLUSIVE");
  EXPECT_THAT(refusal_of(file()), AllOf(HasSubstr("is in use by another program"), HasSubstr("start again")));
  other("COMMIT");
  EXPECT_EQ(SweepStore(file()).count(), 2);
}

TEST_F(SweepStoreTest, RefusesOtherVersions) {
  filled(2);
  Sqlite{file()}("PRAGMA user_version = 2");
  EXPECT_THAT(refusal_of(file()), HasSubstr("has version 2 of the schema, and this program writes version 1"));
  EXPECT_THAT(Sqlite(file())("SELECT count(*) FROM runs"), ElementsAre("2"));
}

TEST_F(SweepStoreTest, RefusesWhatIsNotItsOwn) {
  Sqlite(file("other.sqlite"))("CREATE TABLE runs (a); INSERT INTO runs VALUES (5)");
  EXPECT_THAT(refusal_of(file("other.sqlite")), HasSubstr("not one of rhec's sweeps"));
  EXPECT_THAT(Sqlite(file("other.sqlite"))("SELECT a FROM runs"), ElementsAre("5"));
  std::ofstream(file("text")) << std::string(5000, 'x');
  EXPECT_THAT(refusal_of(file("text")), HasSubstr("is no SQLite database"));
  EXPECT_EQ(bytes_of(file("text")), std::string(5000, 'x'));
  Sqlite(file("empty.sqlite"))(
      fmt::format("CREATE TABLE other (a); PRAGMA application_id = {}; PRAGMA user_version = {}",
                  SweepStore::application_id, SweepStore::version));
  EXPECT_THAT(refusal_of(file("empty.sqlite")), HasSubstr("does not have the form that was expected"));
}

TEST_F(SweepStoreTest, RefusesADatabaseThatIsCutShort) {
  const std::string whole = bytes_of(filled(300));
  ASSERT_GT(whole.size(), 50000);
  for (const std::size_t left :
       {whole.size() - 1, whole.size() - 5000, whole.size() / 2, std::size_t{4096}, std::size_t{50}}) {
    std::ofstream(file("cut.sqlite"), std::ios::binary | std::ios::trunc) << whole.substr(0, left);
    EXPECT_THAT(refusal_of(file("cut.sqlite")), HasSubstr("is damaged or cut short")) << left;
    EXPECT_EQ(bytes_of(file("cut.sqlite")), whole.substr(0, left));
  }
}

TEST_F(SweepStoreTest, RefusesPlacesThatCannotBeWritten) {
  EXPECT_THAT(refusal_of("/proc/nobody/runs.sqlite"), HasSubstr("its folder cannot be made"));
  EXPECT_THAT(refusal_of("/proc/runs.sqlite"), HasSubstr("cannot be written"));
  EXPECT_THAT(refusal_of(file().parent_path()), HasSubstr("is a folder"));
  EXPECT_THROW(SweepStore(""), Error);
  std::ofstream(file("text")) << "x";
  EXPECT_THAT(refusal_of(file("text") / "runs.sqlite"), HasSubstr("its folder cannot be made"));
}

TEST_F(SweepStoreTest, RefusesAFileThatMayOnlyBeRead) {
  if (geteuid() == 0) GTEST_SKIP() << "root may write to every file";
  filled(2);
  fs::permissions(file(), fs::perms::owner_read);
  EXPECT_THAT(refusal_of(file()), HasSubstr("cannot be opened and written"));
}

}  // namespace sweep_store_test
}  // namespace rhec::sim
