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

/// Outcome of a run.
enum class RunStatus {
  completed,      ///< the end of the path was reached
  not_completed,  ///< the vehicle was lost or far too slow
  refused,        ///< invalid configuration, e.g. inconsistent values
  failed,         ///< it ended with an unexpected error
};
RHEC_EXPORT std::string_view name_of(RunStatus status);

/// A stored run. The texts are JSON with the keys of summary.json (docs/results.md); they are empty if the run was
/// refused or failed.
struct SweepRow {
  RunIdentity identity;
  std::string configuration;  ///< canonical_text of the whole configuration
  std::optional<int> seed;    ///< none if the configuration has no readable seed
  RunStatus status = RunStatus::failed;
  std::string reason;  ///< how the run ended
  std::int64_t steps = 0, solves = 0, fallbacks = 0;
  double nees = std::numeric_limits<double>::quiet_NaN();
  std::string mae, rmse, mae_after_start, statuses;
  std::string solve_time_us;  ///< depends on the machine, like `seconds`; all else is reproducible
  double seconds = 0.0;       ///< duration of the run
  bool has_summary() const noexcept { return !mae.empty(); }
};

/// The SQLite file that stores a sweep's runs; docs/sweep.md has its schema. Only one store at a time may own it: a
/// second one, in any process on this machine, is refused. Others may read it concurrently.
///
/// All functions throw Error, naming the file and what to do, if the file is not a database, belongs to another program
/// or version, is damaged or truncated, cannot be written, or is in use. They leave its content unchanged.
class RHEC_EXPORT SweepStore {
 public:
  static constexpr int application_id = 0x72686563;  ///< "rhec"
  static constexpr int version = 1;                  ///< of the schema

  /// Opens the file, or creates it with its folders. `program` is stored with each run, e.g. "rhec 0.1.0".
  explicit SweepStore(const std::filesystem::path& file, std::string program = {});
  ~SweepStore();
  SweepStore(const SweepStore&) = delete;
  SweepStore& operator=(const SweepStore&) = delete;

  const std::filesystem::path& file() const noexcept;
  std::int64_t count() const;
  /// Outcome of a run; none if it is not in the file.
  std::optional<RunStatus> find(const RunIdentity& identity) const;
  /// Writes all rows or none; they are on disk when this returns. Existing rows are unchanged. Waits up to a minute
  /// while another program reads.
  void write(std::span<const SweepRow> rows);
  /// All runs, in the order of their identities.
  std::vector<SweepRow> rows() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace rhec::sim
