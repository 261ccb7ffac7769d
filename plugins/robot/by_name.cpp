#include "rhec/plugins/robot/by_name.hpp"
#include "rhec/core/base/infinity.hpp"

#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace rhec {

double FiniteValue::read(const Settings& from, const OptionContext& context) const {
  const double number = NumberValue{range}.read(from, context);
  if (!std::isfinite(number)) throw from.mismatch("a finite number");
  return number;
}

double SigmaValue::read(const Settings& from, const OptionContext& context) const {
  constexpr double least = 1e-100, most = 1e100;
  const double sigma = FiniteValue{range}.read(from, context);
  if (sigma != 0.0 && !(sigma >= least && sigma <= most))
    throw from.mismatch(
        fmt::format("a standard deviation between {:g} and {:g}, whose square is a number", least, most));
  return sigma;
}

std::pair<double, double> BoundsValue::read(const Settings& from, const OptionContext&) const {
  if (from.kind() != Settings::Kind::list || from.items().size() != 2)
    throw from.mismatch("a list [lower, upper]; null for no bound");
  const Settings &first = from.items()[0], &second = from.items()[1];
  const double low = first.is_null() ? -infinity : first.as_number();
  const double high = second.is_null() ? infinity : second.as_number();
  if (!(low <= high)) throw from.error(fmt::format("found [{}, {}], expected lower <= upper", low, high));
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
