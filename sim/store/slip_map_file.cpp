#include "rhec/sim/store/slip_map_file.hpp"

#include <algorithm>
#include <cmath>
#include <system_error>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "sqlite_database.hpp"

namespace rhec::sim {
namespace fs = std::filesystem;
namespace {

constexpr std::int64_t map_application = 0x72686d70;  // 'rhmp': how a map is told from other databases
constexpr std::int64_t map_version = 1;

constexpr const char* slip_map_schema = R"(
  CREATE TABLE about (vehicle TEXT NOT NULL, model TEXT NOT NULL, frame TEXT NOT NULL, origin_x REAL NOT NULL,
                      origin_y REAL NOT NULL, cell REAL NOT NULL);
  CREATE TABLE parameters (parameter INTEGER PRIMARY KEY, name TEXT NOT NULL, unit TEXT NOT NULL);
  CREATE TABLE cells (cell INTEGER PRIMARY KEY, x REAL NOT NULL, y REAL NOT NULL, time REAL NOT NULL,
                      visits INTEGER NOT NULL, observations INTEGER NOT NULL);
  CREATE TABLE slip (cell INTEGER NOT NULL REFERENCES cells, parameter INTEGER NOT NULL REFERENCES parameters,
                     mean REAL NOT NULL, variance REAL NOT NULL, PRIMARY KEY (cell, parameter)) WITHOUT ROWID;
)";

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(fmt::format("{}: {}", file.string(), what));
}

void require_map(SqliteDatabase& database) {
  const fs::path& file = database.file();
  if (database.number("PRAGMA application_id") != map_application)
    refuse(file, "is no map of slip; expected a file that estimator.memory.file or 'rhec map merge' has written");
  const std::int64_t found = database.number("PRAGMA user_version");
  if (found != map_version)
    refuse(file, fmt::format("is a map of version {}; expected version {}: use the rhec that wrote it, or drive anew",
                             found, map_version));
  database.require_whole();
  database.require_tables({"about", "parameters", "cells", "slip"});
}

}  // namespace

double SlipMapContent::newest() const noexcept {
  double time = 0.0;
  for (const SlipMap::Cell& each : cells) time = std::max(time, each.time);
  return time;
}

SlipMapContent read_slip_map(const fs::path& file) {
  std::error_code ignored;
  if (!fs::exists(file, ignored)) refuse(file, "there is no such file; expected a map of slip");
  if (fs::is_directory(file, ignored)) refuse(file, "is a folder; expected the file of a map of slip");
  SqliteDatabase database(file, SqliteDatabase::Access::read);
  require_map(database);
  SlipMapContent content;
  SqliteStatement about = database.prepare("SELECT vehicle, model, frame, origin_x, origin_y, cell FROM about");
  if (!about.step()) refuse(file, "does not say whose map it is; take a copy of it that is whole");
  MapIdentity& identity = content.identity;
  identity.vehicle = about.text(0);
  identity.model = about.text(1);
  identity.frame = about.text(2);
  identity.origin_x = about.number(3);
  identity.origin_y = about.number(4);
  content.cell = about.number(5);
  if (!(content.cell > 0.0) || !std::isfinite(identity.origin_x) || !std::isfinite(identity.origin_y))
    refuse(file, "has a cell or an origin that is not a number; take a copy of it that is whole");
  SqliteStatement parameters = database.prepare("SELECT name, unit FROM parameters ORDER BY parameter");
  while (parameters.step()) {
    identity.parameters.push_back(parameters.text(0));
    identity.units.push_back(parameters.text(1));
  }
  const std::size_t count = identity.parameters.size();
  SqliteStatement cells = database.prepare("SELECT cell, x, y, time, visits, observations FROM cells ORDER BY cell");
  SqliteStatement slip = database.prepare("SELECT mean, variance FROM slip WHERE cell = ?1 ORDER BY parameter");
  while (cells.step()) {
    SlipMap::Cell& cell = content.cells.emplace_back();
    const std::int64_t number = cells.integer(0);
    cell.x = cells.number(1);
    cell.y = cells.number(2);
    cell.time = cells.number(3);
    cell.visits = cells.integer(4);
    cell.values = cells.integer(5);
    slip.bind(1, number);
    while (slip.step()) {
      cell.means.push_back(slip.number(0));
      cell.variances.push_back(slip.number(1));
    }
    slip.reset();
    const bool is_right =
        std::isfinite(cell.x) && std::isfinite(cell.y) && std::isfinite(cell.time) && cell.visits >= 1 &&
        cell.means.size() == count &&
        std::all_of(cell.means.begin(), cell.means.end(), [](double m) { return std::isfinite(m); }) &&
        std::all_of(cell.variances.begin(), cell.variances.end(), [](double v) { return v > 0.0 && std::isfinite(v); });
    if (!is_right)
      refuse(file, fmt::format("cell {} has a number that cannot be right; expected a place, a time, 1 visit or more, "
                               "and {} finite means with positive variances",
                               number, count));
  }
  return content;
}

