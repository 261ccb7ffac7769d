#pragma once

#include <optional>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec::sim {

/// When a sensor measures, and when what it measured arrives.
struct SensorTiming {
  std::optional<double> rate;  ///< [1/s]; none: at each sample of the loop
  double phase = 0.0;          ///< of the first measurement [s]
  double latency = 0.0;        ///< from measurement to arrival [s]
  RHEC_EXPORT static const OptionTable<SensorTiming>& table();
};

/// Reads a map from outputs to their timing. Throws Error for unknown outputs and values out of range.
RHEC_EXPORT std::vector<SensorTiming> read_sensor_timings(const Settings& map, const ModelDescription& about);

/// Which sensors measure when. Those with a rate do so at phase + k / rate, whatever the loop does.
class RHEC_EXPORT SensorSchedule {
 public:
  explicit SensorSchedule(std::vector<SensorTiming> timings);

  /// The earliest time after `time` at which a sensor with a rate measures; infinite if there is none.
  double next_after(double time) const;
  /// Sets outputs to NaN whose sensors do not measure at `time`, a sample of the loop or not.
  void keep_due(double time, bool is_sample, std::vector<double>& outputs) const;
  /// The latencies that there are, in ascending order.
  const std::vector<double>& latencies() const noexcept { return latencies_; }
  /// Sets outputs to NaN whose latency is another one.
  void keep_latency(double latency, std::vector<double>& outputs) const;

 private:
  bool is_due(const SensorTiming& timing, double time) const;

  std::vector<SensorTiming> timings_;  ///< by output
  std::vector<double> latencies_;
};

}  // namespace rhec::sim
