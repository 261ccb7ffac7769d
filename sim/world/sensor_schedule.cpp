#include "rhec/sim/world/sensor_schedule.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rhec/core/base/infinity.hpp"
#include "rhec/sim/world/deliveries.hpp"

namespace rhec::sim {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// The number of the first measurement at `time` or after it; not below 0.
double number_from(const SensorTiming& timing, double time) {
  return std::max(0.0, std::ceil((time - timing.phase - Deliveries::tolerance) * *timing.rate));
}

double time_of(const SensorTiming& timing, double number) { return timing.phase + number / *timing.rate; }

}  // namespace

const OptionTable<SensorTiming>& SensorTiming::table() {
  using S = SensorTiming;
  static const auto rows =
      OptionTable<S>()
          .optional_number("rate", &S::rate, "of its measurements [1/s]; none: at each sample of the loop",
                           between(1e-6, 1e4))
          .number("phase", &S::phase, "of the first of them, with a rate [s]", between(0.0, 1e6))
          .number("latency", &S::latency, "from measurement to arrival; the stamp is that of the measurement [s]",
                  between(0.0, 1e6));
  return rows;
}

std::vector<SensorTiming> read_sensor_timings(const Settings& map, const ModelDescription& about) {
  check_keys(map, names_of(about.outputs), "sensors");
  std::vector<SensorTiming> timings(about.outputs.size());
  for (std::size_t j = 0; j < timings.size(); ++j)
    if (const Settings* given = map.find(about.outputs[j].name))
      timings[j] = SensorTiming::table().parse(*given, "sensor '" + about.outputs[j].name + "'");
  return timings;
}

SensorSchedule::SensorSchedule(std::vector<SensorTiming> timings) : timings_(std::move(timings)) {
  for (const SensorTiming& timing : timings_) latencies_.push_back(timing.latency);
  std::sort(latencies_.begin(), latencies_.end());
  latencies_.erase(std::unique(latencies_.begin(), latencies_.end()), latencies_.end());
}

double SensorSchedule::next_after(double time) const {
  double next = infinity;
  for (const SensorTiming& timing : timings_)
    if (timing.rate) next = std::min(next, time_of(timing, number_from(timing, time + 2.0 * Deliveries::tolerance)));
  return next;
}

bool SensorSchedule::is_due(const SensorTiming& timing, double time) const {
  return std::abs(time_of(timing, number_from(timing, time)) - time) <= Deliveries::tolerance;
}

void SensorSchedule::keep_due(double time, bool is_sample, std::vector<double>& outputs) const {
  for (std::size_t j = 0; j < outputs.size(); ++j)
    if (timings_[j].rate ? !is_due(timings_[j], time) : !is_sample) outputs[j] = nan;
}

void SensorSchedule::keep_latency(double latency, std::vector<double>& outputs) const {
  for (std::size_t j = 0; j < outputs.size(); ++j)
    if (timings_[j].latency != latency) outputs[j] = nan;
}

}  // namespace rhec::sim
