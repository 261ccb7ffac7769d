#include "rhec/plugins/robot/bounds_section.hpp"

#include <cstddef>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "rhec/plugins/robot/by_name.hpp"

namespace rhec {
namespace {

using Bounded = std::vector<Variable> ModelDescription::*;
constexpr Bounded bounded_kinds[] = {&ModelDescription::states, &ModelDescription::inputs,
                                     &ModelDescription::parameters};

const ByName<BoundsValue>& bounds_by_name() {
  static const ByName<BoundsValue> map = [] {
    const DefaultByName<std::pair<double, double>> own = {
        "the model's own", [](const ModelDescription&, const Variable& variable, std::size_t) {
          return std::pair(variable.lower, variable.upper);
        }};
    std::vector<ByName<BoundsValue>::Kind> kinds;
    for (const Bounded kind : bounded_kinds)
      kinds.push_back({"STATE, INPUT or PARAMETER", kind, own, "[lower, upper]"});
    return ByName<BoundsValue>("bounds", {}, std::move(kinds));
  }();
  return map;
}

}  // namespace

BoundsSection::BoundsSection(const Settings& section, const ModelDescription& about) : bounded_(about) {
  const auto bounds = bounds_by_name().read(section, about);
  auto next = bounds.begin();
  for (const Bounded kind : bounded_kinds)
    for (Variable& variable : bounded_.*kind) std::tie(variable.lower, variable.upper) = *next++;
  // No motion meets that, and no estimate agrees with what is measured.
  for (const Variable& state : bounded_.states)
    if (const Settings* const given = section.find(state.name); given && state.lower == state.upper)
      throw given->error(
          fmt::format("found [{0:g}, {0:g}], expected lower < upper: a state of the vehicle moves", state.lower));
}

OptionSection BoundsSection::documentation() {
  return {"bounds",
          "Lower and upper bounds. Those of states hold for estimator and controller, those of parameters for the "
          "estimator, those of inputs for the controller. Those of a state differ.",
          bounds_by_name().rows()};
}

std::vector<double> lower_bounds_of(const std::vector<Variable>& variables) {
  std::vector<double> bounds;
  bounds.reserve(variables.size());
  for (const Variable& variable : variables) bounds.push_back(variable.lower);
  return bounds;
}

std::vector<double> upper_bounds_of(const std::vector<Variable>& variables) {
  std::vector<double> bounds;
  bounds.reserve(variables.size());
  for (const Variable& variable : variables) bounds.push_back(variable.upper);
  return bounds;
}

}  // namespace rhec
