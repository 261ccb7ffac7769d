#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/estimation/sensor.hpp"

namespace rhec {

/// Whether an estimate can be used.
enum class HealthLevel : std::uint8_t {
  ok,        ///< what the sensors say agrees with the estimate and its covariance
  degraded,  ///< something is wrong and said so by a reason; the estimate goes on from what is left
  lost       ///< where the vehicle is, or where it heads, is not known
};

/// Reasons, as bits.
namespace reason {
inline constexpr std::uint32_t rejected = 1u << 0;     ///< a measurement failed its gate, and is not used
inline constexpr std::uint32_t stuck = 1u << 1;        ///< the same values again and again, while the vehicle moves
inline constexpr std::uint32_t silent = 1u << 2;       ///< no measurement for much longer than usual
inline constexpr std::uint32_t implausible = 1u << 3;  ///< a value that cannot be, e.g. far beyond its bounds
inline constexpr std::uint32_t moved = 1u << 4;        ///< it has jumped for good, and the estimate has followed
inline constexpr std::uint32_t clock = 1u << 5;        ///< a stamp that cannot be, or a clock that was set
inline constexpr std::uint32_t uncertain = 1u << 6;    ///< a standard deviation above the limit
inline constexpr std::uint32_t starting = 1u << 7;     ///< no measurement yet, or the heading is being searched
inline constexpr std::uint32_t off = 1u << 8;          ///< its values are off by a constant, which is taken out of them
inline constexpr std::uint32_t heading = 1u << 9;      ///< where it is is known, where it heads is not: motion tells it
inline constexpr std::uint32_t all[] = {rejected, stuck,     silent,   implausible, moved,
                                        clock,    uncertain, starting, off,         heading};
}  // namespace reason

/// Of one sensor, or of the measured inputs.
struct SensorHealth {
  std::uint32_t reasons = 0;  ///< at present; 0: none
  std::int64_t accepted = 0;  ///< measurements since the start
  std::int64_t rejected = 0;  ///< likewise
  /// What is taken out of its values, in their unit; of several outputs the norm of all. 0: nothing.
  double offset = 0.0;
  /// The sensor from which it differs by that much, where it is not known which of the two is off; -1: none.
  int rival = -1;
};

/// Of an estimate.
struct Health {
  HealthLevel level = HealthLevel::ok;
  std::uint32_t reasons = 0;          ///< that belong to no sensor
  std::vector<SensorHealth> sensors;  ///< as `sensors_of`; empty where nobody judges
  SensorHealth inputs;                ///< the measured inputs as a whole
  int off_input = -1;                 ///< the input that is off by `inputs.offset`; -1: none
  int doubted_input = -1;             ///< the one that is rejected while others are believed; -1: none
  /// By how much larger the covariance that is given out is than the estimator's own, since innovations are correlated:
  /// the geometric mean of all variables, which have factors of their own (docs/health.md).
  double covariance_factor = 1.0;
};

/// What a measurement of a sensor differed by from what was expected, nu = y - h(x), before it was used.
struct Innovation {
  template <int Columns>
  using OfSensor =
      Eigen::Matrix<double, Eigen::Dynamic, Columns, 0, most_sensor_outputs, Columns == 1 ? 1 : most_sensor_outputs>;
  double time = 0.0;  ///< [s]
  int sensor = 0;
  bool accepted = true;
  double nis = 0.0;                     ///< nu' S^-1 nu, chi-square distributed with as many degrees as values
  OfSensor<1> value;                    ///< nu, of those outputs that were measured
  OfSensor<Eigen::Dynamic> covariance;  ///< S = H P H' + R
};

/// "ok", "degraded", "lost".
RHEC_EXPORT const char* name_of(HealthLevel level) noexcept;
/// One word for a single reason, e.g. "stuck".
RHEC_EXPORT const char* name_of_reason(std::uint32_t reason) noexcept;
/// A health in words, e.g. "degraded: x_gps and y_gps rejected; inputs implausible".
/// Names and units of `inputs`, or none: an input that is off is then told without.
RHEC_EXPORT std::string in_words(const Health& health, const std::vector<Sensor>& sensors,
                                 const std::vector<Sensor>& inputs = {});

}  // namespace rhec
