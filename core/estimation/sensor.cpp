#include "rhec/core/estimation/sensor.hpp"

#include <algorithm>
#include <cstddef>

namespace rhec {
namespace {

/// Whether a name is another one with one x in it exchanged for a letter.
bool is_exchanged(const std::string& name, char letter, const std::string& other) {
  if (name.size() != other.size()) return false;
  const auto [here, there] = std::mismatch(name.begin(), name.end(), other.begin());
  if (here == name.end() || *here != letter || *there != 'x') return false;
  return std::equal(here + 1, name.end(), there + 1);
}

}  // namespace

std::vector<Sensor> sensors_of(const ModelDescription& about, const std::vector<double>& output_variances) {
  const std::vector<Variable>& outputs = about.outputs;
  const int x = about.roles.position_x;
  const std::string length = x >= 0 ? about.states[static_cast<std::size_t>(x)].unit : "m";
  const std::size_t count = outputs.size();
  std::vector<bool> is_taken(count, false);
  std::vector<Sensor> sensors;
  for (std::size_t j = 0; j < count; ++j) {
    if (is_taken[j]) continue;
    sensors.push_back({outputs[j].name, {static_cast<int>(j)}, outputs[j].unit});
    const auto is_alike = [&](std::size_t k) {
      return !is_taken[k] && outputs[k].unit == outputs[j].unit && outputs[k].device == outputs[j].device &&
             output_variances[k] == output_variances[j];
    };
    const auto take = [&](std::size_t k) {
      is_taken[k] = true;
      sensors.back().name += " and " + outputs[k].name;
      sensors.back().outputs.push_back(static_cast<int>(k));
    };
    const auto first_behind = [&](auto&& is_wanted) {
      std::size_t k = j + 1;
      while (k < count && !(is_alike(k) && is_wanted(k))) ++k;
      return k;
    };
    const auto named = [&](char letter) {
      return first_behind([&](std::size_t k) { return is_exchanged(outputs[k].name, letter, outputs[j].name); });
    };
    std::size_t second = named('y');
    if (second == count && outputs[j].unit == length) second = first_behind([](std::size_t) { return true; });
    if (second == count) continue;
    take(second);
    if (const std::size_t third = named('z'); third < count) take(third);
  }
  return sensors;
}

}  // namespace rhec
