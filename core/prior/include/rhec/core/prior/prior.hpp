#pragma once

#include <span>

#include "rhec/core/base/export.hpp"

namespace rhec {

struct Variable;

/// What a parameter varies along: the clock, or the ground that the vehicle covers.
enum class Along { time, distance };

/// How a parameter moves over one interval, from its value at one node to that at the next.
enum class Course {
  ramp,  ///< in a straight line
  held   ///< it keeps the value of the interval's first node, and changes at the next
};

/// What a state of a process is. Processes are mixed state by state, so that each of them has one meaning for all.
enum class ProcessState {
  value,      ///< the parameter itself
  slope,      ///< its derivative by the advance
  curvature,  ///< its second derivative
  mean        ///< the level about which it varies
};
inline constexpr int process_state_kinds = 4;

/// How a parameter varies: a Gaussian Markov process z of a few states, the first of which is the parameter itself
/// (docs/method.md, section 8; Hartikainen and Särkkä 2010). Over an advance d [s, or m of ground],
///
///     z(s + d) = F(d) z(s) + w,    w ~ N(0, Q(d)),
///
/// exactly: two advances give the same moments as their sum. The same object serves filters, windows and smoothers.
/// After `set_up`, all calls are const, thread-safe and allocation-free.
class RHEC_EXPORT Prior {
 public:
  /// No process has more states: one of each kind.
  static constexpr int max_states = process_state_kinds;

  virtual ~Prior() = default;

  /// Takes on the parameter: what the options leave open follows from its bounds. Called once, before anything else.
  /// Throws Error if the bounds are needed and there are none.
  virtual void set_up(const Variable& parameter) = 0;

  /// The states of z in their order: the first one is the value, and no kind comes twice.
  virtual std::span<const ProcessState> states() const noexcept = 0;
  int state_count() const noexcept { return static_cast<int>(states().size()); }
  virtual Along along() const noexcept = 0;
  virtual Course course() const noexcept = 0;
  /// Moments of z before anything is known: mean (n) and covariance (n x n).
  virtual void start(double* mean, double* covariance) const noexcept = 0;
  /// F and Q (n x n, column-major) of an advance d >= 0.
  virtual void advance(double d, double* F, double* Q) const noexcept = 0;
};

}  // namespace rhec
