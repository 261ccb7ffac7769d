#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/estimation/input_factors.hpp"
#include "rhec/core/estimation/input_guess.hpp"
#include "rhec/core/estimation/smoother.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/model/input_walk_model.hpp"

namespace rhec {

/// The inputs of a log that are not measured on some intervals, in the problem of the whole log: they walk there
/// (InputWalk), and what nothing tells from them is held (InputFactors), as in a filter. Where there are such inputs
/// the problem's model is an InputWalkModel, with the states [x; v]; else it is the vehicle itself.
class InputWalks {
 public:
  /// `setup`: of the vehicle's problem. Inputs without a weight are free anyway, and do not walk. Keeps a reference to
  /// the log.
  InputWalks(std::shared_ptr<const Model> vehicle, const RheProblem::Setup& setup, const NodeLog& log);

  bool is_empty() const noexcept { return inputs_.empty(); }
  const std::shared_ptr<const Model>& vehicle() const noexcept { return vehicle_; }
  std::ptrdiff_t count() const noexcept { return std::ssize(inputs_); }
  const std::shared_ptr<const Model>& model() const noexcept { return model_; }

  /// The vehicle's set-up for this model: bounds of inputs that walk are bounds of v.
  RheProblem::Setup setup(RheProblem::Setup of_vehicle) const;
  /// Makes an arrival cost of [x; ...] one of [x; v; ...].
  void add_start(Eigen::VectorXd& mean, Eigen::MatrixXd& information) const;
  /// Writes the model's data of an interval, and what its inputs are expected to be (n_u), where they are missing.
  /// `parameters` (n_p): the values of those that are held.
  void write(int interval, const double* parameters, double* data, double* measured);

  /// Of a guess, or a solution: v at a node, of the inputs that act on all intervals (n_u each).
  void write_kept(const std::vector<double>& acting, int node, double* v) const noexcept;
  /// Turns the inputs that act on an interval into the model's own, given v at its start.
  void to_own(int interval, const double* v, double* inputs) const noexcept;
  /// Turns the model's own inputs into those that act, given v at the interval's end.
  void to_acting(const double* v, double* inputs) const noexcept;

 private:
  struct Input {
    int input;
    InputWalk walk;
    double lower, upper;         ///< of all that is measured
    std::vector<double> sigmas;  ///< by how much it would walk on each interval, in those of the model's own input
  };
  bool is_missing(int interval, int input) const noexcept;

  std::shared_ptr<const Model> vehicle_, model_;
  const NodeLog& log_;
  const InputWalkModel* walking_ = nullptr;  ///< the model, if there are such inputs
  std::vector<Input> inputs_;
  InputFactors factors_;
};

}  // namespace rhec
