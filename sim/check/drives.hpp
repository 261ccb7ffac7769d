#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "model_checks.hpp"

namespace rhec::sim {

/// A drive over one horizon with the sensitivities of its intervals.
struct Drive {
  std::string name, meaning, unusable;
  Eigen::MatrixXd states, inputs;                 ///< columns: nodes, intervals
  std::vector<Eigen::MatrixXd> jacobians;         ///< by interval, dF/d[x; u; p] or dF/d[x; u; p; p_end]
  std::vector<Eigen::MatrixXd> output_jacobians;  ///< by node
  Eigen::MatrixXd outputs;                        ///< columns: nodes
};

/// Which unknown stands for a parameter on each interval.
struct DriveBlocks {
  std::vector<std::vector<int>> unknown;  ///< by parameter and interval, counted from 0
  std::vector<std::vector<bool>> ramp;    ///< the interval on which it runs to that value
  std::vector<int> parameter_of;          ///< by unknown
};

/// Typical drives of a model (straight ahead, a turn, a slalom, standing still), and what measurements along them tell.
class Drives {
 public:
  explicit Drives(const CheckedModel& checked);

  std::vector<Drive> all();
  DriveInformation information(const Drive& drive) const;
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
  /// The inputs of going straight on or standing; the speeds among the states go to `state`.
  Vector base_inputs(Course course, Vector& state) const;
  /// How far the inputs leave those of the straight drive: half of what there is room for, or of a scale. Of inputs
  /// that all make speed (the wheels of two sides), every other one by a part of it up or down.
  Vector excitation(const Vector& base) const;
  /// By how much states leave the inner half of their bounds (their scale, where they have none), in scales.
  double excess(const Vector& x) const;
  Vector moved(const Vector& x, const Vector& u) const;
  /// The inputs of interval k. What would drive a state too far (a steering angle, by its rate) is left out.
  Vector inputs_at(Course course, int k, const Vector& x, const Vector& base, const Vector& change) const;
  Drive drive(const CourseName& named);
  Matrix jacobian(const Vector& x, const Vector& u, int interval) const;
  void observe(Drive& made) const;

  /// Adds to `by_unknowns` (n_x rows) what an interval's parameters do to its end.
  void add_parameters(const Drive& drive, int interval, Eigen::Ref<Matrix> by_unknowns) const;
  std::string name_of_unknown(int unknown) const;
  /// Columns that span what is not determined, as short sums: each is made to have an unknown of its own.
  std::vector<std::string> combinations(Matrix null_space) const;

  const CheckedModel& checked_;
  const ModelDescription& about_;
  int nx_, nu_, np_, ny_, intervals_;
  std::vector<double> parameters_;
  bool makes_speed_ = false;
  double speed_ = 1.0;
  DriveBlocks blocks_;
};

}  // namespace rhec::sim
