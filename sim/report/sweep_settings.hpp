#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rhec/sim/store/sweep_runs.hpp"

namespace rhec::sim {

/// The value of a missing key.
inline const std::string no_value = "null";

/// A key's value in one group as JSON; `no_value` if it is missing.
const std::string& value_of(const RunGroup& group, const std::string& key);
std::optional<double> number_in(const std::string& json);
/// Order: missing values, then numbers by size, then texts.
bool comes_before(const std::string& a, const std::string& b);
/// A JSON value as plain text.
std::string plain_text(const std::string& json);

/// Keys that vary together: the value of one determines those of the others.
struct VariedKey {
  std::string key;  ///< the representative key
  std::vector<std::string> all;
  std::vector<std::string> values;
  bool is_numeric() const;
};

/// Block length and overlap of the blocked parameters.
struct BlocksOfGroup {
  std::vector<std::string> parameters;
  std::string size, overlap;
};

/// Which keys the groups of a sweep differ in.
class SweepSettings {
 public:
  /// `groups` must outlive it.
  explicit SweepSettings(const std::vector<RunGroup>& groups);

  /// All keys that vary.
  const std::set<std::string>& varies() const noexcept { return varies_; }
  /// Varying keys without those of the blocking.
  const std::vector<VariedKey>& varied() const noexcept { return varied_; }
  std::vector<std::string> sorted_values(const std::string& key) const;

  /// Whether block length or overlap vary.
  bool is_of_blocking() const;
  std::optional<BlocksOfGroup> blocks_of(const RunGroup& group) const;
  /// All varying settings, except the blocking of the given parameters.
  std::string rest_of(const RunGroup& group, const std::vector<std::string>& blocked) const;
  /// "kappa and mu, neighbour_sigma 0.04"
  std::string blocked_words(const RunGroup& group, const std::vector<std::string>& blocked) const;

 private:
  void find_varied_keys();
  void find_parameters();

  const std::vector<RunGroup>& groups_;
  std::set<std::string> varies_;
  std::vector<VariedKey> varied_;
  std::vector<std::string> parameters_;  ///< that have a blocking
};

}  // namespace rhec::sim
