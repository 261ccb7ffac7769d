#include "rhec/core/model.hpp"

#include <algorithm>

namespace rhec {

std::vector<std::string> names_of(const std::vector<Variable>& variables) {
  std::vector<std::string> names;
  names.reserve(variables.size());
  for (const Variable& variable : variables) names.push_back(variable.name);
  return names;
}

std::vector<double> nominal_values(const std::vector<Variable>& parameters) {
  std::vector<double> values;
  values.reserve(parameters.size());
  for (const Variable& parameter : parameters) values.push_back(parameter.nominal);
  return values;
}

void Roles::place(double x, double y, double direction, double* state) const noexcept {
  if (position_x >= 0) state[position_x] = x;
  if (position_y >= 0) state[position_y] = y;
  if (heading >= 0) state[heading] = direction;
  for (const int body : other_headings) state[body] = direction;
}

void Roles::turn(double angle, double* state) const noexcept {
  if (heading >= 0) state[heading] += angle;
  for (const int body : other_headings) state[body] += angle;
}

void Model::straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept {
  const Roles& roles = description().roles;
  const double wheel_speed = roles.speed_factor >= 0 ? ground_speed / p[roles.speed_factor] : ground_speed;
  std::fill_n(inputs, input_count(), 0.0);
  if (roles.speed >= 0) inputs[roles.speed] = wheel_speed;
  if (roles.speed_state >= 0) state[roles.speed_state] = wheel_speed;
}

}  // namespace rhec
