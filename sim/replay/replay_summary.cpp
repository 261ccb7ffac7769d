#include "rhec/sim/replay/replay_summary.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rhec::sim {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// Sums over the innovations of one output.
struct Sums {
  std::int64_t count = 0, pairs = 0;
  double squares = 0.0, variances = 0.0, products = 0.0, last = unknown;
  void add(double value, double sigma) {
    ++count;
    squares += value * value;
    variances += sigma * sigma;
    if (!std::isnan(last)) {
      products += value * last;
      ++pairs;
    }
    last = value;
  }
  SensorSummary::Output summary(const Variable& output) const {
    const double n = static_cast<double>(count), mean_square = squares / n;
    return {.name = output.name,
            .unit = output.unit,
            .rms = count > 0 ? std::sqrt(mean_square) : unknown,
            .expected = count > 0 ? std::sqrt(variances / n) : unknown,
            .correlation = pairs > 0 && squares > 0.0 ? products / static_cast<double>(pairs) / mean_square : unknown};
  }
};

double median_of(std::vector<double> values) {
  if (values.empty()) return unknown;
  const auto half = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), half, values.end());
  if (values.size() % 2 == 1) return *half;
  return 0.5 * (*half + *std::max_element(values.begin(), half));
}

}  // namespace

double of_output(const std::vector<double>& entries, const DriveInnovation& innovation, const DriveReplay& replay,
                 int output) noexcept {
  const std::vector<int>& outputs = replay.sensors[static_cast<std::size_t>(innovation.sensor)].outputs;
  const auto at = std::ranges::find(outputs, output);
  if (at == outputs.end() || entries.size() != outputs.size()) return unknown;
  return entries[static_cast<std::size_t>(at - outputs.begin())];
}

std::vector<SensorSummary> summarise_innovations(const DriveReplay& replay, const Robot& robot) {
  const std::vector<Variable>& outputs = robot.model()->description().outputs;
  std::vector<SensorSummary> summaries;
  for (std::size_t s = 0; s < replay.sensors.size(); ++s) {
    const Sensor& sensor = replay.sensors[s];
    SensorSummary summary{.name = sensor.name, .outputs = {}};
    std::vector<Sums> sums(sensor.outputs.size());
    double nis = 0.0, values = 0.0;
    for (const DriveInnovation& innovation : replay.innovations) {
      if (innovation.sensor != static_cast<int>(s)) continue;
      if (!innovation.accepted) {
        ++summary.rejected;
        continue;
      }
      ++summary.used;
      nis += innovation.nis;
      values += static_cast<double>(innovation.values.size());
      // Which values are missing is not known where there are fewer.
      for (std::size_t i = 0; innovation.values.size() == sums.size() && i < sums.size(); ++i)
        sums[i].add(innovation.values[i], innovation.sigmas[i]);
    }
    const auto used = static_cast<double>(summary.used);
    summary.nis = summary.used > 0 ? nis / used : unknown;
    summary.expected = summary.used > 0 ? values / used : static_cast<double>(sensor.outputs.size());
    for (std::size_t i = 0; i < sums.size(); ++i)
      summary.outputs.push_back(sums[i].summary(outputs[static_cast<std::size_t>(sensor.outputs[i])]));
    summaries.push_back(std::move(summary));
  }
  return summaries;
}

AccuracySummary summarise_predictions(const DriveReplay& replay, const Robot& robot) {
  AccuracySummary summary;
  summary.unpredicted = replay.unpredicted;
  if (replay.withheld_sensor < 0) return summary;
  const Sensor& sensor = replay.sensors[static_cast<std::size_t>(replay.withheld_sensor)];
  summary.sensor = sensor.name;
  std::vector<double> distances;
  std::vector<Sums> sums(sensor.outputs.size());
  double squares = 0.0;
  for (const DrivePrediction& prediction : replay.predictions) {
    distances.push_back(prediction.distance);
    squares += prediction.distance * prediction.distance;
    for (std::size_t i = 0; i < sums.size(); ++i)
      if (!std::isnan(prediction.residuals[i])) sums[i].add(prediction.residuals[i], 0.0);
  }
  summary.count = std::ssize(distances);
  summary.rms = distances.empty() ? unknown : std::sqrt(squares / static_cast<double>(distances.size()));
  summary.most = distances.empty() ? unknown : *std::max_element(distances.begin(), distances.end());
  summary.median = median_of(std::move(distances));
  for (std::size_t i = 0; i < sums.size(); ++i)
    summary.outputs.push_back(
        sums[i].summary(robot.model()->description().outputs[static_cast<std::size_t>(sensor.outputs[i])]));
  return summary;
}

}  // namespace rhec::sim
