#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "model_checks.hpp"
#include "rhec/core/model/motion_outputs.hpp"

namespace rhec::sim {

/// A drive over one horizon, with the sensitivities of each interval.
struct Drive {
  std::string name, meaning, unusable;
  Eigen::MatrixXd states, inputs;                 ///< one column per node, one per interval
  std::vector<Eigen::MatrixXd> jacobians;         ///< by interval, dF/d[x; u; p] or dF/d[x; u; p; p_end]
  std::vector<Eigen::MatrixXd> output_jacobians;  ///< by node, of the outputs of the state
  std::vector<Eigen::MatrixXd> motion_jacobians;  ///< by interval, at its end: dh/d[x; u; p] of the outputs of motion
  Eigen::MatrixXd outputs;                        ///< one column per node
};

/// The unknown that represents a parameter on each interval.
struct DriveBlocks {
  std::vector<std::vector<int>> unknown;  ///< by parameter and interval, zero-based
  std::vector<std::vector<bool>> ramp;    ///< true: the parameter ramps to that value over the interval
  std::vector<int> parameter_of;          ///< by unknown
};

/// Typical drives of a model (straight ahead, turn, slalom, standstill) and the information in their measurements.
class Drives {
 public:
  explicit Drives(const CheckedModel& checked);

  std::vector<Drive> all();
  /// The square root of the information about the unknowns of a drive [state; errors; blocks of parameters], in scales.
  /// `errors`: of the sensors' errors that are among the unknowns.
  struct Root {
    std::string unusable;
    int errors = 0;
    Eigen::MatrixXd matrix;
    Eigen::VectorXd scales;
  };
  /// With or without the errors of sensors that the options name among the unknowns.
  Root root(const Drive& drive, bool with_errors) const;
  /// What a drive tells of the errors of sensors whatever its own start and slip are: a square root of that, in scales.
  Eigen::MatrixXd about_errors(const Root& root) const;
  /// `elsewhere`: rows that other drives of the same sensors add about their errors, of `about_errors`.
  DriveInformation information(const Drive& drive, const Root& root, const Eigen::MatrixXd& elsewhere = {}) const;
  /// "yaw_rate_bias", "ground_speed_scale": the errors in the order of DriveInformation::error_sigma.
  std::vector<std::string> names_of_errors() const;
  /// The largest condition number of the Jacobians of F along a drive, in scales.
  double condition_of_jacobians(const Drive& drive) const;
  double duration() const { return intervals_ * checked_.options.interval; }

 private:
  using Matrix = Eigen::MatrixXd;
  using Vector = Eigen::VectorXd;
  enum class Course { straight, turn, slalom, standing };
  struct CourseName {
    Course course;
    const char *name, *meaning;
  };
  static constexpr CourseName courses[] = {
      {Course::straight, "straight", "straight ahead"},
      {Course::turn, "turn", "a steady turn"},
      {Course::slalom, "slalom", "left and right in turn"},
      {Course::standing, "standing", "standing still"},
  };

  void find_blocks();
  /// Inputs for driving straight ahead or standing still; writes the speeds among the states to `state`.
  Vector base_inputs(Course course, Vector& state) const;
  /// Deviation of the inputs from the straight drive: half the room to a bound or half a scale, whichever is smaller.
  /// If all inputs produce speed (left and right wheels), every other one is raised or lowered by a fraction of it.
  Vector excitation(const Vector& base) const;
  /// How far states are outside the inner half of their bounds (or beyond their scale if unbounded), in scales. Where
  /// the drive itself begins outside, as with a speed near a bound, as far again is inside.
  double excess(const Vector& x) const;
  Vector moved(const Vector& x, const Vector& u) const;
  /// The inputs of interval k. Omits excitation that would drive a state too far (a steering angle, through its rate).
  Vector inputs_at(Course course, int k, const Vector& x, const Vector& base, const Vector& change) const;
  Drive drive(const CourseName& named);
  Matrix jacobian(const Vector& x, const Vector& u, int interval) const;
  void observe(Drive& made) const;

  /// Adds the sensitivity of an interval's end state to its parameters to `by_unknowns` (n_x rows).
  void add_parameters(const Drive& drive, int interval, int first, Eigen::Ref<Matrix> by_unknowns) const;
  std::string name_of_unknown(int unknown, int errors) const;
  /// The undetermined subspace as short linear combinations, each reduced so that it has an unknown of its own.
  std::vector<std::string> combinations(Matrix null_space, int errors) const;

  const CheckedModel& checked_;
  const ModelDescription& about_;
  int nx_, nu_, np_, ny_, intervals_;
  std::vector<double> parameters_;
  bool makes_speed_ = false;
  double speed_ = 1.0;
  DriveBlocks blocks_;
  Vector start_;  ///< the state that a drive begins with
  MotionOutputs motion_;
};

}  // namespace rhec::sim
