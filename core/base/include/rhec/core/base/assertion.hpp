#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>

namespace rhec {

/// Throws std::logic_error, which says what did not hold and where. In a noexcept function, such as all that run in a
/// control loop, the program ends there with that message.
[[noreturn, gnu::cold, gnu::noinline]] inline void assertion_failed(const char* condition, const char* meaning,
                                                                    const char* file = __builtin_FILE(),
                                                                    int line = __builtin_LINE(),
                                                                    const char* function = __builtin_FUNCTION()) {
  throw std::logic_error(std::string(file) + ":" + std::to_string(line) + ": " + function + ": not true: " + condition +
                         " (" + meaning + ")");
}

/// Whether all `count` numbers are finite; true for null, which means 'not requested'.
inline bool all_finite(const double* values, std::ptrdiff_t count) noexcept {
  for (std::ptrdiff_t k = 0; values && k < count; ++k)
    if (!std::isfinite(values[k])) return false;
  return true;
}
inline bool all_finite(std::span<const double> values) noexcept {
  return all_finite(values.data(), std::ssize(values));
}

}  // namespace rhec

/// RHEC_ASSERT(condition, meaning) reports a programming error, in rhec or in its caller, never an error in the user's
/// data. It guards the interfaces between components: sizes of spans, what must be set up before use, finite results.
/// Builds with NDEBUG (release) do not evaluate it.
#ifdef NDEBUG
#define RHEC_ASSERT(condition, meaning) static_cast<void>(0)
#else
#define RHEC_ASSERT(condition, meaning) \
  (static_cast<bool>(condition) ? static_cast<void>(0) : ::rhec::assertion_failed(#condition, meaning))
#endif
