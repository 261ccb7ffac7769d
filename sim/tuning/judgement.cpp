#include "judgement.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {
namespace {

constexpr int draws = 1000;
constexpr double tail = 0.025;

std::pair<double, double> interval_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(std::lround(share * static_cast<double>(values.size() - 1)))];
  };
  return {at(tail), at(1.0 - tail)};
}

}  // namespace

double median_of(std::vector<double> values) {
  const std::size_t half = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(half), values.end());
  if (values.size() % 2 == 1) return values[half];
  return 0.5 * (values[half] + *std::max_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(half)));
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double capped_rmse_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += std::min(value, error_cap) * std::min(value, error_cap);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

Compared compare(std::string name, std::string unit, const Pairs& pairs, const Statistic& statistic, double block) {
  std::vector<std::vector<std::size_t>> blocks;
  std::vector<double> before, after;
  double end = 0.0;
  for (std::size_t i = 0; i < pairs.times.size(); ++i) {
    if (std::isnan(pairs.before[i]) || std::isnan(pairs.after[i])) continue;
    if (blocks.empty() || pairs.times[i] >= end) {
      blocks.emplace_back();
      end = pairs.times[i] + block;
    }
    blocks.back().push_back(i);
    before.push_back(pairs.before[i]);
    after.push_back(pairs.after[i]);
  }
  Compared result;
  result.name = std::move(name);
  result.unit = std::move(unit);
  if (blocks.empty()) return result;
  result.before = statistic(before);
  result.after = statistic(after);
  std::vector<double> all_before, all_after, changes;
  RandomStream random(1, "block bootstrap");
  for (int draw = 0; draw < draws; ++draw) {
    before.clear();
    after.clear();
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      for (const std::size_t i :
           blocks[static_cast<std::size_t>(random.uniform() * static_cast<double>(blocks.size()))]) {
        before.push_back(pairs.before[i]);
        after.push_back(pairs.after[i]);
      }
    }
    all_before.push_back(statistic(before));
    all_after.push_back(statistic(after));
    changes.push_back(all_after.back() - all_before.back());
  }
  result.before_interval = interval_of(std::move(all_before));
  result.after_interval = interval_of(std::move(all_after));
  result.change_interval = interval_of(std::move(changes));
  return result;
}

}  // namespace rhec::sim
