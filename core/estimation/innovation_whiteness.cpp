#include "innovation_whiteness.hpp"

#include <algorithm>
#include <cmath>

#include "innovation.hpp"
#include "rhec/core/base/infinity.hpp"

namespace rhec {
namespace {

// Slip that jumps makes innovations that are large, but few.
constexpr double most_normalised = 3.0;
// Variances are means over about so many innovations.
constexpr double whiteness_memory = 300.0;
// Sums that overlap know less than as many that do not; below so many lengths nothing.
constexpr double least_lengths = 4.0;

/// What a variance of sums is up to where they are no larger than expected, as far as is known: with Bartlett's window
/// over n values it has the variance 4/3 m / n (Priestley 1981). `relative`: the length of sums by n.
double usual_variance(double relative, double degrees) noexcept {
  return relative * least_lengths > 1.0 ? infinity : 1.0 + std::sqrt(4.0 / 3.0 * relative / degrees);
}

}  // namespace

void InnovationWhiteness::take(const Innovation& innovation, std::size_t values) noexcept {
  if (static_cast<std::size_t>(innovation.value.size()) != values) return;
  const Innovation::OfSensor<1> white = normalised(innovation.value, innovation.covariance);
  if (!white.allFinite()) return;
  values_ = values;
  ++count_;
  const auto degrees = static_cast<double>(values);
  const double gain = 1.0 / std::min(static_cast<double>(count_), whiteness_memory);
  double square_of_mean = 0.0;
  for (std::size_t j = 0; j < values; ++j) {
    const double value = std::clamp(white[static_cast<Eigen::Index>(j)], -most_normalised, most_normalised);
    sum_[j] += value;
    mean_[j] += (value - mean_[j]) * gain;
    square_of_mean += mean_[j] * mean_[j] / degrees;
  }
  factor_ = correlation_ = 1.0;
  double share = 1.0 / degrees, single = 1.0;
  for (std::size_t k = 0, length = 1; k < levels && length <= count_; ++k, length *= 2, share *= 0.5) {
    const Values& since = sums_[(count_ - length) % remembered];
    double square = 0.0;
    for (std::size_t j = 0; j < values; ++j) square += (sum_[j] - since[j]) * (sum_[j] - since[j]);
    Level& level = levels_[k];
    if (level.count < 2.0 * whiteness_memory) {
      level.count += 1.0;
      level.gain = 1.0 / std::min(level.count, whiteness_memory);
      level.usual = usual_variance(static_cast<double>(length) / level.count, degrees);
    }
    level.variance += (share * square - level.variance) * level.gain;
    factor_ = std::max(factor_, level.variance / level.usual);
    const double about_mean = level.variance - static_cast<double>(length) * square_of_mean;
    if (k == 0) single = std::max(single, about_mean);
    correlation_ = std::max(correlation_, about_mean / (level.usual * single));
  }
  sums_[count_ % remembered] = sum_;
}

double InnovationWhiteness::correlation_of_last(std::size_t count) const noexcept {
  const std::size_t n = std::min({count, count_, remembered - 1}), first = count_ - n;
  const auto degrees = static_cast<double>(values_), all = static_cast<double>(n);
  const auto sum_until = [&](std::size_t k, std::size_t j) { return sums_[(first + k) % remembered][j]; };
  // Least squares of a line through values at -(n - 1) / 2, ..., (n - 1) / 2; sums of it up to the k-th of them.
  Values mean{}, slope{};
  for (std::size_t j = 0; j < values_ && n > 1; ++j) {
    mean[j] = (sum_until(n, j) - sum_until(0, j)) / all;
    double moment = 0.0;
    for (std::size_t k = 0; k < n; ++k)
      moment += (static_cast<double>(k) - 0.5 * (all - 1.0)) * (sum_until(k + 1, j) - sum_until(k, j));
    slope[j] = moment * 12.0 / (all * (all * all - 1.0));
  }
  const auto residual_until = [&](std::size_t k, std::size_t j) {
    const auto until = static_cast<double>(k);
    return sum_until(k, j) - mean[j] * until - slope[j] * 0.5 * until * (until - all);
  };
  double largest = 1.0, single = 1.0;
  for (std::size_t length = 1; length <= longest; length *= 2) {
    const auto each = static_cast<double>(length);
    const double usual = usual_variance(each / all, degrees);
    if (usual == infinity) break;
    double square = 0.0;
    for (std::size_t j = 0; j < values_; ++j)
      for (std::size_t k = length; k <= n; ++k) {
        const double difference = residual_until(k, j) - residual_until(k - length, j);
        square += difference * difference;
      }
    const double variance = square / (degrees * each * static_cast<double>(n - length + 1));
    if (length == 1) single = std::max(single, variance);
    largest = std::max(largest, variance / (usual * single));
  }
  return largest;
}

}  // namespace rhec
