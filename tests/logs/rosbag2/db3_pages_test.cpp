#include "logs/rosbag2/db3_pages.hpp"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cstring>
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace db3_pages_test {

class Db3PagesTest : public FolderTest {
 protected:
  /// Rows 1, 2, ... whose data are so many bytes of their number.
  std::filesystem::path table(const std::vector<std::size_t>& sizes, const char* page_size) {
    sqlite3* database = nullptr;
    sqlite3_open(file("x.db3").c_str(), &database);
    sqlite3_exec(database, (std::string("PRAGMA page_size=") + page_size).c_str(), nullptr, nullptr, nullptr);
    sqlite3_exec(database,
                 "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, n INTEGER, data BLOB); INSERT INTO topics "
                 "VALUES(1, '/a', 2, x'00');"
                 "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB); BEGIN",
                 nullptr, nullptr, nullptr);
    sqlite3_stmt* insert = nullptr;
    sqlite3_prepare_v2(database, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1, &insert,
                       nullptr);
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const std::string data(sizes[i], static_cast<char>(i));
      sqlite3_bind_int64(insert, 1, static_cast<std::int64_t>(i % 300));
      sqlite3_bind_int64(insert, 2, -1700000000000000000 + static_cast<std::int64_t>(i));
      sqlite3_bind_blob(insert, 3, data.data(), static_cast<int>(data.size()), SQLITE_TRANSIENT);
      sqlite3_step(insert);
      sqlite3_reset(insert);
    }
    sqlite3_finalize(insert);
    sqlite3_exec(database, "COMMIT", nullptr, nullptr, nullptr);
    sqlite3_close(database);
    return file("x.db3");
  }
};

TEST_F(Db3PagesTest, FindsAllRowsWithoutTheTree) {
  std::vector<std::size_t> sizes;
  for (std::size_t i = 0; i < 3000; ++i) sizes.push_back(i % 100 == 7 ? 20000 + 13 * i : i % 97);
  for (const char* page_size : {"512", "4096", "65536"}) {
    std::filesystem::remove(file("x.db3"));
    std::size_t count = 0;
    Db3Pages(table(sizes, page_size)).read(0, [&](const Db3Row& row) {
      EXPECT_EQ(row.id, static_cast<std::int64_t>(count) + 1);
      EXPECT_EQ(row.topic_id, static_cast<std::int64_t>(count % 300));
      EXPECT_EQ(row.timestamp, -1700000000000000000 + static_cast<std::int64_t>(count));
      EXPECT_EQ(row.data.size(), sizes[count]);
      for (const std::byte each : row.data) EXPECT_EQ(each, static_cast<std::byte>(count));
      ++count;
      return !HasFailure();
    });
    EXPECT_EQ(count, sizes.size()) << page_size;
  }
}

TEST_F(Db3PagesTest, BeginsBehindARowAndEndsWhereItIsTold) {
  std::vector<std::int64_t> ids;
  Db3Pages(table(std::vector<std::size_t>(500, 30), "1024")).read(100, [&](const Db3Row& row) {
    ids.push_back(row.id);
    return ids.size() < 50;
  });
  ASSERT_EQ(ids.size(), 50u);
  EXPECT_EQ(ids.front(), 101);
  EXPECT_EQ(ids.back(), 150);
}

TEST_F(Db3PagesTest, DamagedPagesAreNoHarm) {
  std::string whole = content_of(table(std::vector<std::size_t>(2000, 60), "1024"));
  std::uint32_t noise = 1;
  for (int round = 0; round < 300; ++round) {
    std::string content = whole;
    for (int k = 0; k < 20; ++k) {
      noise = noise * 1664525u + 1013904223u;
      content[noise % content.size()] = static_cast<char>(noise >> 24);
    }
    std::int64_t last = 0, count = 0;
    Db3Pages(put("y.db3", content)).read(0, [&](const Db3Row& row) {
      EXPECT_GT(row.id, last);
      last = row.id;
      return ++count < 100000;
    });
    EXPECT_LE(count, 2100);
  }
}

/// Chains that lead in circles make no more data than the file has.
TEST_F(Db3PagesTest, ChainsInCirclesEnd) {
  constexpr std::size_t page_size = 512, kept = 70;
  constexpr char leaf = 0x0D, interior = 0x05;
  std::string content = content_of(table({300, 20000, 20000, 300}, "512")).substr(0, kept * page_size);
  for (std::size_t number = 2; number <= kept; ++number) {
    char* const page = content.data() + (number - 1) * page_size;
    if (*page == leaf || *page == interior) continue;
    std::memset(page, 0, 3);
    page[3] = static_cast<char>(number);
  }
  std::size_t long_rows = 0, bytes = 0;
  Db3Pages(put("y.db3", content)).read(0, [&](const Db3Row& row) {
    long_rows += row.data.size() == 20000;
    bytes += row.data.size();
    return true;
  });
  EXPECT_EQ(long_rows, 1u) << "the second one is cut, and would need pages twice";
  EXPECT_LE(bytes, content.size());
}

}  // namespace db3_pages_test
}  // namespace rhec::logs
