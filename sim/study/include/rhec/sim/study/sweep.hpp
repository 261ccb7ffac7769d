#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/store/run_identity.hpp"

namespace rhec::sim {

/// A grid of runs over the keys of a scenario; docs/sweep.md describes the file format. Runs are numbered from 0, in
/// the order of the blocks; the last key of a block varies fastest. Values are generated on demand, so a grid may be
/// arbitrarily large.
class RHEC_EXPORT Sweep {
 public:
  /// Reads a file and the scenarios that it names. Throws Error, naming file, line and key, for any error of form: an
  /// unknown key, a grid without runs, a range that does not reach its end, groups of unequal length, a key that
  /// overrides an earlier one, more than 10^15 runs.
  static Sweep from_file(const std::filesystem::path& file);
  /// From settings whose origin is a file; scenarios are looked up relative to that file.
  explicit Sweep(const Settings& description);

  const std::string& name() const noexcept { return name_; }
  std::int64_t count() const noexcept { return count_; }
  /// Equal for sweeps that were read from the same texts, scenarios included.
  const RunIdentity& fingerprint() const noexcept { return fingerprint_; }

  /// The whole configuration of a run.
  Settings settings(std::int64_t run) const;
  /// The grid's values for a run, for display: "speed=4, blocking.kappa.size=2".
  std::string assignments(std::int64_t run) const;

  /// Throws Error, naming file, line and key, for a value that is invalid in every run. Tries each listed value, and
  /// the first and last of each range, with several of the others; simulates nothing. Does not find combinations that
  /// are invalid although each value is valid in others; such a run reports it when it is made. `between`, called
  /// before each attempt, may throw to give up.
  void check_values(const Host& host, const std::function<void()>& between = {}) const;
  /// Identities of all runs, in order. Throws Error, naming both, if two runs are identical.
  std::vector<RunIdentity> identities() const;

 private:
  /// The values of one key: a list, or a range.
  struct Values {
    Settings at(std::int64_t index) const;
    std::int64_t count = 0;
    std::vector<Settings> listed;  // empty: a range
    long double from = 0.0L, to = 0.0L;
    Origin origin;  // of the range
  };
  /// A key, or several that vary together.
  struct Axis {
    std::vector<std::string> keys;
    std::vector<Values> values;  // of each key
    std::int64_t count = 0;
  };
  struct Block {
    std::vector<Axis> axes;
    std::int64_t first = 0, count = 0;
  };
  using Indices = std::vector<std::int64_t>;  // of the values, by axis

  static Values read_values(const Settings& from);
  static Values read_range(const Settings& from);
  static std::int64_t range_count(const Settings& from);
  void read_block(const Settings& from);
  Axis read_zip(const Settings& from) const;
  void add_axis(Block& block, Axis axis, const Settings& at) const;
  void read_scenarios(const Values& values);
  const Settings& base_of(const std::string& scenario) const;
  std::pair<const Block*, Indices> place_of(std::int64_t run) const;
  Settings settings_of(const Block& block, const Indices& indices) const;
  void check_values(const Host& host, const Block& block, const std::function<void()>& between) const;

  std::string name_;
  std::string scenario_;                   // default of blocks that name none; may be empty
  Settings set_;                           // overrides each scenario
  std::filesystem::path folder_;           // of the file
  std::map<std::string, Settings> bases_;  // by the scenario's name in the sweep, overridden by `set_`
  std::vector<Block> blocks_;
  std::int64_t count_ = 0;
  RunIdentity fingerprint_;
};

}  // namespace rhec::sim