void write_slip_map(const fs::path& file, const SlipMapContent& content) {
  if (!file.has_filename() || fs::is_directory(file))
    refuse(file, "is a folder; give the name of a file, such as field.sqlite");
  OutputFolder folder(file.has_parent_path() ? file.parent_path() : fs::path("."));
  {
    SqliteDatabase database(folder.file(file.filename().string()));
    database.execute(
        "PRAGMA journal_mode = OFF; PRAGMA synchronous = FULL");  // it is moved into place once it is whole
    database.execute(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}", map_application, map_version));
    SqliteTransaction all(database);
    database.execute(slip_map_schema);
    SqliteStatement about = database.prepare("INSERT INTO about VALUES (?1, ?2, ?3, ?4, ?5, ?6)");
    const MapIdentity& identity = content.identity;
    about.bind(1, identity.vehicle);
    about.bind(2, identity.model);
    about.bind(3, identity.frame);
    about.bind(4, identity.origin_x);
    about.bind(5, identity.origin_y);
    about.bind(6, content.cell);
    about.step();
    SqliteStatement parameter = database.prepare("INSERT INTO parameters VALUES (?1, ?2, ?3)");
    for (std::size_t j = 0; j < identity.parameters.size(); ++j) {
      parameter.bind(1, static_cast<std::int64_t>(j));
      parameter.bind(2, identity.parameters[j]);
      parameter.bind(3, identity.units[j]);
      parameter.step();
      parameter.reset();
    }
    SqliteStatement insert = database.prepare("INSERT INTO cells VALUES (?1, ?2, ?3, ?4, ?5, ?6)");
    SqliteStatement slip = database.prepare("INSERT INTO slip VALUES (?1, ?2, ?3, ?4)");
    std::int64_t number = 0;
    for (const SlipMap::Cell& cell : content.cells) {
      insert.bind(1, number);
      insert.bind(2, cell.x);
      insert.bind(3, cell.y);
      insert.bind(4, cell.time);
      insert.bind(5, cell.visits);
      insert.bind(6, cell.values);
      insert.step();
      insert.reset();
      for (std::size_t j = 0; j < cell.means.size(); ++j) {
        slip.bind(1, number);
        slip.bind(2, static_cast<std::int64_t>(j));
        slip.bind(3, cell.means[j]);
        slip.bind(4, cell.variances[j]);
        slip.step();
        slip.reset();
      }
      ++number;
    }
    all.commit();
  }
  folder.commit();
}

std::string why_not(const MapIdentity& map, const MapIdentity& wanted) {
  if (map.model != wanted.model)
    return fmt::format("is a map of the model '{}'; expected '{}'", map.model, wanted.model);
  if (map.vehicle != wanted.vehicle)
    return fmt::format("is a map of the vehicle '{}'; expected '{}' (estimator.memory.vehicle)", map.vehicle,
                       wanted.vehicle);
  if (map.parameters != wanted.parameters || map.units != wanted.units)
    return fmt::format("is a map of [{}]; expected [{}]", fmt::join(map.parameters, ", "),
                       fmt::join(wanted.parameters, ", "));
  if (map.frame != wanted.frame)
    return fmt::format("has coordinates in '{}'; expected '{}' (estimator.memory.frame)", map.frame, wanted.frame);
  return {};
}

void merge_slip_map(const SlipMapContent& content, const fs::path& file, const MapIdentity& identity, SlipMap& map) {
  if (const std::string reason = why_not(content.identity, identity); !reason.empty()) refuse(file, reason);
  if (content.cell != map.setup().cell)
    refuse(file,
           fmt::format("has cells of {} m; expected {} m (estimator.memory.cell)", content.cell, map.setup().cell));
  const std::int64_t dropped = map.dropped();
  for (SlipMap::Cell cell : content.cells) {
    cell.x += content.identity.origin_x - identity.origin_x;
    cell.y += content.identity.origin_y - identity.origin_y;
    map.merge(cell);
  }
  if (map.dropped() > dropped)
    refuse(file, fmt::format("has more cells than there is room for, {}; give estimator.memory.cells a larger number",
                             map.setup().capacity));
}

}  // namespace rhec::sim
