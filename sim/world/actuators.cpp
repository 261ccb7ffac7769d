#include "rhec/sim/world/actuators.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/infinity.hpp"

namespace rhec::sim {

const OptionTable<ActuatorOptions>& ActuatorOptions::table() {
  using A = ActuatorOptions;
  static const auto rows =
      OptionTable<A>()
          .number("lag", &A::lag, "time constant with which the input follows what is asked [s]; 0: none",
                  between(0.0, 1e3))
          .number("lower", &A::lower, "least input that the actuator gives", or_infinite(any()))
          .number("upper", &A::upper, "largest input that the actuator gives", or_infinite(any()));
  return rows;
}

std::vector<ActuatorOptions> read_actuators(const Settings& map, const ModelDescription& about) {
  check_keys(map, names_of(about.inputs), "actuators");
  std::vector<ActuatorOptions> actuators(about.inputs.size());
  for (std::size_t j = 0; j < actuators.size(); ++j) {
    const Settings* given = map.find(about.inputs[j].name);
    if (!given) continue;
    actuators[j] = ActuatorOptions::table().parse(*given, "actuator '" + about.inputs[j].name + "'");
    if (!(actuators[j].lower <= actuators[j].upper))
      throw given->error(
          fmt::format("lower is {} and upper is {}; expected lower <= upper", actuators[j].lower, actuators[j].upper));
  }
  return actuators;
}

Actuators::Actuators(std::vector<ActuatorOptions> options)
    : options_(std::move(options)), state_(options_.size()), applied_(options_.size()), shortest_lag_(infinity) {
  for (std::size_t j = 0; j < options_.size(); ++j) {
    state_[j] = std::clamp(0.0, options_[j].lower, options_[j].upper);
    if (options_[j].lag > 0.0) shortest_lag_ = std::min(shortest_lag_, options_[j].lag);
  }
}

void Actuators::advance(TruthVehicle& vehicle, const double* given, double duration) noexcept {
  // The vehicle holds an input: pieces so short that the mean over one is as good as the course of the lag in it.
  constexpr double share = 0.1;
  constexpr double most_pieces = 1000.0;
  const double pieces = std::clamp(std::ceil(duration / (share * shortest_lag_)), 1.0, most_pieces);
  const double piece = duration / pieces;
  for (double done = 0.0; done < pieces; done += 1.0) {
    for (std::size_t j = 0; j < options_.size(); ++j) {
      const ActuatorOptions& actuator = options_[j];
      const double aim = std::clamp(given[j], actuator.lower, actuator.upper), start = state_[j];
      if (!(actuator.lag > 0.0)) {
        state_[j] = applied_[j] = aim;
        continue;
      }
      state_[j] = aim + (start - aim) * std::exp(-piece / actuator.lag);
      applied_[j] = aim + (start - state_[j]) * actuator.lag / piece;
    }
    vehicle.advance(applied_.data(), piece);
  }
}

}  // namespace rhec::sim
