#include "rhec/sim/loop/fault_measures.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/numbers/spread.hpp"

namespace rhec::sim {
namespace {

constexpr std::size_t calm_row =
    10;                       // samples in a row of health ok that another finding cannot be blamed on the fault
constexpr double wide = 2.0;  // of the volume without the fault
constexpr double spread_factor = 2.0, largest_factor = 1.2;  // of what is usual
constexpr double displaced_factor = 10.0;  // displacements that are less, in limits, are not told from noise

/// The error that an estimator stays below without a fault, with some room.
double usual_error(const Ride& without) {
  std::vector<double> errors;
  for (std::size_t k = settled_sample; k < without.samples.size(); ++k) errors.push_back(without.samples[k].error);
  const Spread spread = spread_of(std::move(errors));
  return std::max(spread_factor * spread.p99, largest_factor * spread.max);
}

/// Samples from `begin` on until all that follow are good; -1 if the last one is not.
template <class Function>
int until_all(const std::vector<RideSample>& samples, std::size_t begin, const Function& is_good) {
  std::size_t first = samples.size();
  while (first > begin && is_good(samples[first - 1])) --first;
  return first == samples.size() ? -1 : static_cast<int>(first - begin);
}

/// Samples from `begin` on until so many in a row are good, or all that are left; -1 if that is never.
template <class Function>
int until_some(const std::vector<RideSample>& samples, std::size_t begin, std::size_t wanted, const Function& is_good) {
  std::size_t row = 0;
  for (std::size_t k = begin; k < samples.size(); ++k) {
    row = is_good(samples[k]) ? row + 1 : 0;
    if (row == wanted) return static_cast<int>(k + 1 - wanted - begin);
  }
  return row > 0 ? static_cast<int>(samples.size() - row - begin) : -1;
}

bool is_ok(const RideSample& sample) { return sample.health == HealthLevel::ok; }
bool is_honest(const RideSample& sample) { return sample.is_inside || !is_ok(sample); }

void find_span(const std::vector<RideSample>& samples, FaultMeasures& result) {
  const auto faulty = [](const RideSample& sample) { return sample.is_faulty; };
  const auto first = std::find_if(samples.begin(), samples.end(), faulty);
  if (first == samples.end()) throw Error("a ride in which nothing went wrong has no fault to be measured");
  const auto last = std::find_if(samples.rbegin(), samples.rend(), faulty);
  result.is_lasting = last == samples.rbegin();
  result.first = static_cast<int>(first - samples.begin());
  result.end = result.is_lasting ? result.first : static_cast<int>(samples.rend() - last);
}

void find_followed(const std::vector<RideSample>& samples, FaultMeasures& result) {
  for (std::size_t k = result.first; k < samples.size(); ++k)
    if (samples[k].displaced > displaced_factor * result.limit && (result.is_lasting || !samples[k].is_inside))
      result.followed = std::max(result.followed, samples[k].followed);
  for (std::size_t k = result.first; k < samples.size() && result.moved < 0; ++k) {
    if (samples[k].reasons & reason::moved)
      result.moved = static_cast<int>(k) - result.first;
    else
      result.doubted += !is_ok(samples[k]);
  }
  if (result.moved < 0) result.doubted = 0;
}

void count_honest(const std::vector<RideSample>& samples, FaultMeasures& result) {
  std::int64_t row = 0;
  for (std::size_t k = result.first; k < samples.size(); ++k) {
    const RideSample& sample = samples[k];
    ++result.counted;
    result.honest += is_honest(sample);
    result.honest_heading += sample.is_heading_inside || !is_ok(sample);
    row = is_honest(sample) ? 0 : row + 1;
    result.longest_dishonest = std::max(result.longest_dishonest, row);
    result.not_finite += !sample.is_finite;
    result.not_bounded += !sample.is_bounded;
  }
}

void compare_volumes(const std::vector<RideSample>& samples, const std::vector<RideSample>& without,
                     FaultMeasures& result) {
  std::vector<double> ratios;
  for (std::size_t k = result.first; k < samples.size(); ++k) {
    if (!is_ok(samples[k])) continue;
    ++result.ok;
    const double ratio = std::exp(samples[k].log_volume - without[k].log_volume);
    result.wide += !(ratio <= wide);
    ratios.push_back(ratio);
  }
  if (!ratios.empty()) result.volume = spread_of(std::move(ratios)).median;
}

}  // namespace

FaultMeasures measure_fault(const Ride& ride, const Ride& without) {
  if (without.samples.size() < ride.samples.size() || ride.samples.size() <= settled_sample)
    throw Error(
        "a ride with a fault needs one without it that is as long, and more samples than an estimator settles in");
  FaultMeasures result;
  find_span(ride.samples, result);
  result.limit = usual_error(without);
  result.recovered =
      until_all(ride.samples, result.end, [&](const RideSample& sample) { return sample.error <= result.limit; });
  result.ok_again = until_some(ride.samples, result.end, calm_row, is_ok);
  result.is_lost_at_end = ride.samples.back().health == HealthLevel::lost;
  find_followed(ride.samples, result);
  count_honest(ride.samples, result);
  compare_volumes(ride.samples, without.samples, result);
  for (const int after : recovery_samples)
    if (const auto k = static_cast<std::size_t>(result.end) + static_cast<std::size_t>(after); k < ride.samples.size())
      result.errors.push_back(ride.samples[k].error);
  return result;
}

CalmMeasures measure_calm(const Ride& ride) {
  CalmMeasures result;
  for (std::size_t k = settled_sample; k < ride.samples.size(); ++k) {
    const RideSample& sample = ride.samples[k];
    ++result.samples;
    result.ok += is_ok(sample);
    result.honest += is_honest(sample);
    result.inside += sample.is_inside;
    result.inside_heading += sample.is_heading_inside;
    result.not_finite += !sample.is_finite;
    result.not_bounded += !sample.is_bounded;
    result.position += sample.error;
    result.heading += sample.heading_error;
    result.parameters.resize(static_cast<std::size_t>(sample.parameter_errors.size()));
    for (std::size_t j = 0; j < result.parameters.size(); ++j)
      result.parameters[j] += sample.parameter_errors[static_cast<Eigen::Index>(j)];
  }
  if (result.samples == 0) throw Error("a ride that ends before an estimator has settled says nothing");
  const auto count = static_cast<double>(result.samples);
  result.position /= count;
  result.heading /= count;
  for (double& error : result.parameters) error /= count;
  for (std::size_t s = 0; s < ride.sensors.size(); ++s)
    result.sensors[ride.sensors[s].name] = {ride.verdicts[s].accepted, ride.verdicts[s].rejected};
  return result;
}

Json json_of(const FaultMeasures& m) {
  return {{"lasting", m.is_lasting},
          {"first", m.first},
          {"end", m.end},
          {"limit", m.limit},
          {"recovered", m.recovered},
          {"lost_at_end", m.is_lost_at_end},
          {"followed", m.followed},
          {"moved", m.moved},
          {"doubted", m.doubted},
          {"counted", m.counted},
          {"honest", m.honest},
          {"honest_heading", m.honest_heading},
          {"longest_dishonest", m.longest_dishonest},
          {"ok_again", m.ok_again},
          {"ok", m.ok},
          {"wide", m.wide},
          {"volume", m.volume},
          {"not_finite", m.not_finite},
          {"not_bounded", m.not_bounded},
          {"errors", m.errors}};
}

Json json_of(const CalmMeasures& m) {
  Json sensors = Json::object();
  for (const auto& [name, verdict] : m.sensors)
    sensors[name] = {{"accepted", verdict.accepted}, {"rejected", verdict.rejected}};
  return {{"samples", m.samples},
          {"ok", m.ok},
          {"honest", m.honest},
          {"inside", m.inside},
          {"inside_heading", m.inside_heading},
          {"not_finite", m.not_finite},
          {"not_bounded", m.not_bounded},
          {"position", m.position},
          {"heading", m.heading},
          {"parameters", m.parameters},
          {"sensors", std::move(sensors)}};
}

}  // namespace rhec::sim
