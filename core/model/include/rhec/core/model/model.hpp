#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/stage_rows.hpp"

namespace rhec {

/// One component of a model's state, input, parameter or output.
struct Variable {
  std::string name;                                         ///< as it is spelt in configuration and in result files
  std::string unit;                                         ///< SI, e.g. "m", "rad/s"; "1" for a pure number
  std::string meaning;                                      ///< one phrase for people
  double lower = -std::numeric_limits<double>::infinity();  ///< default bound
  double upper = std::numeric_limits<double>::infinity();   ///< default bound
  double scale = 1.0;     ///< a typical magnitude, for finite differences and random tests
  bool is_angle = false;  ///< compared on the circle
  double nominal = 1.0;   ///< of a parameter: its value where nothing slips
  bool usual = true;      ///< of an output: measured unless the configuration chooses others
};

/// The names of variables, in their order.
RHEC_EXPORT std::vector<std::string> names_of(const std::vector<Variable>& variables);
/// The values of parameters where nothing slips.
RHEC_EXPORT std::vector<double> nominal_values(const std::vector<Variable>& parameters);

/// Which variables say where the vehicle is and how fast it goes; -1 where the model has none. A vehicle that is
/// shifted and turned as a whole moves as before: its dynamics know neither its position nor the sum of its headings.
struct RHEC_EXPORT Roles {
  int position_x = -1;                   ///< state: x of the point that shall follow the path [m]
  int position_y = -1;                   ///< state: y of that point [m]
  int heading = -1;                      ///< state: direction of travel at that point [rad]
  int speed = -1;                        ///< input: speed of the wheels [m/s]
  int speed_state = -1;                  ///< state: the same, of a vehicle whose input is an acceleration [m/s]
  int speed_factor = -1;                 ///< parameter: ground speed / wheel speed [1]
  std::vector<int> other_headings = {};  ///< states: of further bodies, e.g. of the tractor before its trailer [rad]

  /// Puts the point that follows the path at a place, with all bodies in line.
  void place(double x, double y, double direction, double* state) const noexcept;
  /// Turns all bodies by an angle [rad] about the point that follows the path.
  void turn(double angle, double* state) const noexcept;
};

struct ModelDescription {
  std::string name;
  std::string source;  ///< where the equations were published
  std::vector<Variable> states, inputs, parameters, outputs;
  Roles roles;
};

/// How a vehicle moves and what its sensors see:
///
///     dx/dt = f(x, u, p),    y = h(x)
///
/// with state x (n_x), input u (n_u), parameter p (n_p) and output y (n_y). Between two nodes the input is constant and
/// x_{i+1} = F(x_i, u_i, p_i, dt_i) is a number of classical Runge-Kutta steps. All calls are const, thread-safe, do
/// not allocate and do not throw; they cover a range of stages, so that an implementation may evaluate several at once.
class RHEC_EXPORT Model {
 public:
  virtual ~Model() = default;

  virtual const ModelDescription& description() const noexcept = 0;
  int state_count() const noexcept { return static_cast<int>(description().states.size()); }
  int input_count() const noexcept { return static_cast<int>(description().inputs.size()); }
  int parameter_count() const noexcept { return static_cast<int>(description().parameters.size()); }
  int output_count() const noexcept { return static_cast<int>(description().outputs.size()); }

  /// One request to `integrate`. Row i of an array belongs to interval i of the range; rows are dense. A null result
  /// pointer means 'not asked for'.
  ///
  /// With z = [x; u; p] (or [x; u; p; p_end] where `parameters_end` is given, see below):
  ///   next_states  count x n_x               F
  ///   jacobians    count x (n_x x n_z)       dF/dz, column-major
  ///   hessians     count x (n_z x n_z)       sum_j multipliers_j d2F_j/dz2, symmetric, both halves filled
  struct Intervals {
    int count = 0;
    const double* states = nullptr;          ///< count x n_x
    const double* inputs = nullptr;          ///< count x n_u
    const double* parameters = nullptr;      ///< count x n_p
    const double* parameters_end = nullptr;  ///< count x n_p, or null: p is constant on an interval; otherwise it runs
                                             ///< linearly from `parameters` to `parameters_end`
    const double* durations = nullptr;       ///< count, [s]
    int substeps = 1;                        ///< Runge-Kutta steps per interval
    double* next_states = nullptr;
    double* jacobians = nullptr;
    const double* multipliers = nullptr;  ///< count x n_x; needed with `hessians`
    double* hessians = nullptr;
  };
  virtual void integrate(const Intervals& request) const noexcept = 0;

  /// One request to `observe`: outputs at a range of nodes, laid out as above with z = x.
  ///   outputs    count x n_y             h
  ///   jacobians  count x (n_y x n_x)     dh/dx, column-major
  ///   hessians   count x (n_x x n_x)     sum_j multipliers_j d2h_j/dx2
  struct Nodes {
    int count = 0;
    const double* states = nullptr;  ///< count x n_x
    double* outputs = nullptr;
    double* jacobians = nullptr;
    const double* multipliers = nullptr;  ///< count x n_y; needed with `hessians`
    double* hessians = nullptr;
  };
  virtual void observe(const Nodes& request) const noexcept = 0;

  /// The same over rows of stages, for solvers in a hurry. As they are, they gather, call the above and scatter; a
  /// FormulaModel computes in place.
  virtual void integrate_rows(const IntervalRows& request) const noexcept;
  virtual void observe_rows(const NodeRows& request) const noexcept;
  /// How many doubles of scratch these two take for `count` rows.
  virtual std::size_t rows_scratch(int count) const noexcept;

  /// dx/dt at one point, for integrators of one's own (the truth vehicle of a simulation).
  virtual void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept = 0;

  /// Going straight ahead at a ground speed [m/s] where the vehicle slips like p, as the path's reference asks for:
  /// writes all inputs (n_u), and of the state those entries that are speeds. As it is, the wheel speed (`roles.speed`
  /// or `roles.speed_state`) becomes ground_speed / p[roles.speed_factor] and all other inputs 0; a model whose speed
  /// is not one variable in m/s (the wheels of each side, say) says it itself.
  virtual void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept;

  /// False where `hessians` cannot be asked for; such a model can be used with Gauss-Newton only.
  virtual bool has_second_derivatives() const noexcept = 0;

  /// The instruction sets that this machine can run of those that the model was built for, slowest first; the last one
  /// is used. Tests walk through all of them by `use_instruction_set`, which answers false to an unknown name.
  virtual std::vector<std::string> instruction_sets() const { return {"generic"}; }
  virtual bool use_instruction_set(const std::string& name) { return name == "generic"; }
};

}  // namespace rhec
