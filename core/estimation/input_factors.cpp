#include "rhec/core/estimation/input_factors.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

namespace rhec {
namespace {

// Of an interval [s] that is short for every vehicle.
constexpr double step_duration = 0.05;
// Sine of the angle between derivatives of the next state that are no two directions.
constexpr double same_direction = 1e-6;
constexpr double first_share = 0.3, second_share = 0.45;

/// Some value that is usual, of a number of them; another one for another share.
double value_of(const Variable& variable, double share, std::size_t number) noexcept {
  const double value = variable.nominal + variable.scale * share * (1.0 + 0.1 * static_cast<double>(number % 7));
  return std::min(std::max(value, variable.lower), variable.upper);
}

std::vector<double> values_of(std::span<const Variable> variables, double share) {
  std::vector<double> values;
  for (const Variable& each : variables) values.push_back(value_of(each, share, values.size()));
  return values;
}

}  // namespace

InputFactors::InputFactors(const Model& model)
    : inputs_(static_cast<std::size_t>(model.input_count())),
      is_factor_(static_cast<std::size_t>(model.parameter_count()) * inputs_, 1),
      is_held_(static_cast<std::size_t>(model.parameter_count()), 0) {
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count();
  const ModelDescription& about = model.description();
  Eigen::VectorXd next(nx);
  Eigen::MatrixXd jacobian(nx, nx + nu + 2 * np);
  for (const double share : {first_share, second_share}) {
    const std::vector<double> states = values_of(about.states, share), inputs = values_of(about.inputs, share),
                              parameters = values_of(about.parameters, -0.3 * share);
    model.integrate({.count = 1,
                     .states = states.data(),
                     .inputs = inputs.data(),
                     .parameters = parameters.data(),
                     .parameters_end = parameters.data(),
                     .durations = &step_duration,
                     .next_states = next.data(),
                     .jacobians = jacobian.data()});
    for (int p = 0; p < np; ++p) {
      const Eigen::VectorXd of_parameter = jacobian.col(nx + nu + p) + jacobian.col(nx + nu + np + p);
      for (int j = 0; j < nu; ++j) {
        const Eigen::VectorXd of_input = jacobian.col(nx + j);
        const double size = of_input.norm() * of_parameter.norm(), product = std::abs(of_input.dot(of_parameter));
        const bool is_parallel =
            size > 0.0 && product * product >= (1.0 - same_direction * same_direction) * size * size;
        is_factor_[static_cast<std::size_t>(p) * inputs_ + static_cast<std::size_t>(j)] &= is_parallel ? 1 : 0;
      }
    }
  }
}

void InputFactors::begin(const double* measured) noexcept {
  for (std::size_t p = 0; p < is_held_.size(); ++p) {
    is_held_[p] = 0;
    for (std::size_t j = 0; j < inputs_; ++j)
      if (std::isnan(measured[j]) && is_factor_[p * inputs_ + j] != 0) is_held_[p] = 1;
  }
}

}  // namespace rhec
