#include "rhec/sim/numbers/statistics.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace rhec::sim {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/// P(0 < T < t): with t = sqrt(n) tan(a) it is a multiple of the integral of cos(a)^(n-1), which Simpson's rule
/// evaluates to rounding precision.
double share_up_to(double t, double n) {
  constexpr int parts = 400;
  const double end = std::atan(t / std::sqrt(n)), h = end / parts;
  double sum = 1.0 + std::pow(std::cos(end), n - 1.0);
  for (int i = 1; i < parts; ++i) sum += (i % 2 == 1 ? 4.0 : 2.0) * std::pow(std::cos(i * h), n - 1.0);
  const double scale = std::exp(std::lgamma(0.5 * (n + 1.0)) - std::lgamma(0.5 * n)) / std::sqrt(std::numbers::pi);
  return scale * sum * h / 3.0;
}

}  // namespace

double student_975(std::size_t degrees) {
  double lower = 0.0, upper = 20.0;
  while (upper - lower > 1e-12 * upper) {
    const double middle = 0.5 * (lower + upper);
    (share_up_to(middle, static_cast<double>(degrees)) < 0.475 ? lower : upper) = middle;
  }
  return lower;
}

double StudentQuantiles::of(std::size_t degrees) {
  const auto [entry, is_new] = known_.try_emplace(degrees, 0.0);
  if (is_new) entry->second = student_975(degrees);
  return entry->second;
}

void Moments::add(double value) noexcept {
  ++count_;
  const double step = value - mean_;
  mean_ += step / static_cast<double>(count_);
  squares_ += step * (value - mean_);
}

double Moments::mean() const noexcept { return count_ > 0 ? mean_ : missing; }

double Moments::half_width(StudentQuantiles& quantiles) const {
  if (count_ < 2) return missing;
  const auto n = static_cast<double>(count_);
  return quantiles.of(count_ - 1) * std::sqrt(squares_ / (n - 1.0) / n);
}

}  // namespace rhec::sim
