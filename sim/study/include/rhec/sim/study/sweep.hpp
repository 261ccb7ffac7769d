#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/store/run_identity.hpp"

namespace rhec::sim {

/// A grid of runs over the keys of a scenario; docs/sweep.md has the form of the file. Runs are counted from 0, in the
/// order of the blocks, where the last key of a block varies fastest. Values are made when they are asked for, so that
/// a grid may be as large as one likes.
class RHEC_EXPORT Sweep {
 public:
  /// Of a file. Throws Error, naming file, line and key, for whatever is wrong in its form: a key that is not known, a
  /// grid without runs, a range that does not reach its end, groups of unequal length, a key that undoes another,
  /// more than 10^15 runs. Scenarios that it names are read, too.
  static Sweep from_file(const std::filesystem::path& file);
  /// Of settings whose origin is a file, beside which scenarios are looked for.
  explicit Sweep(const Settings& description);

  const std::string& name() const noexcept { return name_; }
  std::int64_t count() const noexcept { return count_; }
  /// The same for two sweeps that were read from the same texts, and scenarios too.
  const RunIdentity& fingerprint() const noexcept { return fingerprint_; }

  /// The whole configuration of a run.
  Settings settings(std::int64_t run) const;
  /// What the grid gives a run, for people: "speed=4, blocking.kappa.size=2".
  std::string assignments(std::int64_t run) const;

  /// Throws Error, naming file, line and key, for a value that no run can have. Each listed value, and the first and
  /// last ones of each range, are tried with several of the others; nothing is simulated. Values that do not fit one
  /// another, though each fits others, are not found: such a run says so when its turn comes.
  void check_values(const Host& host) const;
  /// Of all runs, in their order. Throws Error naming two runs that are the same, if there are any.
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
  using Indices = std::vector<std::int64_t>;  // of the values, axis by axis

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
  void check_values(const Host& host, const Block& block) const;

  std::string name_;
  std::string scenario_;                   // of blocks that name none; empty: there is none
  Settings set_;                           // over each scenario
  std::filesystem::path folder_;           // of the file
  std::map<std::string, Settings> bases_;  // by the scenario's name in the sweep, with `set_` over them
  std::vector<Block> blocks_;
  std::int64_t count_ = 0;
  RunIdentity fingerprint_;
};

}  // namespace rhec::sim
