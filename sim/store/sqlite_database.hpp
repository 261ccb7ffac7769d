#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

// From SQLite, whose header only the .cpp includes.
struct sqlite3;
struct sqlite3_stmt;

namespace rhec::sim {

class SqliteStatement;

/// An open SQLite file. Errors are rhec::Error with the file's name, SQLite's message and what to do.
class SqliteDatabase {
 public:
  enum class Access {
    write,  ///< opens the file, or creates an empty one
    read    ///< opens an existing file without changing it
  };
  explicit SqliteDatabase(std::filesystem::path file, Access access = Access::write);

  const std::filesystem::path& file() const noexcept { return file_; }
  /// Sets how long to wait for others that use the file [ms].
  void set_patience(int milliseconds);
  /// Executes statements without results, separated by semicolons.
  void execute(const std::string& statements);
  SqliteStatement prepare(std::string_view statement);
  /// The single number that a query returns.
  std::int64_t number(std::string_view query);

  /// Throws Error unless `code` reports success.
  void require(int code) const;
  /// Throws Error if the file is shorter than its pages: SQLite itself does not notice a truncated last page.
  void require_whole();
  /// Throws Error if one of these is no table: a view may have rows without end.
  void require_tables(std::initializer_list<std::string_view> names);

 private:
  struct Close {
    void operator()(sqlite3* database) const noexcept;
  };
  std::filesystem::path file_;
  std::unique_ptr<sqlite3, Close> database_;
};

/// A prepared statement of a database, which must outlive it. Indices are those of SQLite: places from 1, columns from
/// 0.
class SqliteStatement {
 public:
  SqliteStatement(SqliteDatabase& database, sqlite3_stmt* statement) : database_(&database), statement_(statement) {}

  void bind(int place, std::int64_t value);
  /// NaN becomes NULL.
  void bind(int place, double value);
  void bind(int place, std::string_view text);
  void bind_null(int place);

  /// Advances to the next row; false if there is none.
  bool step();
  /// Resets the statement, so that it can be stepped again.
  void reset() noexcept;

  bool is_null(int column) const;
  std::int64_t integer(int column) const;
  double number(int column) const;
  std::string text(int column) const;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const noexcept;
  };
  SqliteDatabase* database_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

/// A transaction that is rolled back unless it is committed.
class SqliteTransaction {
 public:
  /// Begins a write transaction.
  explicit SqliteTransaction(SqliteDatabase& database) : database_(database) { database_.execute("BEGIN IMMEDIATE"); }
  ~SqliteTransaction();
  SqliteTransaction(const SqliteTransaction&) = delete;
  SqliteTransaction& operator=(const SqliteTransaction&) = delete;
  void commit();

 private:
  SqliteDatabase& database_;
  bool committed_ = false;
};

}  // namespace rhec::sim
