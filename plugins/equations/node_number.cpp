#include "node_number.hpp"

#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/core/formula/smooth.hpp"

namespace rhec::equations {
namespace {

struct OfOne {
  const char* name;
  double (*function)(double);
};
struct OfTwo {
  const char* name;
  double (*function)(double, double);
};
struct OfThree {
  const char* name;
  double (*function)(double, double, double);
};

constexpr OfOne of_one[] = {
    {"sqrt", [](double a) { return std::sqrt(a); }}, {"exp", [](double a) { return std::exp(a); }},
    {"log", [](double a) { return std::log(a); }},   {"sin", [](double a) { return std::sin(a); }},
    {"cos", [](double a) { return std::cos(a); }},   {"tan", [](double a) { return std::tan(a); }},
    {"asin", [](double a) { return std::asin(a); }}, {"acos", [](double a) { return std::acos(a); }},
    {"atan", [](double a) { return std::atan(a); }}, {"tanh", [](double a) { return std::tanh(a); }},
    {"abs", [](double a) { return std::abs(a); }}};
constexpr OfTwo of_two[] = {{"atan2", [](double a, double b) { return std::atan2(a, b); }},
                            {"hypot", [](double a, double b) { return std::sqrt(a * a + b * b); }},
                            {"smooth_abs", [](double a, double width) { return smooth_abs(a, width); }},
                            {"min", [](double a, double b) { return std::fmin(a, b); }},
                            {"max", [](double a, double b) { return std::fmax(a, b); }}};
constexpr OfThree of_three[] = {
    {"smooth_min", [](double a, double b, double width) { return smooth_min(a, b, width); }},
    {"smooth_max", [](double a, double b, double width) { return smooth_max(a, b, width); }},
    {"where",
     [](double condition, double positive, double otherwise) { return condition > 0.0 ? positive : otherwise; }}};

/// The entry with a name; null if there is none.
template <class Table>
auto find(const Table& table, const std::string& name) -> decltype(table + 0) {
  for (const auto& each : table)
    if (name == each.name) return &each;
  return nullptr;
}

}  // namespace

NodeNumber::Step NodeNumber::step_of(const Item& item) {
  switch (item.kind) {
    case Item::Kind::number:
    case Item::Kind::name:
      return {.code = Code::number, .value = item.value};
    case Item::Kind::negate:
      return {.code = Code::negate};
    case Item::Kind::add:
      return {.code = Code::add};
    case Item::Kind::subtract:
      return {.code = Code::subtract};
    case Item::Kind::multiply:
      return {.code = Code::multiply};
    case Item::Kind::divide:
      return {.code = Code::divide};
    case Item::Kind::power:
      return {.code = Code::power};
    case Item::Kind::function:
      break;
  }
  if (const OfOne* one = find(of_one, item.name)) return {.code = Code::function_1, .one = one->function};
  if (const OfTwo* two = find(of_two, item.name)) return {.code = Code::function_2, .two = two->function};
  return {.code = Code::function_3, .three = find(of_three, item.name)->function};
}

NodeNumber::NodeNumber(const std::string& file, const std::vector<Item>& term,
                       const std::map<std::string, double>& options, bool may_use_place) {
  std::size_t numbers = 0;
  for (const Item& item : term) {
    Step step = step_of(item);
    if (item.kind == Item::Kind::name) {
      const auto option = options.find(item.name);
      const PlaceName* known = nullptr;
      for (const PlaceName& each : place_names)
        if (may_use_place && item.name == each.name) known = &each;
      if (item.name == "pi" || item.name == "infinity") {
        step.value = item.name == "pi" ? std::numbers::pi : infinity;
      } else if (option != options.end()) {
        step.value = option->second;
      } else if (known != nullptr) {
        step = {.code = Code::place, .of_place = known->value};
      } else {
        std::vector<std::string> expected{"pi", "infinity"};
        for (const auto& [name, value] : options) expected.push_back(name);
        for (const PlaceName& each : place_names)
          if (may_use_place) expected.emplace_back(each.name);
        throw error_at(
            file, item.place,
            fmt::format("'{}' is not known here; expected a term of {}", item.name, fmt::join(expected, ", ")));
      }
    }
    numbers = numbers + 1 - static_cast<std::size_t>(operands_of(item));
    if (numbers > most_numbers)
      throw error_at(file, item.place,
                     fmt::format("this needs more than {} numbers at a time; write it shorter", most_numbers));
    steps_.push_back(step);
  }
}

double NodeNumber::at(const TermPlace& place) const noexcept {
  std::array<double, most_numbers> stack;
  std::size_t size = 0;
  for (const Step& step : steps_) {
    switch (step.code) {
      case Code::number:
        stack[size++] = step.value;
        break;
      case Code::place:
        stack[size++] = place.*step.of_place;
        break;
      case Code::negate:
        stack[size - 1] = -stack[size - 1];
        break;
      case Code::add:
        --size;
        stack[size - 1] += stack[size];
        break;
      case Code::subtract:
        --size;
        stack[size - 1] -= stack[size];
        break;
      case Code::multiply:
        --size;
        stack[size - 1] *= stack[size];
        break;
      case Code::divide:
        --size;
        stack[size - 1] /= stack[size];
        break;
      case Code::power:
        --size;
        stack[size - 1] = std::pow(stack[size - 1], stack[size]);
        break;
      case Code::function_1:
        stack[size - 1] = step.one(stack[size - 1]);
        break;
      case Code::function_2:
        --size;
        stack[size - 1] = step.two(stack[size - 1], stack[size]);
        break;
      case Code::function_3:
        size -= 2;
        stack[size - 1] = step.three(stack[size - 1], stack[size], stack[size + 1]);
        break;
    }
  }
  return stack[0];
}

}  // namespace rhec::equations
