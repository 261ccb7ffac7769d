#include "differences.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace rhec::sim {
namespace {

constexpr double not_known = std::numeric_limits<double>::quiet_NaN();
constexpr double most_scales = 10.0;                           // wider bounds do not count as typical values
constexpr double spacings[] = {2e-2, 2e-3, 2e-4, 2e-5, 2e-6};  // spacing of difference points, in scales

double& value_at(StagePoints& points, const ModelDescription& about, int stage, int entry) {
  const int nx = static_cast<int>(about.states.size()), nu = static_cast<int>(about.inputs.size()),
            np = static_cast<int>(about.parameters.size());
  if (entry < nx) return points.states[stage * nx + entry];
  if ((entry -= nx) < nu) return points.inputs[stage * nu + entry];
  if ((entry -= nu) < np) return points.parameters[stage * np + entry];
  return points.parameters_end[stage * np + entry - np];
}

/// Reference for a column of given derivatives.
struct Differences {
  std::vector<double> slope;   ///< for the distance that agrees best; NaN if none is finite
  std::vector<double> excess;  ///< its deviation from `given` beyond rounding error
};

/// Five-point difference with respect to `entry` of the results of `evaluate` at the stages (`size` values each).
Differences differences(const StagePoints& stages, const ModelDescription& about, int entry, double step, int size,
                        const std::vector<double>& given, const ValuesOfStages& evaluate) {
  const std::size_t count = static_cast<std::size_t>(stages.count) * size;
  Differences best{std::vector<double>(count, not_known),
                   std::vector<double>(count, std::numeric_limits<double>::infinity())};
  StagePoints moved = stages;
  std::vector<double> start(stages.count);
  for (int i = 0; i < stages.count; ++i) start[i] = value_at(moved, about, i, entry);
  for (const double distance : spacings) {
    const double h = distance * step;
    std::vector<double> slope(count, 0.0), largest(count, 0.0);
    for (const auto& [steps, weight] : {std::pair{-2, 1.0}, {-1, -8.0}, {1, 8.0}, {2, -1.0}}) {
      for (int i = 0; i < stages.count; ++i) value_at(moved, about, i, entry) = start[i] + steps * h;
      const std::vector<double> values = evaluate(moved);
      for (std::size_t k = 0; k < count; ++k) {
        slope[k] += weight * values[k] / (12.0 * h);
        largest[k] = std::max(largest[k], std::abs(values[k]));
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      const double rounding = 8.0 * std::numeric_limits<double>::epsilon() * largest[k] / h;
      const double excess = std::max(0.0, std::abs(given[k] - slope[k]) - rounding);
      if (!(excess < best.excess[k])) continue;  // also skips NaN
      best.excess[k] = excess;
      best.slope[k] = slope[k];
    }
  }
  return best;
}

/// Collects entries and finds the worst in `finish`, once the magnitudes that errors are relative to are known.
class Worst {
 public:
  explicit Worst(int results) : largest_(results, 0.0) {}

  void show(int result, double factor, double given, double slope, double excess, std::string where) {
    if (!std::isfinite(given) || !std::isfinite(slope)) {
      ++skipped_;
      return;
    }
    ++compared_;
    const double size = std::abs(given) * factor;
    largest_[result] = std::max(largest_[result], size);
    if (excess > 0.0) candidates_.push_back({result, excess * factor, size, {0.0, std::move(where), given, slope}});
  }
  void finish(WorstEntry& into, DerivativeErrors& all) {
    for (Candidate& each : candidates_) {
      const double floor = std::clamp(largest_[each.result], 1e-3, 1.0);
      each.entry.error = each.excess / std::max(floor, each.size);
      if (each.entry.error > into.error) into = std::move(each.entry);
    }
    all.compared += compared_;
    all.skipped += skipped_;
  }

 private:
  struct Candidate {
    int result;
    double excess, size;
    WorstEntry entry;
  };
  std::vector<double> largest_;
  std::vector<Candidate> candidates_;
  int compared_ = 0, skipped_ = 0;
};

}  // namespace

std::pair<double, double> typical_range(const Variable& variable) {
  const auto [lower, upper] = range_of(variable, 1.0);
  const double low = std::max(lower, -most_scales * variable.scale);
  const double high = std::min(upper, most_scales * variable.scale);
  return low < high ? std::pair(low, high) : std::pair(lower, upper);
}

void append_entries(std::vector<DifferenceEntry>& entries, const std::vector<Variable>& variables, const char* suffix) {
  for (const Variable& variable : variables) {
    const auto [lower, upper] = typical_range(variable);
    const double half = 0.5 * (upper - lower);
    entries.push_back(
        {variable.name + suffix, variable.scale, half > 0.0 ? std::min(variable.scale, half) : variable.scale});
  }
}

void compare_first_derivatives(const StagePoints& stages, const ModelDescription& about,
                               const std::vector<DifferenceEntry>& entries, const DifferenceResults& results,
                               const ValuesOfStages& values, const ValuesOfStages& jacobians, WorstEntry& into,
                               DerivativeErrors& all) {
  const int rows = static_cast<int>(results.variables->size()), columns = static_cast<int>(entries.size());
  const std::vector<double> given = jacobians(stages);
  Worst worst(rows);
  std::vector<double> column(static_cast<std::size_t>(stages.count) * rows);
  for (int j = 0; j < columns; ++j) {
    for (int i = 0; i < stages.count; ++i)
      for (int r = 0; r < rows; ++r) column[i * rows + r] = given[(i * columns + j) * rows + r];
    const Differences found = differences(stages, about, j, entries[j].step, rows, column, values);
    for (int i = 0; i < stages.count; ++i)
      for (int r = 0; r < rows; ++r) {
        const Variable& result = (*results.variables)[r];
        worst.show(r, entries[j].scale / result.scale, column[i * rows + r], found.slope[i * rows + r],
                   found.excess[i * rows + r],
                   fmt::format("d {}{} / d {}", results.prefix, result.name, entries[j].name));
      }
  }
  worst.finish(into, all);
}

void compare_second_derivatives(const StagePoints& stages, const ModelDescription& about,
                                const std::vector<DifferenceEntry>& entries, const DifferenceResults& results,
                                const ValuesOfStages& jacobians, const WeightedOfStages& hessians, WorstEntry& into,
                                DerivativeErrors& all) {
  const int rows = static_cast<int>(results.variables->size()), n = static_cast<int>(entries.size());
  const auto squares = static_cast<std::size_t>(stages.count) * n * n;
  std::vector<std::vector<double>> given;
  std::vector<double> multipliers(static_cast<std::size_t>(stages.count) * rows, 0.0);
  std::vector<double> sum(squares, 0.0), size(squares, 0.0);
  const auto weight = [&](int r) { return (r % 2 == 0 ? 1.0 : -0.5) / (*results.variables)[r].scale; };
  for (int r = 0; r < rows; ++r) {
    std::fill(multipliers.begin(), multipliers.end(), 0.0);
    for (int i = 0; i < stages.count; ++i) multipliers[i * rows + r] = 1.0;
    given.push_back(hessians(stages, multipliers));
    for (std::size_t k = 0; k < squares; ++k) {
      sum[k] += weight(r) * given[r][k];
      size[k] += std::abs(weight(r) * given[r][k]);
    }
  }
  Worst worst(rows);
  const int per_stage = rows * n;
  std::vector<double> column(static_cast<std::size_t>(stages.count) * per_stage);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < stages.count; ++i)
      for (int m = 0; m < n; ++m)
        for (int r = 0; r < rows; ++r) column[i * per_stage + m * rows + r] = given[r][(i * n + j) * n + m];
    const Differences found = differences(stages, about, j, entries[j].step, per_stage, column, jacobians);
    for (int i = 0; i < stages.count; ++i)
      for (int m = 0; m < n; ++m)
        for (int r = 0; r < rows; ++r) {
          const Variable& result = (*results.variables)[r];
          const int k = i * per_stage + m * rows + r;
          worst.show(r, entries[j].scale * entries[m].scale / result.scale, column[k], found.slope[k], found.excess[k],
                     fmt::format("d2 {}{} / d {} d {}", results.prefix, result.name, entries[m].name, entries[j].name));
        }
  }
  for (int i = 0; i < stages.count; ++i)
    for (int r = 0; r < rows; ++r) multipliers[i * rows + r] = weight(r);
  const std::vector<double> summed = rows > 0 ? hessians(stages, multipliers) : sum;
  for (int i = 0; i < stages.count; ++i)
    for (int j = 0; j < n; ++j)
      for (int m = 0; m < n; ++m) {
        const std::size_t k = (static_cast<std::size_t>(i) * n + j) * n + m;
        const double excess = std::max(0.0, std::abs(summed[k] - sum[k]) - 1e-13 * size[k]);
        worst.show(0, entries[j].scale * entries[m].scale, summed[k], sum[k], excess,
                   fmt::format("sum of multipliers times d2 {}... / d {} d {}", results.prefix, entries[m].name,
                               entries[j].name));
      }
  if (rows > 0) worst.finish(into, all);
}

}  // namespace rhec::sim
