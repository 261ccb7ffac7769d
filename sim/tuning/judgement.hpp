#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/sim/tuning/log_tuning.hpp"

namespace rhec::sim {

/// Figures of the same measurements before and after; NaN where one of them has none.
struct Pairs {
  std::vector<double> times;  ///< [s], in order
  std::vector<double> before, after;
};
using Statistic = std::function<double(std::vector<double> values)>;
double median_of(std::vector<double> values);
double mean_of(const std::vector<double>& values);
/// Root mean square of values capped at `error_cap`.
double capped_rmse_of(const std::vector<double>& values);

/// A statistic of both with intervals of 95 %: blocks of the log, `block` seconds each, are drawn with replacement, for
/// both alike (block bootstrap; Kuensch, Annals of Statistics 17, 1989). Errors of fixes are alike for seconds.
Compared compare(std::string name, std::string unit, const Pairs& pairs, const Statistic& statistic, double block);

}  // namespace rhec::sim
