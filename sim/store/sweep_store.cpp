#include "rhec/sim/store/sweep_store.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <system_error>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "sqlite_database.hpp"

namespace rhec::sim {
namespace fs = std::filesystem;
namespace {

constexpr std::array status_names = {std::pair{RunStatus::completed, "completed"},
                                     std::pair{RunStatus::not_completed, "not completed"},
                                     std::pair{RunStatus::refused, "refused"}, std::pair{RunStatus::failed, "failed"}};

constexpr const char* schema = R"(
CREATE TABLE runs (
  identity        TEXT PRIMARY KEY NOT NULL,
  configuration   TEXT NOT NULL,
  seed            INTEGER,
  status          TEXT NOT NULL CHECK (status IN ('completed', 'not completed', 'refused', 'failed')),
  reason          TEXT NOT NULL,
  steps           INTEGER,
  solves          INTEGER,
  fallbacks       INTEGER,
  nees            REAL,
  mae             TEXT,
  rmse            TEXT,
  mae_after_start TEXT,
  statuses        TEXT,
  solve_time_us   TEXT,
  seconds         REAL NOT NULL,
  finished        TEXT NOT NULL,
  program         TEXT NOT NULL
);
)";
constexpr const char* columns =
    "identity, configuration, seed, status, reason, steps, solves, fallbacks, nees, mae, rmse, mae_after_start, "
    "statuses, solve_time_us, seconds";

constexpr int start_patience = 1000, write_patience = 60000;  // [ms]

}  // namespace

/// A lock that ends with the process, however it ends. It is a separate file next to the database, since SQLite locks
/// the database itself.
class LockFile {
 public:
  explicit LockFile(const fs::path& database) : path_(database) {
    path_ += ".lock";
    // The owner deletes the file when done, so a lock is valid only if the path still refers to the locked file.
    do {
      close_file();
      descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
      if (descriptor_ < 0) refuse(database);
      if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
        const int reason = errno;
        close_file();
        errno = reason;
        if (reason != EWOULDBLOCK) refuse(database);
        throw Error(fmt::format("{}: another sweep writes to it; wait until that has finished, or choose another file",
                                database.string()));
      }
    } while (!is_current());
  }
  ~LockFile() {
    ::unlink(path_.c_str());
    close_file();
  }
  LockFile(const LockFile&) = delete;
  LockFile& operator=(const LockFile&) = delete;

 private:
  [[noreturn]] void refuse(const fs::path& database) const {
    const std::string reason = std::generic_category().message(errno);
    throw Error(
        fmt::format("{}: cannot be written, since {} beside it cannot be made ({}); choose another file, or mend the "
                    "permissions of its folder",
                    database.string(), path_.filename().string(), reason));
  }
  bool is_current() const noexcept {
    struct stat ours {};
    struct stat named {};
    return ::fstat(descriptor_, &ours) == 0 && ::stat(path_.c_str(), &named) == 0 && ours.st_ino == named.st_ino &&
           ours.st_dev == named.st_dev;
  }
  void close_file() noexcept {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
  }

  fs::path path_;
  int descriptor_ = -1;
};

namespace {

fs::path checked(const fs::path& file) {
  if (file.empty() || !file.has_filename())
    throw Error(
        fmt::format("database: '{}' is no name of a file; give the SQLite file that runs shall go to", file.string()));
  std::error_code failure;
  if (fs::is_directory(file, failure))
    throw Error(fmt::format("{}: is a folder; give the SQLite file that runs shall go to", file.string()));
  failure.clear();
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), failure);
  if (failure)
    throw Error(fmt::format("{}: its folder cannot be made ({}); choose another file, or mend the permissions",
                            file.string(), failure.message()));
  return file;
}

/// Creates the tables in an empty file; throws if the file is not ours.
void prepare_schema(SqliteDatabase& database) {
  SqliteTransaction all_or_nothing(database);
  const std::int64_t application = database.number("PRAGMA application_id"),
                     version = database.number("PRAGMA user_version"),
                     objects = database.number("SELECT count(*) FROM sqlite_schema");
  if (application == 0 && version == 0 && objects == 0) {
    database.execute(schema);
    database.execute(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}", SweepStore::application_id,
                                 SweepStore::version));
    all_or_nothing.commit();
    return;
  }
  if (application != SweepStore::application_id)
    throw Error(
        fmt::format("{}: is a database, but not one of rhec's sweeps; choose another file", database.file().string()));
  if (version != SweepStore::version)
    throw Error(
        fmt::format("{}: has version {} of the schema, and this program writes version {}; go on with the program that "
                    "made it, or choose another file",
                    database.file().string(), version, SweepStore::version));
}

