#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/stage_rows.hpp"

namespace rhec {

struct VehicleGraph;

/// One component of a model's state, input, parameter or output.
struct Variable {
  std::string name;                                         ///< as spelt in configuration and in result files
  std::string unit;                                         ///< SI, e.g. "m", "rad/s"; "1" for a pure number
  std::string meaning;                                      ///< short description for users
  double lower = -std::numeric_limits<double>::infinity();  ///< default bound
  double upper = std::numeric_limits<double>::infinity();   ///< default bound
  double scale = 1.0;     ///< a typical magnitude: for finite differences, and how far a missing input walks in 1 s
  bool is_angle = false;  ///< differences are taken on the circle
  double nominal = 1.0;   ///< of a parameter: its value without slip
  bool usual = true;      ///< of an output: measured by default
  /// Of an output: how many before it measure the same (`with_outputs`); each is of another device.
  std::uint8_t device = 0;
};

/// The names of variables, in their order.
RHEC_EXPORT std::vector<std::string> names_of(const std::vector<Variable>& variables);
/// The values of parameters without slip.
RHEC_EXPORT std::vector<double> nominal_values(const std::vector<Variable>& parameters);
/// The middle of a parameter's bounds; of one without bounds its value without slip.
RHEC_EXPORT double middle_value(const Variable& parameter);

/// Which variables hold the vehicle's position and speed; -1 if the model has none. The dynamics depend neither on the
/// position nor on a common rotation of all headings: a vehicle that is shifted and rotated as a whole moves as before.
struct RHEC_EXPORT Roles {
  int position_x = -1;                   ///< state: x of the point that follows the path [m]
  int position_y = -1;                   ///< state: y of that point [m]
  int heading = -1;                      ///< state: direction of travel at that point [rad]
  int speed = -1;                        ///< input: wheel speed [m/s]
  int speed_state = -1;                  ///< state: wheel speed of a vehicle whose input is an acceleration [m/s]
  int speed_factor = -1;                 ///< parameter: ground speed / wheel speed [1]
  std::vector<int> other_headings = {};  ///< states: headings of further bodies, e.g. the tractor of a trailer [rad]

  /// Places the point that follows the path at (x, y) [m], with all bodies aligned in `direction` [rad].
  void place(double x, double y, double direction, double* state) const noexcept;
  /// Rotates all bodies by an angle [rad] about the point that follows the path.
  void turn(double angle, double* state) const noexcept;
};

struct ModelDescription {
  std::string name;
  std::string source;  ///< where the equations were published
  std::vector<Variable> states, inputs, parameters, outputs;
  Roles roles;
  /// Of a model that makes another one's parameters states: where these are, in their order; else empty.
  std::vector<int> parameter_states = {};
  /// Of a model with process noise (StateNoiseModel): the states whose noise the inputs behind the vehicle's own are,
  /// in their order; else empty. Nothing measures or commands these inputs, and they are expected to be 0.
  std::vector<int> noisy_states = {};
  /// The same for noises that are parameters, the last ones, so that intervals can share a value of theirs.
  std::vector<int> blocked_noises = {};
};

/// How a vehicle moves and what its sensors measure:
///
///     dx/dt = f(x, u, p),    y = h(x)
///
/// with state x (n_x), input u (n_u), parameter p (n_p) and output y (n_y). Between two nodes the input is constant,
/// and x_{i+1} = F(x_i, u_i, p_i, dt_i) is computed by steps of an integrator. All calls are const and
/// thread-safe, and neither allocate nor throw. They take a range of stages, so that an implementation may evaluate
/// several at once.
class RHEC_EXPORT Model {
 public:
  virtual ~Model() = default;

  virtual const ModelDescription& description() const noexcept = 0;
  int state_count() const noexcept { return static_cast<int>(description().states.size()); }
  int input_count() const noexcept { return static_cast<int>(description().inputs.size()); }
  int parameter_count() const noexcept { return static_cast<int>(description().parameters.size()); }
  int output_count() const noexcept { return static_cast<int>(description().outputs.size()); }
  /// n_d: numbers of an interval that its dynamics depend on, and that are known instead of estimated or decided.
  virtual int data_count() const noexcept { return 0; }

  /// One request to `integrate`. Row i of an array belongs to interval i of the range; rows are dense. A null result
  /// pointer means 'not requested'.
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
    const double* data = nullptr;            ///< count x n_d
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

  /// The same on the padded rows that solvers use (IntervalRows, NodeRows). By default these gather the rows, call the
  /// functions above and scatter the results; FormulaModel computes in place.
  virtual void integrate_rows(const IntervalRows& request) const noexcept;
  virtual void observe_rows(const NodeRows& request) const noexcept;
  /// Number of doubles of scratch that these two need for `count` rows.
  virtual std::size_t rows_scratch(int count) const noexcept;

  /// dx/dt at one point, for other integrators (e.g. the true vehicle of a simulation).
  virtual void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept = 0;

  /// Straight motion at a ground speed [m/s] with the slip parameters p, as needed for the path's reference: writes all
  /// inputs (n_u) and those states that are speeds. By default the wheel speed (`roles.speed` or `roles.speed_state`)
  /// becomes ground_speed / p[roles.speed_factor] and all other inputs 0. A model whose speed is not a single variable
  /// in m/s (e.g. one wheel speed per side) overrides this.
  virtual void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept;

  /// What one Runge-Kutta step takes for one interval, in operations on eight numbers at a time; zeros where that is
  /// not known. Each comes with what stands before it.
  struct Operations {
    double values = 0.0, jacobians = 0.0, hessians = 0.0;
  };
  virtual Operations operations() const noexcept { return {}; }

  /// False if `hessians` are not available; such a model can be used with Gauss-Newton only.
  virtual bool has_second_derivatives() const noexcept = 0;

  /// The instruction sets that the model was built for and that this machine can run, slowest first; the last one is
  /// used. Tests select each of them by `use_instruction_set`, which returns false for an unknown name.
  virtual std::vector<std::string> instruction_sets() const { return {"generic"}; }
  virtual bool use_instruction_set(const std::string& name) { return name == "generic"; }

  /// The formula as a graph (rhec/core/model/vehicle_graph.hpp), with names and nothing but what rates and outputs are
  /// computed of: for those who look at a model, not for its evaluation. Null if the model has none.
  virtual const VehicleGraph* graph() const noexcept { return nullptr; }
};

}  // namespace rhec
