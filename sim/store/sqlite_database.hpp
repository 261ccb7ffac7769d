#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

// Of SQLite, which the .cpp alone includes.
struct sqlite3;
struct sqlite3_stmt;

namespace rhec::sim {

class SqliteStatement;

/// An open SQLite file. Errors are rhec::Error, with the file's name, SQLite's words and what to do.
class SqliteDatabase {
 public:
  enum class Access {
    write,  ///< opens the file, or makes an empty one
    read    ///< of a file that is there, which stays as it is
  };
  explicit SqliteDatabase(std::filesystem::path file, Access access = Access::write);

  const std::filesystem::path& file() const noexcept { return file_; }
  /// How long to wait for others that use the file [ms].
  void set_patience(int milliseconds);
  /// Statements without results, with semicolons between them.
  void execute(const std::string& statements);
  SqliteStatement prepare(std::string_view statement);
  /// The one number that a query gives.
  std::int64_t number(std::string_view query);

  /// Throws Error unless `code` says that all is well.
  void require(int code) const;
  /// Throws Error where the file is shorter than its pages: SQLite itself does not miss a part of the last one.
  void require_whole();

 private:
  struct Close {
    void operator()(sqlite3* database) const noexcept;
  };
  std::filesystem::path file_;
  std::unique_ptr<sqlite3, Close> database_;
};

/// A prepared statement of a database, which must outlive it. Places and columns are counted as SQLite does: places
/// from 1, columns from 0.
class SqliteStatement {
 public:
  SqliteStatement(SqliteDatabase& database, sqlite3_stmt* statement) : database_(&database), statement_(statement) {}

  void bind(int place, std::int64_t value);
  /// NaN becomes NULL.
  void bind(int place, double value);
  void bind(int place, std::string_view text);
  void bind_null(int place);

  /// Goes on to the next row; false where there is none.
  bool step();
  /// Makes it ready to be stepped anew.
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

/// A transaction that is undone unless it is committed.
class SqliteTransaction {
 public:
  /// Begins it, with the right to write.
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
