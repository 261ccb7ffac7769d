#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rhec/logs/mapping/signal_map.hpp"
#include "rhec/logs/mapping/signal_stream.hpp"

namespace rhec::logs {

/// Something that became known: a measurement of outputs, or inputs.
struct DriveEvent {
  double arrival = 0.0;  ///< when it was known [s since the start]
  double time = 0.0;     ///< when it was measured; of inputs, from when on they held [s since the start]
  bool is_output = false;
  std::size_t values = 0;   ///< where its values begin: n_y or n_u, NaN where missing
  bool has_sigmas = false;  ///< n_y stated standard deviations follow these, NaN where there is none
};

/// A drive: what a robot's sensors and drives said, in the order in which it became known.
struct RHEC_EXPORT Drive {
  Stamp start = 0;  ///< of the first measurement; 0 for a clock that does not count from 1970
  int outputs = 0, inputs = 0;
  std::vector<DriveEvent> events;
  std::vector<double> values;
  std::vector<SignalCount> signals;
  std::optional<GeodeticPoint> origin;  ///< of the local plane, if there is one
  std::optional<Damage> damage;         ///< why the log was not read to its end
  const double* values_of(const DriveEvent& event) const noexcept { return values.data() + event.values; }
  /// Null: it states none.
  const double* sigmas_of(const DriveEvent& event) const noexcept {
    return event.has_sigmas ? values_of(event) + outputs : nullptr;
  }
  Stamp stamp_of(double time) const noexcept;
};

/// Reads from a log what a map asks for. Stamps and times of arrival are those of the log. Where stamps lie behind
/// their arrival, or far before it, the clocks of both differ: arrivals are then shifted so that the quickest message
/// takes no time. Throws Error where a signal is not in the log, has no value, or is stamped by a clock of its own.
RHEC_EXPORT Drive read_drive(const Log& log, const SignalMap& map);

}  // namespace rhec::logs
