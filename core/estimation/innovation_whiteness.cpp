#include "innovation_whiteness.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "innovation.hpp"

namespace rhec {
namespace {

// Slip that jumps makes innovations that are large, but few.
constexpr double most_normalised = 3.0;
// Variances are means over about so many innovations.
constexpr double whiteness_memory = 300.0;
// Sums that overlap know less than as many that do not; below so many lengths nothing.
constexpr double least_lengths = 4.0;

}  // namespace

void InnovationWhiteness::take(const Innovation& innovation, std::size_t values) noexcept {
  if (static_cast<std::size_t>(innovation.value.size()) != values) return;
  const Innovation::OfSensor<1> white = normalised(innovation.value, innovation.covariance);
  if (!white.allFinite()) return;
  for (std::size_t j = 0; j < values; ++j)
    sum_[j] += std::clamp(white[static_cast<Eigen::Index>(j)], -most_normalised, most_normalised);
  ++count_;
  factor_ = 1.0;
  const auto degrees = static_cast<double>(values);
  double share = 1.0 / degrees;
  for (std::size_t k = 0, length = 1; k < levels && length <= count_; ++k, length *= 2, share *= 0.5) {
    const Values& since = sums_[(count_ - length) % longest];
    double square = 0.0;
    for (std::size_t j = 0; j < values; ++j) square += (sum_[j] - since[j]) * (sum_[j] - since[j]);
    Level& level = levels_[k];
    if (level.count < 2.0 * whiteness_memory) {
      level.count += 1.0;
      level.gain = 1.0 / std::min(level.count, whiteness_memory);
      // A variance with Bartlett's window over n values has the variance 4/3 m / n (Priestley 1981).
      const double relative = static_cast<double>(length) / level.count;
      level.usual = relative * least_lengths > 1.0 ? std::numeric_limits<double>::infinity()
                                                   : 1.0 + std::sqrt(4.0 / 3.0 * relative / degrees);
    }
    level.variance += (share * square - level.variance) * level.gain;
    if (level.variance > factor_ * level.usual) factor_ = level.variance / level.usual;
  }
  sums_[count_ % longest] = sum_;
}

}  // namespace rhec
