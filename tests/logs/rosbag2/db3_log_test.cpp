#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "logs/support/rows.hpp"
#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/logs/rosbag2/rosbag2.hpp"
#include "rhec/logs/storage/compression.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace db3_log_test {

using testing::HasSubstr;

class Db3LogTest : public FolderTest {
 protected:
  /// A bag as ROS 2 Humble writes it: no definitions.
  std::filesystem::path bag(int count, bool is_compressed = false, const std::string& type = "std_msgs/msg/Float64") {
    sqlite3* database = nullptr;
    sqlite3_open(file("x.db3").c_str(), &database);
    sqlite3_exec(
        database,
        ("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, "
         "offered_qos_profiles TEXT); CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp "
         "INTEGER, data BLOB); INSERT INTO topics VALUES(3, '/a', '" +
         type + "', 'cdr', '')")
            .c_str(),
        nullptr, nullptr, nullptr);
    sqlite3_exec(database, "BEGIN", nullptr, nullptr, nullptr);
    sqlite3_stmt* insert = nullptr;
    sqlite3_prepare_v2(database, "INSERT INTO messages(topic_id, timestamp, data) VALUES(3, ?, ?)", -1, &insert,
                       nullptr);
    for (int i = 0; i < count; ++i) {
      CdrWriter message;
      message.f64(i);
      std::vector<std::byte> data(message.bytes().begin(), message.bytes().end());
      if (is_compressed) compress_zstd(message.bytes(), data);
      sqlite3_bind_int64(insert, 1, std::int64_t{1000000000} * i);
      sqlite3_bind_blob(insert, 2, data.data(), static_cast<int>(data.size()), SQLITE_TRANSIENT);
      sqlite3_step(insert);
      sqlite3_reset(insert);
    }
    sqlite3_finalize(insert);
    sqlite3_exec(database, "COMMIT", nullptr, nullptr, nullptr);
    sqlite3_close(database);
    return file("x.db3");
  }
};

TEST_F(Db3LogTest, ReadsMessagesWhoseTypeIsBuiltIn) {
  const Rows rows = rows_of(*open_db3(bag(10)), "/a", {{"data"}});
  ASSERT_EQ(rows.values.size(), 10u);
  EXPECT_EQ(rows.values[7][0], 7.0);
  EXPECT_EQ(rows.received[7], 7000000000);
}

TEST_F(Db3LogTest, ReadsMessagesThatAreCompressedOneByOne) {
  EXPECT_EQ(rows_of(*open_db3(bag(10, true)), "/a", {{"data"}}).values[9][0], 9.0);
}

TEST_F(Db3LogTest, OtherTypesAreDefinedByFolders) {
  const auto speeds = bag(3, false, "mine/msg/Speed");
  EXPECT_THAT(error_of([&] { rows_of(*open_db3(speeds), "/a", {{"speed"}}); }), HasSubstr("--msg-path"));
  put("msgs/mine/msg/Speed.msg", "float64 speed\n");
  EXPECT_EQ(rows_of(*open_db3(speeds, {{file("msgs")}}), "/a", {{"speed"}}).values.size(), 3u);
  EXPECT_THAT(error_of([&] { open_db3(speeds, {{file("gone")}}); }), HasSubstr("found no folder"));
}

TEST_F(Db3LogTest, ACutBagGivesWhatIsBeforeTheCut) {
  const std::string whole = content_of(bag(5000));
  const Rows rows = rows_of(*open_db3(put("y.db3", whole.substr(0, whole.size() / 2))), "/a", {{"data"}});
  ASSERT_TRUE(rows.damage);
  EXPECT_THAT(rows.damage->what, testing::AllOf(HasSubstr("y.db3: behind message"), HasSubstr(".recover")));
  EXPECT_GT(rows.values.size(), 100u);
}

/// SQLite's tree leads to most of a bag of some megabytes by a page at its end.
TEST_F(Db3LogTest, OfACutBagPagesAreReadThatNothingLeadsToAnyMore) {
  const std::string whole = content_of(bag(60000));
  for (const double share : {0.3, 0.41234, 0.51317, 0.6, 0.77777, 0.9}) {
    const auto size = static_cast<std::size_t>(share * static_cast<double>(whole.size()));
    const Rows rows = rows_of(*open_db3(put("y.db3", whole.substr(0, size))), "/a", {{"data"}});
    ASSERT_TRUE(rows.damage);
    EXPECT_GT(static_cast<double>(rows.values.size()), (share - 0.01) * 60000.0);
    for (std::size_t i = 0; i < rows.values.size(); ++i) ASSERT_EQ(rows.values[i][0], static_cast<double>(i));
  }
}

/// A recorder that is killed leaves a journal, by which SQLite would undo what was written last.
TEST_F(Db3LogTest, ABagWhoseRecorderWasKilledIsRead) {
  const auto open_bag = bag(5000);
  sqlite3* database = nullptr;
  sqlite3_open(open_bag.c_str(), &database);
  sqlite3_exec(database, "PRAGMA cache_size=10; BEGIN; UPDATE messages SET timestamp = timestamp + 1", nullptr, nullptr,
               nullptr);
  const std::filesystem::path killed = file("killed # 1?.db3");
  std::filesystem::copy_file(open_bag, killed);
  std::filesystem::copy_file(open_bag.string() + "-journal", killed.string() + "-journal");
  sqlite3_close(database);
  const Rows rows = rows_of(*open_db3(killed), "/a", {{"data"}});
  EXPECT_EQ(rows.values.size(), 5000u);
  ASSERT_TRUE(rows.damage);
  EXPECT_THAT(rows.damage->what, HasSubstr("was ended while it wrote, as killed # 1?.db3-journal shows"));
}

TEST_F(Db3LogTest, RefusesDatabasesThatAreNoBags) {
  sqlite3* database = nullptr;
  sqlite3_open(file("z.db3").c_str(), &database);
  sqlite3_exec(database, "CREATE TABLE topics(id); CREATE VIEW messages AS SELECT * FROM topics", nullptr, nullptr,
               nullptr);
  sqlite3_close(database);
  EXPECT_THAT(error_of([&] { open_db3(file("z.db3")); }), HasSubstr("without the tables 'topics' and 'messages'"));
  EXPECT_THAT(error_of([&] { open_db3(put("w.db3", "SQLite format 3, but no more")); }), HasSubstr("w.db3"));
}

}  // namespace db3_log_test
}  // namespace rhec::logs
