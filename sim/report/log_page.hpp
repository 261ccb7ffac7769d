#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "report_parts.hpp"

namespace rhec::sim {

/// What the pages of recorded drives have in common: tables of estimates of several variants, with their windows.
class LogPage {
 public:
  LogPage(const std::filesystem::path& folder, const Json& summary);
  virtual ~LogPage() = default;
  LogPage(const LogPage&) = delete;
  LogPage& operator=(const LogPage&) = delete;
  Json document();

 protected:
  /// Positions as they were measured, and the gaps between them.
  virtual void fixes() = 0;
  virtual Json variant(std::size_t index) = 0;
  /// The rows of one variant in estimates.csv.
  struct Range {
    std::int64_t first = 0, end = 0;
  };
  /// Throws Error for windows of other variants, or with other measurements withheld, than estimates.csv is of.
  void require_same_log(const std::vector<std::size_t>& nodes) const;
  /// Throws Error for a row of a variant that summary.json does not have, or without any variant.
  void require_all_rows(std::int64_t row) const;
  void gaps_between(const std::vector<double>& times);
  std::vector<double> column(std::string_view name, const std::vector<std::int64_t>& rows) const;
  static Json flags(const std::vector<double>& values, const std::vector<std::size_t>& rows);
  Json time_key(const std::string& name, const std::vector<double>& times, const Thinned& thinned);
  /// The start of a variant's entry: settings, states, parameters, track.
  Json begin_variant(std::size_t index, const std::vector<std::int64_t>& rows, const std::vector<double>& times);
  void fallbacks(Json& about, const std::vector<std::int64_t>& rows, const std::vector<double>& times);
  /// Changes of a status, and how often there was which among samples with these times.
  void statuses(Json& about, std::size_t index, const std::vector<double>& times);
  void windows(Json& about, std::size_t index, std::size_t samples);
  Json histogram(const std::string& name);

  std::filesystem::path folder_;
  const Json& summary_;
  ResultTable table_;
  std::vector<std::pair<std::string, Range>> variants_;
  std::optional<HorizonFile> horizons_;
  std::optional<ResultTable> times_;
  std::vector<std::string> names_;  ///< of states and parameters
  std::size_t states_ = 0;          ///< number of states among them
  std::size_t most_ = most_rows;
  Json document_, notes_;
  std::string words_;

 private:
  void describe();
  /// Their measured values on each interval, at its start; the same for all variants with recorded windows.
  void inputs();
  Json series(const std::string& variant, const std::string& name, const std::vector<std::int64_t>& rows,
              const std::vector<double>& times);
  void track(Json& about, const std::string& name, const std::vector<std::int64_t>& rows,
             const std::vector<double>& times);
};

}  // namespace rhec::sim
