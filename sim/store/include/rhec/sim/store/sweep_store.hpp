#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/sim/store/run_identity.hpp"

namespace rhec::sim {

/// What came of a run.
enum class RunStatus {
  completed,      ///< the end of the path was reached
  not_completed,  ///< the vehicle was lost or far too slow
  refused,        ///< its configuration is wrong: values that do not fit one another
  failed,         ///< it ended with an error that should not have been
};
RHEC_EXPORT std::string_view name_of(RunStatus status);

/// A run as it is kept. The texts are JSON, with the keys of summary.json (docs/results.md); they are empty where the
/// run was refused or failed.
struct SweepRow {
  RunIdentity identity;
  std::string configuration;  ///< canonical_text of the whole of it
  std::optional<int> seed;    ///< none where the configuration has none that can be read
  RunStatus status = RunStatus::failed;
  std::string reason;  ///< how the run ended, in words
  std::int64_t steps = 0, solves = 0, fallbacks = 0;
  double nees = std::numeric_limits<double>::quiet_NaN();
  std::string mae, rmse, mae_after_start, statuses;
  std::string solve_time_us;  ///< of this machine, like `seconds`; all else repeats itself
  double seconds = 0.0;       ///< that the run took
  bool has_summary() const noexcept { return !mae.empty(); }
};

/// The SQLite file that a sweep's runs go to; docs/sweep.md has its schema. It belongs to one store at a time: a second
/// one, of whatever process on this machine, is refused. Others may read it meanwhile.
///
/// All functions throw Error, naming the file and what to do: a file that is no database, is another program's or of
/// another version, is damaged or cut short, cannot be written, or is in use. What was there stays as it was.
class RHEC_EXPORT SweepStore {
 public:
  static constexpr int application_id = 0x72686563;  ///< "rhec"
  static constexpr int version = 1;                  ///< of the schema

  /// Opens the file, or makes it, with its folders. `program` is written beside each run, e.g. "rhec 0.1.0".
  explicit SweepStore(const std::filesystem::path& file, std::string program = {});
  ~SweepStore();
  SweepStore(const SweepStore&) = delete;
  SweepStore& operator=(const SweepStore&) = delete;

  const std::filesystem::path& file() const noexcept;
  std::int64_t count() const;
  /// What came of a run; none where the file does not have it.
  std::optional<RunStatus> find(const RunIdentity& identity) const;
  /// All rows or none are written, and are on the disk when this returns; those that are there already stay as they
  /// are. Waits for a minute where another program reads at that moment.
  void write(std::span<const SweepRow> rows);
  /// All runs, in the order of their identities.
  std::vector<SweepRow> rows() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace rhec::sim
