#pragma once

#include <cmath>
#include <type_traits>

// What formulas use where others decide by values: functions with derivatives everywhere, for any number type.

namespace rhec {

/// sqrt(x^2 + width^2), which is `width` at 0 and approaches |x|: about width^2 / (2 |x|) above it.
template <class Scalar>
constexpr Scalar smooth_abs(const Scalar& x, const std::type_identity_t<Scalar>& width) {
  using std::sqrt;
  return sqrt(x * x + width * width);
}
/// (a + b + smooth_abs(a - b, width)) / 2: above the larger one by at most width / 2, where both are equal.
template <class Scalar>
constexpr Scalar smooth_max(const Scalar& a, const std::type_identity_t<Scalar>& b,
                            const std::type_identity_t<Scalar>& width) {
  return 0.5 * (a + b + smooth_abs<Scalar>(a - b, width));
}
/// (a + b - smooth_abs(a - b, width)) / 2: below the smaller one by at most width / 2, where both are equal.
template <class Scalar>
constexpr Scalar smooth_min(const Scalar& a, const std::type_identity_t<Scalar>& b,
                            const std::type_identity_t<Scalar>& width) {
  return 0.5 * (a + b - smooth_abs<Scalar>(a - b, width));
}

/// The number itself. In a graph it gets the name: `const Scalar alpha = named(delta - beta, "slip angle")`.
template <class Scalar>
constexpr const Scalar& named(const Scalar& number, const char* /*name*/) {
  return number;
}

}  // namespace rhec
