#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/expression.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/term/model_layer.hpp"

namespace rhec {

/// What a violation sigma of a limit costs: linear sigma + 1/2 quadratic sigma^2. Hard by default.
struct Softness {
  double linear = std::numeric_limits<double>::infinity();  ///< per unit of the limit; infinite: there is no violation
  double quadratic = 0.0;                                   ///< per unit squared
  bool is_hard() const noexcept { return linear == std::numeric_limits<double>::infinity(); }
};

/// What a residual r costs: weight rho(r^2), where rho is the identity or, with a finite delta, the pseudo-Huber loss
/// 2 delta^2 (sqrt(1 + r^2 / delta^2) - 1), which grows linearly beyond delta.
struct Loss {
  double weight = 1.0;
  double delta = std::numeric_limits<double>::infinity();  ///< in the residual's unit
};

/// What a Term writes its formulas to, and where it finds the vehicle's variables. Only valid during Term::write. All
/// functions throw Error, with the name of the term and of the model, where the vehicle does not have what is asked.
class RHEC_EXPORT TermWriter {
 public:
  struct Limit {
    int node;
    Softness softness;
    std::string name;
  };
  struct Residual {
    int node;
    Loss loss;
    std::string name;
  };

  /// For a term called `name`; `variables` are the vehicle's.
  TermWriter(std::string name, const Model& vehicle, Graph& graph, StageVariables variables);

  const Model& vehicle() const noexcept { return vehicle_; }

  // The vehicle's variables by role, and by name.
  const Expression& position_x() const;
  const Expression& position_y() const;
  const Expression& heading() const;
  /// Wheel speed [m/s]: an input, or a state of a vehicle whose input is an acceleration.
  const Expression& wheel_speed() const;
  /// Speed over ground at the point that follows the path [m/s], from the derivative of its position.
  Expression ground_speed();
  const Expression& input(std::string_view name) const;
  const Expression& state(std::string_view name) const;
  /// The time derivative of a state, from the vehicle's own equations.
  Expression rate(int state);
  /// That of the heading [rad/s].
  Expression heading_rate();

  /// One more number that Term::write_data writes for each node. Ask for one after the other: within an expression the
  /// order of calls is not defined in C++.
  Expression data(std::string name);
  /// One more limit lower <= value <= upper, whose bounds Term::write_data writes.
  void limit(const Expression& value, const Softness& softness, std::string name);
  /// One more term of the cost.
  void residual(const Expression& value, const Loss& loss, std::string name);

  const std::vector<Limit>& limits() const noexcept { return limits_; }
  const std::vector<Residual>& residuals() const noexcept { return residuals_; }
  const std::vector<int>& data_nodes() const noexcept { return data_; }

 private:
  const Expression& of_role(int index, const std::vector<Expression>& all, const char* role) const;
  [[noreturn]] void refuse(const std::string& why) const;

  std::string name_;
  const Model& vehicle_;
  Graph& graph_;
  StageVariables variables_;
  std::vector<int> rates_;  ///< nodes of dx/dt, once they were asked for
  std::vector<Limit> limits_;
  std::vector<Residual> residuals_;
  std::vector<int> data_;
};

}  // namespace rhec
