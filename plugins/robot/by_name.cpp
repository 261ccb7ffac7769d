#include "rhec/plugins/robot/by_name.hpp"
#include "rhec/core/base/infinity.hpp"

#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace rhec {

double SigmaValue::read(const Settings& from, const OptionContext& context) const {
  const auto given = from.number();
  const bool is_wrong =
      given && std::isfinite(*given) && *given != 0.0 && range.contains(*given) && !(*given >= least && *given <= most);
  if (is_wrong)
    throw from.mismatch(
        fmt::format("a standard deviation between {:g} and {:g}, in the variable's unit{}; what is known "
                    "better or worse than that is not told from what is certain or unknown",
                    least, most, range.contains(0.0) ? ", or 0" : ""));
  return NumberValue{range}.read(from, context);
}

std::pair<double, double> BoundsValue::read(const Settings& from, const OptionContext&) const {
  if (from.kind() != Settings::Kind::list || from.items().size() != 2)
    throw from.mismatch("a list [lower, upper]; null for no bound");
  const Settings &first = from.items()[0], &second = from.items()[1];
  const double low = first.is_null() ? -infinity : first.as_number();
  const double high = second.is_null() ? infinity : second.as_number();
  if (!(low <= high)) throw from.error(fmt::format("found [{}, {}], expected lower <= upper", low, high));
  const auto is_usable = [](double bound, double none) {
    return bound == none || bound == 0.0 || (std::abs(bound) >= Range::least_magnitude && std::abs(bound) <= farthest);
  };
  if (!is_usable(low, -infinity) || !is_usable(high, infinity))
    throw from.error(fmt::format("found [{}, {}], expected bounds of a magnitude of at most {:g}, or null for none",
                                 low, high, farthest));
  return {low, high};
}

DefaultByName<double> constant_default(double number) {
  return {fmt::format("{}", number),
          [number](const ModelDescription&, const Variable&, std::size_t) { return number; }};
}

DefaultByName<double> scaled_default(double share) {
  return {fmt::format("{} x its typical magnitude", share),
          [share](const ModelDescription&, const Variable& variable, std::size_t) { return share * variable.scale; }};
}

}  // namespace rhec
