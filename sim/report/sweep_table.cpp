#include "rhec/sim/report/sweep_table.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>

#include "rhec/sim/numbers/statistics.hpp"
#include "sweep_settings.hpp"

namespace rhec::sim {
namespace {

constexpr std::string_view error_prefix = "mae.";

/// What is shown of a value: texts without quotes.
std::string shown(const std::string& value) { return value == no_value ? "-" : plain_text(value); }

/// Of the measure with this index, over the seeds that were completed.
double mean_of(const RunGroup& group, std::size_t measure) {
  Moments moments;
  for (const SeedOutcome& outcome : group.outcomes)
    if (measure < outcome.values.size() && !std::isnan(outcome.values[measure])) moments.add(outcome.values[measure]);
  return moments.mean();
}

}  // namespace

SweepTable sweep_table(const SweepRuns& runs) {
  const SweepSettings settings(runs.groups);
  SweepTable table;
  table.keys.assign(settings.varies().begin(), settings.varies().end());
  std::vector<std::size_t> measures;
  for (std::size_t i = 0; i < runs.measures.size(); ++i) {
    if (!runs.measures[i].starts_with(error_prefix)) continue;
    measures.push_back(i);
    table.measures.push_back(runs.measures[i].substr(error_prefix.size()));
  }
  for (const RunGroup& group : runs.groups) {
    SweepTable::Row row;
    for (const std::string& key : table.keys) row.values.push_back(shown(value_of(group, key)));
    row.runs = std::ssize(group.outcomes);
    row.completed = std::count_if(group.outcomes.begin(), group.outcomes.end(),
                                  [](const SeedOutcome& outcome) { return !outcome.values.empty(); });
    for (const std::size_t measure : measures) row.means.push_back(mean_of(group, measure));
    table.rows.push_back(std::move(row));
  }
  const auto rank = [](const SweepTable::Row& row) {
    const double first = row.means.empty() ? 0.0 : row.means.front();
    return std::isnan(first) ? std::numeric_limits<double>::infinity() : first;
  };
  std::stable_sort(table.rows.begin(), table.rows.end(),
                   [&](const SweepTable::Row& a, const SweepTable::Row& b) { return rank(a) < rank(b); });
  return table;
}

}  // namespace rhec::sim
