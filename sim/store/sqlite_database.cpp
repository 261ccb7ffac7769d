// The only translation unit that uses SQLite.
#include "sqlite_database.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <string_view>
#include <utility>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

constexpr int longest_value = 1 << 25;

/// The error and what to do about it.
std::string_view explained(int code) {
  switch (code & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return "is in use by another program; wait until that has finished, or end it, and start again";
    case SQLITE_NOTADB:
      return "is no SQLite database; choose another file, or move this one away";
    case SQLITE_CORRUPT:
      return "is damaged or cut short; take a copy of it that is whole, or save what is left with '.recover' of the "
             "program sqlite3, or move it away";
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_AUTH:
      return "cannot be opened and written; choose another file, or mend the permissions of this one and its folder";
    case SQLITE_FULL:
      return "the disk is full; make room and start again, since what was written before is still there";
    case SQLITE_IOERR:
      return "cannot be read or written; look whether the disk is full or broken, and start again";
    default:
      return "does not have the form that was expected; choose another file, or move this one away";
  }
}

}  // namespace

SqliteDatabase::SqliteDatabase(std::filesystem::path file, Access access) : file_(std::move(file)) {
  sqlite3* opened = nullptr;
  const int flags = access == Access::read ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  const int code = sqlite3_open_v2(file_.c_str(), &opened, flags, nullptr);
  database_.reset(opened);  // set even after an error, since it holds the error message
  require(code);
  sqlite3_extended_result_codes(opened, 1);
  // A file is data: nothing in it is to be run, and nothing in it is as long as SQLite allows.
  sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, longest_value);
  if (access == Access::write && sqlite3_db_readonly(opened, "main") == 1) require(SQLITE_READONLY);
}

void SqliteDatabase::set_patience(int milliseconds) { require(sqlite3_busy_timeout(database_.get(), milliseconds)); }

void SqliteDatabase::require(int code) const {
  if (code == SQLITE_OK) return;
  const std::string_view words = database_ && (sqlite3_errcode(database_.get()) & 0xff) == (code & 0xff)
                                     ? sqlite3_errmsg(database_.get())
                                     : sqlite3_errstr(code);
  throw Error(fmt::format("{}: {} ({})", file_.string(), explained(code), words));
}

void SqliteDatabase::require_whole() {
  const auto pages = static_cast<std::uintmax_t>(number("PRAGMA page_count") * number("PRAGMA page_size"));
  if (std::filesystem::file_size(file_) < pages) require(SQLITE_CORRUPT);
}

void SqliteDatabase::require_tables(std::initializer_list<std::string_view> names) {
  SqliteStatement find = prepare("SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = ?1");
  for (const std::string_view name : names) {
    find.bind(1, name);
    if (!find.step())
      throw Error(fmt::format("{}: has no table '{}'; take a copy of it that is whole", file_.string(), name));
    find.reset();
  }
}

void SqliteDatabase::execute(const std::string& statements) {
  require(sqlite3_exec(database_.get(), statements.c_str(), nullptr, nullptr, nullptr));
}

SqliteStatement SqliteDatabase::prepare(std::string_view statement) {
  sqlite3_stmt* prepared = nullptr;
  require(
      sqlite3_prepare_v3(database_.get(), statement.data(), static_cast<int>(statement.size()), 0, &prepared, nullptr));
  return {*this, prepared};
}

std::int64_t SqliteDatabase::number(std::string_view query) {
  SqliteStatement statement = prepare(query);
  return statement.step() ? statement.integer(0) : 0;
}

void SqliteDatabase::Close::operator()(sqlite3* database) const noexcept { sqlite3_close_v2(database); }
void SqliteStatement::Finalize::operator()(sqlite3_stmt* statement) const noexcept { sqlite3_finalize(statement); }

void SqliteStatement::bind(int place, std::int64_t value) {
  database_->require(sqlite3_bind_int64(statement_.get(), place, value));
}

void SqliteStatement::bind(int place, double value) {
  database_->require(sqlite3_bind_double(statement_.get(), place, value));
}

void SqliteStatement::bind_null(int place) { database_->require(sqlite3_bind_null(statement_.get(), place)); }

void SqliteStatement::bind(int place, std::string_view text) {
  database_->require(
      sqlite3_bind_text64(statement_.get(), place, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
}

bool SqliteStatement::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  database_->require(code);
  return false;
}

void SqliteStatement::reset() noexcept { sqlite3_reset(statement_.get()); }

bool SqliteStatement::is_null(int column) const { return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL; }

std::int64_t SqliteStatement::integer(int column) const { return sqlite3_column_int64(statement_.get(), column); }

double SqliteStatement::number(int column) const { return sqlite3_column_double(statement_.get(), column); }

std::string SqliteStatement::text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
  return text ? std::string(text, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))) : "";
}

SqliteTransaction::~SqliteTransaction() {
  if (committed_) return;
  try {
    database_.execute("ROLLBACK");
  } catch (const Error&) {  // SQLite rolls back by itself after some errors; the original error is the relevant one
    return;
  }
}

void SqliteTransaction::commit() {
  database_.execute("COMMIT");
  committed_ = true;
}

}  // namespace rhec::sim