RunStatus status_from(const std::string& text) {
  for (const auto& [status, name] : status_names)
    if (text == name) return status;
  return RunStatus::failed;
}

RunIdentity identity_from(const std::string& text) {
  RunIdentity identity;
  std::from_chars(text.data(), text.data() + std::min<std::size_t>(16, text.size()), identity.high, 16);
  if (text.size() > 16) std::from_chars(text.data() + 16, text.data() + text.size(), identity.low, 16);
  return identity;
}

}  // namespace

std::string_view name_of(RunStatus status) {
  for (const auto& [known, name] : status_names)
    if (known == status) return name;
  return {};
}

struct SweepStore::Parts {
  Parts(const fs::path& file, std::string program)
      : program_name(std::move(program)), lock(checked(file)), database(file) {
    database.set_patience(start_patience);
    prepare_schema(database);
    // A rollback journal instead of a write-ahead log, which needs shared memory: this also works on a disk shared by a
    // cluster's hosts. Each transaction is on disk when it ends.
    database.execute("PRAGMA journal_mode = TRUNCATE; PRAGMA synchronous = FULL");
    database.require_whole();
    database.set_patience(write_patience);
    insert.emplace(database.prepare(fmt::format(
        "INSERT INTO runs ({}, program, finished) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, "
        "?13, ?14, ?15, ?16, strftime('%Y-%m-%dT%H:%M:%SZ', 'now')) ON CONFLICT (identity) DO NOTHING",
        columns)));
    find.emplace(database.prepare("SELECT status FROM runs WHERE identity = ?1"));
  }

  std::string program_name;
  LockFile lock;  // locked before opening the database, released after closing it
  SqliteDatabase database;
  std::optional<SqliteStatement> insert, find;
};

SweepStore::SweepStore(const fs::path& file, std::string program)
    : parts_(std::make_unique<Parts>(file, std::move(program))) {}
SweepStore::~SweepStore() = default;

const fs::path& SweepStore::file() const noexcept { return parts_->database.file(); }

std::int64_t SweepStore::count() const { return parts_->database.number("SELECT count(*) FROM runs"); }

std::optional<RunStatus> SweepStore::find(const RunIdentity& identity) const {
  SqliteStatement& find = *parts_->find;
  find.bind(1, identity.text());
  std::optional<RunStatus> found;
  if (find.step()) found = status_from(find.text(0));
  find.reset();
  return found;
}

void SweepStore::write(std::span<const SweepRow> rows) {
  if (rows.empty()) return;
  SqliteTransaction all_or_nothing(parts_->database);
  SqliteStatement& insert = *parts_->insert;
  for (const SweepRow& row : rows) {
    insert.bind(1, row.identity.text());
    insert.bind(2, row.configuration);
    if (row.seed) {
      insert.bind(3, std::int64_t{*row.seed});
    } else {
      insert.bind_null(3);
    }
    insert.bind(4, name_of(row.status));
    insert.bind(5, row.reason);
    for (int place = 6; place <= 14; ++place) insert.bind_null(place);
    if (row.has_summary()) {
      insert.bind(6, row.steps);
      insert.bind(7, row.solves);
      insert.bind(8, row.fallbacks);
      insert.bind(9, row.nees);
      insert.bind(10, row.mae);
      insert.bind(11, row.rmse);
      insert.bind(12, row.mae_after_start);
      insert.bind(13, row.statuses);
      insert.bind(14, row.solve_time_us);
    }
    insert.bind(15, row.seconds);
    insert.bind(16, parts_->program_name);
    insert.step();
    insert.reset();
  }
  all_or_nothing.commit();
}

std::vector<SweepRow> SweepStore::rows() const {
  std::vector<SweepRow> rows;
  SqliteStatement select = parts_->database.prepare(fmt::format("SELECT {} FROM runs ORDER BY identity", columns));
  while (select.step()) {
    SweepRow& row = rows.emplace_back();
    row.identity = identity_from(select.text(0));
    row.configuration = select.text(1);
    if (!select.is_null(2)) row.seed = static_cast<int>(select.integer(2));
    row.status = status_from(select.text(3));
    row.reason = select.text(4);
    row.steps = select.integer(5);
    row.solves = select.integer(6);
    row.fallbacks = select.integer(7);
    if (!select.is_null(8)) row.nees = select.number(8);
    row.mae = select.text(9);
    row.rmse = select.text(10);
    row.mae_after_start = select.text(11);
    row.statuses = select.text(12);
    row.solve_time_us = select.text(13);
    row.seconds = select.number(14);
  }
  return rows;
}

}  // namespace rhec::sim
