#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rhec/sim/files/json.hpp"
#include "rhec/sim/loop/ride_along.hpp"

namespace rhec::sim {

/// Samples after a fault's end of which the error is kept.
inline constexpr std::array recovery_samples = {0,  1,  2,  3,  4,  5,  6,  8,  10,  12,
                                                15, 20, 25, 30, 40, 50, 60, 80, 100, 120};
/// From this sample on an estimator counts as settled.
inline constexpr int settled_sample = 20;

/// What an estimator made of a fault, measured against its ride without the fault (same drive, same noise).
///
/// Samples are counted from the end of the fault: from the first one in which nothing goes wrong any more. A fault that
/// is still on at the end of the ride counts as one that has changed the world for good, and is over when it begins.
struct FaultMeasures {
  bool is_lasting = false;
  int first = 0, end = 0;  ///< samples of the ride
  double limit = 0.0;      ///< an error up to this one is usual: the ride without the fault has no larger one [m]
  int recovered = -1;      ///< samples until the error stays below the limit; -1: never
  bool is_lost_at_end = false;
  /// Largest share of a displacement, of ten limits at least, that the position has taken up, where the truth is
  /// outside of 3 standard deviations: one that knows that it may be off by as much has followed nothing.
  double followed = 0.0;
  int moved = -1;            ///< samples from the beginning until the health says `moved`; -1: never
  std::int64_t doubted = 0;  ///< samples before that whose health is not ok; of a ride that says `moved`
  std::int64_t counted = 0;  ///< samples during and after the fault
  std::int64_t honest = 0;   ///< of these, those whose true position is inside 3 standard deviations, or health not ok
  std::int64_t honest_heading = 0;     ///< the same of the heading
  std::int64_t longest_dishonest = 0;  ///< most in a row that are not honest
  int ok_again = -1;                   ///< samples until the health is ok ten times in a row; -1: never
  std::int64_t ok = 0;                 ///< samples during and after the fault whose health is ok
  std::int64_t wide = 0;  ///< of these, those whose 3-sigma volume is more than twice that without the fault
  double volume = 1.0;    ///< median of that ratio
  std::int64_t not_finite = 0, not_bounded = 0;  ///< samples
  std::vector<double> errors;                    ///< at `recovery_samples`, as far as the ride reaches [m]
};
/// Throws Error if nothing went wrong in `ride`, or `without` is shorter.
RHEC_EXPORT FaultMeasures measure_fault(const Ride& ride, const Ride& without);

/// How an estimator did where nothing went wrong, from `settled_sample` on.
struct CalmMeasures {
  std::int64_t samples = 0, ok = 0, honest = 0, inside = 0, inside_heading = 0, not_finite = 0, not_bounded = 0;
  double position = 0.0, heading = 0.0;  ///< mean errors [m, rad]
  std::vector<double> parameters;        ///< by parameter
  struct Verdict {
    std::int64_t accepted = 0, rejected = 0;
  };
  std::map<std::string, Verdict> sensors;  ///< of the whole ride
};
RHEC_EXPORT CalmMeasures measure_calm(const Ride& ride);

RHEC_EXPORT Json json_of(const FaultMeasures& measures);
RHEC_EXPORT Json json_of(const CalmMeasures& measures);

}  // namespace rhec::sim
