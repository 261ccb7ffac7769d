#pragma once

#include <algorithm>
#include <cmath>

namespace rhec {

/// The derivative by k of y = (1 + k) h(w) with which a filter takes in y; at the mean of w it would be h.
///
/// The mean of h is h + e, and where e is the noise of an input that was measured, the innovation has - e in it: times
/// the mean it is - e^2 on the average, and a filter learns that 1 + k is small, from noise alone (the attenuation of a
/// regressor with errors: Fuller 1987, section 1.1). The error of h after the measurement is not correlated with the
/// innovation. So h counts as it is then, and by no more than it is beyond three of its standard deviations: a steering
/// angle that is 0, as on a straight leg, tells nothing of k.
///
/// `gradient(c)` is that of y by `count` variables at their mean, of which k is number `factor`, and `covariance(r, c)`
/// theirs; `scale` = 1 + k, `noise` the variance of the measurement. An outlier decides nothing. 0 where that is not
/// finite.
template <class Gradient, class Covariance>
double scale_slope(int count, int factor, double scale, double innovation, double noise, Gradient gradient,
                   Covariance covariance) noexcept {
  constexpr double most = 3.0;  // standard deviations
  double own = 0.0;             // of (1 + k) h for a k that is known
  for (int c = 0; c < count; ++c) {
    const double by = c == factor ? 0.0 : gradient(c);
    if (by == 0.0) continue;
    for (int r = 0; r < count; ++r)
      if (r != factor) own += by * gradient(r) * covariance(r, c);
  }
  own = std::max(own, 0.0);
  const double total = own + noise, bound = most * std::sqrt(total);
  const double h = gradient(factor) + own / total * std::clamp(innovation, -bound, bound) / scale;
  const double beyond = std::abs(h) - most * std::sqrt(own * noise / total) / std::abs(scale);
  return beyond > 0.0 && std::isfinite(h) ? std::copysign(beyond, h) : 0.0;
}

}  // namespace rhec
