#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/motion_outputs.hpp"
#include "rhec/sim/numbers/random.hpp"
#include "rhec/sim/world/slip_field.hpp"

namespace rhec::sim {

struct TruthOptions {
  double step = 0.01;  ///< Runge-Kutta step [s]: at most 20 in an interval of 0.2 s; shorter where a model's formula
                       ///< has time constants that ask for it
  bool mechanical_stops = true;  ///< bounded states (the steering angle) cannot leave their bounds, whatever the input
  /// Process noise of each state, in its unit per square root of a second; empty: none.
  std::vector<double> noise = {};
  std::uint64_t seed = 0;  ///< of that noise
};

/// The simulated true vehicle:
///
///     dx/dt = f(x, u, p(x)),      p(x) the slip field at the vehicle's position
///
/// integrated with classical Runge-Kutta steps that look up the slip at each stage; the input is held between two
/// calls. On smooth ground, away from the stops, one step replaces up to five if the difference from the embedded
/// third-order method is below 1e-8 of every state's typical magnitude. What disturbs a state is added at the end of
/// each `advance`: white noise whose variance grows with the duration. `advance` does not allocate or throw.
class RHEC_EXPORT TruthVehicle {
 public:
  /// `model` and `field` must outlive the vehicle. Throws Error if the field does not have one channel per parameter,
  /// if the model has no position, or if the initial state has the wrong size, is not finite or violates its bounds,
  /// or if the model has a time constant below some 1e-5 s.
  TruthVehicle(const Model& model, const SlipField& field, const Eigen::VectorXd& initial_state,
               const TruthOptions& options = {});

  /// Advances by `duration` [s] with constant inputs.
  void advance(const double* inputs, double duration) noexcept;

  double time() const noexcept { return time_; }  ///< since the start [s]
  const Eigen::VectorXd& state() const noexcept { return state_; }
  /// Slip at the current position.
  const Eigen::VectorXd& parameters() const noexcept { return parameters_; }
  /// Time average of the slip over the last `advance`: the true value of a parameter that is constant over that
  /// interval.
  const Eigen::VectorXd& mean_parameters() const noexcept { return mean_parameters_; }

 private:
  void shorten_steps();
  void disturb(double duration) noexcept;
  void look_up(const double* state, double* parameters) const noexcept;
  bool stop(double* state) const noexcept;
  bool step(const double* inputs, double duration, bool must_fit) noexcept;

  const Model* model_;
  const SlipField* field_;
  TruthOptions options_;
  std::vector<RandomStream> noise_;
  int position_x_ = -1, position_y_ = -1;
  Eigen::VectorXd lower_, upper_, scales_;
  double time_ = 0.0;
  Eigen::VectorXd state_, parameters_, mean_parameters_;
  Eigen::VectorXd rates_, stage_state_, stage_parameters_, stage_rates_, end_rates_, sum_rates_;
  Eigen::VectorXd step_parameters_, sum_parameters_;
};

/// What a sensor adds to its output: the standard deviation from which it is drawn, and that of its random walk, per
/// square root of a second. Zeros: nothing.
struct SensorDrift {
  double sigma = 0.0, drift = 0.0;
};

/// Standard deviations of the measurement noise, in the units of the model's outputs and inputs; empty: no noise.
struct SensorNoise {
  std::vector<double> outputs;
  std::vector<double> inputs;
  std::vector<SensorDrift> biases = {}, scales = {};  ///< by output; empty: none
};

/// Sensors with Gaussian noise, biases and scale errors. Every output and input has its own random stream, named after
/// it, so that adding, removing or reading a sensor less often does not change the noise of the others; and each bias
/// and scale error has one.
class RHEC_EXPORT Sensors {
 public:
  /// `model` must outlive the sensors. Throws Error for a wrong number of standard deviations or for a negative one.
  Sensors(const Model& model, const SensorNoise& noise, std::uint64_t seed);

  /// The motion that has led to a state: the input held until then, and the slip there.
  struct Motion {
    const double* inputs;
    const double* parameters;
  };
  /// outputs = (1 + k) h + b + noise. Outputs of motion (MotionOutputs) are NaN without `motion`, as at the start. Does
  /// not allocate or throw.
  void observe(const double* state, double* outputs, const Motion* motion = nullptr) noexcept;
  /// Biases and scale errors drift. Does not allocate or throw.
  void advance(double duration) noexcept;
  /// The true biases, then the true scale errors, of the outputs that have them.
  const Eigen::VectorXd& errors() const noexcept { return errors_; }
  /// measured = inputs + noise; `measured` may be `inputs`.
  void measure_inputs(const double* inputs, double* measured) noexcept;

 private:
  struct Channel {
    double sigma;
    RandomStream random;
  };
  struct Walk {
    int output;
    double drift;
    RandomStream random;
  };
  const Model* model_;
  MotionOutputs motion_;
  std::vector<Channel> outputs_, inputs_;
  std::vector<Walk> walks_;    ///< of biases, then of scale errors
  std::ptrdiff_t biases_ = 0;  ///< how many of them are biases
  Eigen::VectorXd errors_, values_;
};

}  // namespace rhec::sim
