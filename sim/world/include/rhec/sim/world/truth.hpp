#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/sim/numbers/random.hpp"
#include "rhec/sim/world/slip_field.hpp"

namespace rhec::sim {

struct TruthOptions {
  double step = 0.01;            ///< Runge-Kutta step [s]: at most 20 in an interval of 0.2 s
  bool mechanical_stops = true;  ///< a state with bounds (the steering angle) cannot leave them, whatever the input
};

/// The vehicle as it really moves:
///
///     dx/dt = f(x, u, p(x)),      p(x) the slip field at the vehicle's position
///
/// by classical Runge-Kutta steps that look up the slip at each of their stages, with the input held between two calls.
/// On smooth ground, away from its stops, up to five steps are made at once where the difference to the embedded method
/// of third order is below 1e-8 of every state's typical magnitude.
/// `advance` does not allocate or throw.
class RHEC_EXPORT TruthVehicle {
 public:
  /// `model` and `field` must outlive the vehicle. Throws Error if the field has not one channel per parameter, if the
  /// model has no position, or if the initial state has another size, is not finite or lies outside its bounds.
  TruthVehicle(const Model& model, const SlipField& field, const Eigen::VectorXd& initial_state,
               const TruthOptions& options = {});

  /// Drives on for a time [s] with the inputs held.
  void advance(const double* inputs, double duration) noexcept;

  double time() const noexcept { return time_; }  ///< since the start [s]
  const Eigen::VectorXd& state() const noexcept { return state_; }
  /// The slip at the present position.
  const Eigen::VectorXd& parameters() const noexcept { return parameters_; }
  /// The mean over time of the slip along the last `advance`: what a parameter held over that interval should be.
  const Eigen::VectorXd& mean_parameters() const noexcept { return mean_parameters_; }

 private:
  void look_up(const double* state, double* parameters) const noexcept;
  bool stop(double* state) const noexcept;
  bool step(const double* inputs, double duration, bool must_fit) noexcept;

  const Model* model_;
  const SlipField* field_;
  TruthOptions options_;
  int position_x_ = -1, position_y_ = -1;
  Eigen::VectorXd lower_, upper_, scales_;
  double time_ = 0.0;
  Eigen::VectorXd state_, parameters_, mean_parameters_;
  Eigen::VectorXd rates_, stage_state_, stage_parameters_, stage_rates_, end_rates_, sum_rates_;
  Eigen::VectorXd step_parameters_, sum_parameters_;
};

/// Standard deviations of what is measured, in the units of the model's outputs and inputs; empty: no noise.
struct SensorNoise {
  std::vector<double> outputs;
  std::vector<double> inputs;
};

/// Measures with Gaussian noise. Every output and input has a random stream of its own, named after it, so that a
/// sensor more or less, or one that is read less often, leaves the noise of the others as it was.
class RHEC_EXPORT Sensors {
 public:
  /// `model` must outlive the sensors. Throws Error for a wrong number of standard deviations or a negative one.
  Sensors(const Model& model, const SensorNoise& noise, std::uint64_t seed);

  /// outputs = h(state) + noise. Does not allocate or throw.
  void observe(const double* state, double* outputs) noexcept;
  /// measured = inputs + noise; `measured` may be `inputs`.
  void measure_inputs(const double* inputs, double* measured) noexcept;

 private:
  struct Channel {
    double sigma;
    RandomStream random;
  };
  const Model* model_;
  std::vector<Channel> outputs_, inputs_;
};

}  // namespace rhec::sim
