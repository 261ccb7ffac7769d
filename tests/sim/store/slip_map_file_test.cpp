#include "rhec/sim/store/slip_map_file.hpp"

#include <sqlite3.h>
#include <unistd.h>

#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace slip_map_file_test {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class SlipMapFileTest : public FolderTest {
 protected:
  fs::path file(const std::string& name = "field.sqlite") const { return folder_ / name; }

  static SlipMapContent content() {
    SlipMapContent content;
    content.identity = {"red one", "bicycle_slip", {"kappa", "mu"}, {"1", "1"}, "EPSG:25833", 4e5, 5.8e6};
    content.cell = 0.5;
    content.cells = {{1.1, -2.3, 10.0, 2, 7, {0.7, 0.9}, {1e-3, 2e-3}},
                     {3.1, 4.2, 20.5, 1, 1, {0.5, 1.0 / 3.0}, {0.1, 0.2}}};
    return content;
  }
  void execute(const std::string& statements) const {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(file().c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, statements.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
    sqlite3_close(database);
  }
  std::string reading() const {
    return error_of([this] { read_slip_map(file()); });
  }
};

TEST_F(SlipMapFileTest, ComesBackToTheLastBit) {
  write_slip_map(file(), content());
  const SlipMapContent read = read_slip_map(file()), written = content();
  EXPECT_EQ(read.identity.vehicle, "red one");
  EXPECT_EQ(read.identity.parameters, written.identity.parameters);
  EXPECT_EQ(read.identity.units, written.identity.units);
  EXPECT_EQ(read.identity.frame, "EPSG:25833");
  EXPECT_EQ(read.identity.origin_x, 4e5);
  EXPECT_EQ(read.newest(), 20.5);
  ASSERT_EQ(read.cells.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read.cells[i].x, written.cells[i].x);
    EXPECT_EQ(read.cells[i].y, written.cells[i].y);
    EXPECT_EQ(read.cells[i].time, written.cells[i].time);
    EXPECT_EQ(read.cells[i].visits, written.cells[i].visits);
    EXPECT_EQ(read.cells[i].values, written.cells[i].values);
    EXPECT_EQ(read.cells[i].means, written.cells[i].means);
    EXPECT_EQ(read.cells[i].variances, written.cells[i].variances);
  }
  // Written again it is replaced; nothing is left beside it.
  write_slip_map(file(), content());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 1);
}

TEST_F(SlipMapFileTest, RefusesWhatIsNoMap) {
  EXPECT_THAT(reading(), AllOf(HasSubstr(file().string()), HasSubstr("no such file")));
  std::ofstream(file())
      << "a letter to my aunt, which is long enough to be read as a database, but it is none at all\n";
  EXPECT_THAT(reading(), HasSubstr("no SQLite database"));
  fs::remove(file());
  execute("CREATE TABLE runs (x)");
  EXPECT_THAT(reading(), HasSubstr("no map of slip"));
  fs::remove(file());
  fs::create_directory(file());
  EXPECT_THAT(reading(), HasSubstr("folder"));
}

TEST_F(SlipMapFileTest, RefusesAnotherVersionAndWhatIsDamaged) {
  write_slip_map(file(), content());
  execute("PRAGMA user_version = 7");
  EXPECT_THAT(reading(), AllOf(HasSubstr("version 7"), HasSubstr("expected version 1")));
  write_slip_map(file(), content());
  execute("UPDATE slip SET variance = -1.0 WHERE cell = 1");
  EXPECT_THAT(reading(), HasSubstr("cell 1"));
  write_slip_map(file(), content());
  execute("DELETE FROM slip WHERE cell = 0 AND parameter = 1");
  EXPECT_THAT(reading(), HasSubstr("cell 0"));
  write_slip_map(file(), content());
  execute("DELETE FROM about");
  EXPECT_THAT(reading(), HasSubstr("whose map"));
  write_slip_map(file(), content());
  execute(
      "DROP TABLE cells; CREATE VIEW cells AS WITH RECURSIVE n(cell) AS (SELECT 1 UNION ALL SELECT cell + 1 FROM n) "
      "SELECT cell, 1.0 AS x, 1.0 AS y, 1.0 AS time, 1 AS visits, 1 AS observations FROM n");
  EXPECT_THAT(reading(), HasSubstr("has no table 'cells'"));
  write_slip_map(file(), content());
  fs::resize_file(file(), fs::file_size(file()) / 2);
  EXPECT_THAT(reading(), HasSubstr(file().string()));
}

TEST_F(SlipMapFileTest, KeepsWhatWasThereIfItCannotWrite) {
  write_slip_map(file(), content());
  EXPECT_THAT(error_of([this] { write_slip_map(file() / "map.sqlite", content()); }), HasSubstr("field.sqlite"));
  EXPECT_THAT(error_of([this] { write_slip_map(folder_.path(), content()); }), HasSubstr("is a folder"));
  EXPECT_EQ(read_slip_map(file()).cells.size(), 2U);
}

TEST_F(SlipMapFileTest, IsUsedByItsOwnVehicleInItsOwnFrameOnly) {
  const MapIdentity own = content().identity;
  EXPECT_EQ(why_not(own, own), "");
  MapIdentity other = own;
  other.model = "skid_steer";
  EXPECT_THAT(why_not(own, other), HasSubstr("skid_steer"));
  other = own;
  other.vehicle = "blue one";
  EXPECT_THAT(why_not(own, other), AllOf(HasSubstr("red one"), HasSubstr("blue one")));
  other = own;
  other.frame = "local";
  EXPECT_THAT(why_not(own, other), HasSubstr("local"));
  other = own;
  other.parameters = {"kappa"};
  EXPECT_THAT(why_not(own, other), HasSubstr("[kappa]"));
}

TEST_F(SlipMapFileTest, IsMovedToAnotherOrigin) {
  SlipMap map({.parameters = 2, .capacity = 10, .spread = {}, .ageing = {}});
  MapIdentity identity = content().identity;
  identity.origin_x += 100.0;
  merge_slip_map(content(), file(), identity, map);
  map.begin_drive(20.5);
  double means[2], variances[2];
  EXPECT_TRUE(map.look_up(1.1 - 100.0, -2.3, means, variances));
  EXPECT_DOUBLE_EQ(means[0], 0.7);
  SlipMap coarse({.parameters = 2, .cell = 1.0, .capacity = 10, .spread = {}, .ageing = {}});
  EXPECT_THAT(error_of([&] { merge_slip_map(content(), file(), identity, coarse); }), HasSubstr("cells of 0.5 m"));
  SlipMap small({.parameters = 2, .capacity = 1, .spread = {}, .ageing = {}});
  EXPECT_THAT(error_of([&] { merge_slip_map(content(), file(), identity, small); }),
              HasSubstr("estimator.memory.cells"));
}

}  // namespace slip_map_file_test
}  // namespace rhec::sim
