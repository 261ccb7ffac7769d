#include "sim/store/sqlite_database.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <string>

#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace sqlite_database_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

class SqliteDatabaseTest : public FolderTest {
 protected:
  std::filesystem::path path() const { return file("some.sqlite"); }
};

TEST_F(SqliteDatabaseTest, KeepsValuesOfEveryKind) {
  SqliteDatabase database(path());
  database.execute("CREATE TABLE all_kinds (a, b, c, d, e)");
  SqliteStatement insert = database.prepare("INSERT INTO all_kinds VALUES (?1, ?2, ?3, ?4, ?5)");
  for (const double value : {0.1, std::numeric_limits<double>::quiet_NaN()}) {
    insert.bind(1, std::int64_t{1} << 40);
    insert.bind(2, value);
    insert.bind(3, std::string_view("a 'text' with a \0 in it", 23));
    insert.bind(4, "");
    insert.bind_null(5);
    EXPECT_FALSE(insert.step());
    insert.reset();
  }
  EXPECT_EQ(database.number("SELECT count(*) FROM all_kinds"), 2);
  EXPECT_EQ(database.number("SELECT a FROM all_kinds WHERE a < 0"), 0) << "no row";
  SqliteStatement select = database.prepare("SELECT a, b, c, d, e FROM all_kinds ORDER BY rowid");
  ASSERT_TRUE(select.step());
  EXPECT_EQ(select.integer(0), std::int64_t{1} << 40);
  EXPECT_EQ(select.number(1), 0.1);
  EXPECT_EQ(select.text(2), std::string("a 'text' with a \0 in it", 23));
  EXPECT_EQ(select.text(3), "");
  EXPECT_FALSE(select.is_null(3));
  EXPECT_TRUE(select.is_null(4));
  ASSERT_TRUE(select.step());
  EXPECT_TRUE(select.is_null(1)) << "NaN is no value";
  EXPECT_FALSE(select.step());
}

TEST_F(SqliteDatabaseTest, ATransactionIsUndoneUnlessItIsCommitted) {
  SqliteDatabase database(path());
  database.execute("CREATE TABLE t (a)");
  {
    const SqliteTransaction given_up(database);
    database.execute("INSERT INTO t VALUES (1)");
    EXPECT_EQ(database.number("SELECT count(*) FROM t"), 1);
  }
  EXPECT_EQ(database.number("SELECT count(*) FROM t"), 0);
  {
    SqliteTransaction kept(database);
    database.execute("INSERT INTO t VALUES (1); INSERT INTO t VALUES (2)");
    kept.commit();
  }
  EXPECT_EQ(SqliteDatabase(path(), SqliteDatabase::Access::read).number("SELECT count(*) FROM t"), 2);
}

TEST_F(SqliteDatabaseTest, OneThatIsReadStaysAsItIs) {
  EXPECT_THAT(error_of([&] { SqliteDatabase(path(), SqliteDatabase::Access::read); }),
              StartsWith(path().string() + ": cannot be opened"));
  EXPECT_FALSE(std::filesystem::exists(path()));
  SqliteDatabase(path()).execute("CREATE TABLE t (a)");
  const std::string before = content_of(path());
  SqliteDatabase database(path(), SqliteDatabase::Access::read);
  EXPECT_THAT(error_of([&] { database.execute("INSERT INTO t VALUES (1)"); }), HasSubstr("readonly"));
  EXPECT_EQ(content_of(path()), before);
}

TEST_F(SqliteDatabaseTest, ErrorsNameTheFileAndHaveSqlitesWords) {
  SqliteDatabase database(path());
  EXPECT_THAT(error_of([&] { database.execute("CREATE nonsense"); }),
              AllOf(StartsWith(path().string() + ": "), HasSubstr("near \"nonsense\"")));
  EXPECT_THAT(error_of([&] { database.prepare("SELECT a FROM nowhere"); }), HasSubstr("no such table: nowhere"));
  database.execute("CREATE TABLE t (a UNIQUE); INSERT INTO t VALUES (1)");
  SqliteStatement again = database.prepare("INSERT INTO t VALUES (1)");
  EXPECT_THAT(error_of([&] { again.step(); }), HasSubstr("UNIQUE"));
}

TEST_F(SqliteDatabaseTest, OneThatIsInUseIsWaitedForAsLongAsAsked) {
  SqliteDatabase one(path()), other(path());
  one.execute("CREATE TABLE t (a)");
  const SqliteTransaction under_way(one);
  other.set_patience(1);
  EXPECT_THAT(error_of([&] { const SqliteTransaction second(other); }), HasSubstr("is in use by another program"));
}

TEST_F(SqliteDatabaseTest, MissesAPartOfTheLastPage) {
  SqliteDatabase(path()).execute("CREATE TABLE t (a); INSERT INTO t VALUES (zeroblob(20000))");
  SqliteDatabase(path(), SqliteDatabase::Access::read).require_whole();
  std::filesystem::resize_file(path(), std::filesystem::file_size(path()) - 1);
  EXPECT_THAT(error_of([&] { SqliteDatabase(path(), SqliteDatabase::Access::read).require_whole(); }),
              HasSubstr("is damaged or cut short"));
}

// A few bytes of a file may stand for more than there is memory.
TEST_F(SqliteDatabaseTest, AViewIsNoTableAndAValueNotEndless) {
  SqliteDatabase database(path());
  database.execute(
      "CREATE TABLE t (a); INSERT INTO t VALUES (1); ALTER TABLE t ADD COLUMN b AS (zeroblob(400000000));"
      "CREATE VIEW v AS WITH RECURSIVE n(a) AS (SELECT 1 UNION ALL SELECT a + 1 FROM n) SELECT a FROM n");
  database.require_tables({"t"});
  EXPECT_THAT(error_of([&] {
                database.require_tables({"t", "v"});
              }),
              AllOf(StartsWith(path().string() + ": "), HasSubstr("has no table 'v'")));
  EXPECT_EQ(database.number("SELECT a FROM t"), 1);
  SqliteStatement endless = database.prepare("SELECT b FROM t");
  EXPECT_THAT(error_of([&] { endless.step(); }), HasSubstr("too big"));
}

}  // namespace sqlite_database_test
}  // namespace rhec::sim
