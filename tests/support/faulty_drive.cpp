#include "support/faulty_drive.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Cholesky>

namespace rhec::testing {
namespace {

constexpr int samples_before = 60;
constexpr double within = 11.83;  // of two Gaussian variables with a probability of 99.73 %

int first_stable(const std::vector<Episode::Sample>& samples, const std::function<bool(const Episode::Sample&)>& good) {
  int last_bad = -1;
  for (std::size_t k = 0; k < samples.size(); ++k)
    if (!good(samples[k])) last_bad = static_cast<int>(k);
  return last_bad + 1;
}

/// A vehicle with the speed `roles.speed` and at most one other input, a rate of the steering angle `delta`.
class Truth {
 public:
  Truth(const Robot& robot, double phase) : model_(*robot.model()), step_(robot.step()), phase_(phase) {
    state.setZero(model_.state_count());
    inputs.assign(model_.input_count(), 0.0);
    parameters_.assign(model_.parameter_count(), 0.0);
    slopes_.assign(model_.state_count(), 0.0);
  }
  void advance(double speed, double fallen) {
    const ModelDescription& about = model_.description();
    const bool is_steered = about.roles.speed >= 0;
    for (std::size_t j = 0; j < parameters_.size(); ++j) {
      const double wave = std::sin(distance_ / 9.0 + static_cast<double>(j));
      // A share of what is asked for, or an angle by which the vehicle is pushed aside, or a share that is lost.
      const bool is_angle = about.parameters[j].unit == "rad";
      parameters_[j] = is_angle ? 0.05 * wave : is_steered ? 0.75 + 0.15 * wave : 0.1 + 0.05 * wave;
    }
    parameters_[0] -= fallen;
    if (is_steered)
      steer(speed);
    else
      turn(speed);
    constexpr int parts = 20;
    for (int i = 0; i < parts; ++i) {
      model_.rates(state.data(), inputs.data(), parameters_.data(), slopes_.data());
      for (Eigen::Index j = 0; j < state.size(); ++j) state[j] += slopes_[static_cast<std::size_t>(j)] * step_ / parts;
    }
    const bool is_share = is_steered && about.parameters[0].unit != "rad";
    distance_ += is_share ? speed * parameters_[0] * step_ : speed * step_;
    time_ += step_;
  }
  double slip() const { return parameters_[0]; }  ///< of the last interval
  Eigen::VectorXd state;
  std::vector<double> inputs;

 private:
  void steer(double speed) {
    const int driven = model_.description().roles.speed;
    for (std::size_t j = 0; j < inputs.size(); ++j) {
      const double wanted = 0.3 * std::sin(0.3 * time_ + phase_);
      inputs[j] =
          static_cast<int>(j) == driven ? speed : std::clamp(wanted - state[model_.state_count() - 1], -0.5, 0.5);
    }
  }
  /// By the wheels of its sides.
  void turn(double speed) {
    std::vector<double> at_rest(model_.state_count());
    model_.straight_motion(speed, parameters_.data(), at_rest.data(), inputs.data());
    const double share = 0.2 * std::sin(0.3 * time_ + phase_);
    inputs[0] *= 1.0 - share;
    inputs[1] *= 1.0 + share;
  }
  const Model& model_;
  double step_, phase_, time_ = 0.0, distance_ = 0.0;
  std::vector<double> parameters_, slopes_;
};

}  // namespace

double Episode::largest_error_during() const {
  double largest = 0.0;
  for (const Sample& sample : during) largest = std::max(largest, sample.error);
  return largest;
}

int Episode::samples_to_recover(double limit) const {
  return first_stable(after, [&](const Sample& sample) { return sample.error <= limit; });
}

double Episode::honest_share() const {
  std::size_t honest = 0;
  for (const std::vector<Sample>* part : {&during, &after})
    for (const Sample& sample : *part) honest += sample.inside || sample.health != HealthLevel::ok;
  return static_cast<double>(honest) / static_cast<double>(during.size() + after.size());
}

int Episode::samples_to_ok() const {
  return first_stable(after, [](const Sample& sample) { return sample.health == HealthLevel::ok; });
}

Episode drive_with_fault(const Robot& robot, const Fault& fault, std::uint64_t seed, int samples_after) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise;
  const Model& model = *robot.model();
  const Roles& roles = model.description().roles;
  Truth truth(robot, 0.7 * static_cast<double>(seed));
  const auto estimator = robot.make_estimator(truth.state);
  const double usual = roles.speed >= 0 ? 2.0 : 0.5;  // slow ones turn by their sides [m/s]
  const double speed = usual * static_cast<double>(1 + seed % 4);
  Episode episode;
  Delivery delivery;
  delivery.outputs.assign(model.output_count(), 0.0);
  for (int k = 0; k < samples_before + fault.length + samples_after; ++k) {
    const double time = 100.0 + k * robot.step();
    const int since = k - samples_before;
    const bool is_on = since >= 0 && since < fault.length;
    const double moved = since >= 0 ? fault.moved : 0.0;
    delivery.since = since;
    delivery.stamp = delivery.asked = time;
    delivery.has_outputs = delivery.has_inputs = true;
    delivery.sigmas.assign(delivery.outputs.size(), std::nan(""));
    model.observe({.count = 1, .states = truth.state.data(), .outputs = delivery.outputs.data()});
    for (std::size_t j = 0; j < delivery.outputs.size(); ++j)
      delivery.outputs[j] += robot.output_sigmas()[j] * noise(random);
    const Eigen::Vector2d place(truth.state[roles.position_x] + moved, truth.state[roles.position_y]);
    const double slip = truth.slip();
    truth.advance(speed, since >= fault.slip_after ? fault.slip : 0.0);
    delivery.inputs = truth.inputs;
    for (std::size_t j = 0; j < delivery.inputs.size(); ++j)
      delivery.inputs[j] += robot.input_sigmas()[j] * noise(random);
    delivery.outputs[0] += moved;
    if (is_on && fault.spoil) fault.spoil(delivery);
    if (delivery.has_outputs)
      estimator->push_measurement(delivery.stamp, delivery.outputs.data(), delivery.sigmas.data());
    const bool is_hurried = fault.is_hurried && since >= 0;
    const Estimate& estimate =
        estimator->estimate(delivery.asked, is_hurried ? Clock::now() : Clock::time_point::max());
    if (delivery.has_inputs) estimator->push_input(delivery.stamp, delivery.inputs.data());
    estimator->prepare();

    const Eigen::Vector2d error(estimate.state[roles.position_x] - place[0],
                                estimate.state[roles.position_y] - place[1]);
    Eigen::Matrix2d P;
    P << estimate.covariance(roles.position_x, roles.position_x),
        estimate.covariance(roles.position_x, roles.position_y),
        estimate.covariance(roles.position_y, roles.position_x),
        estimate.covariance(roles.position_y, roles.position_y);
    episode.is_finite = episode.is_finite && estimate.state.allFinite() && estimate.parameters.allFinite() &&
                        estimate.covariance.allFinite();
    std::vector<Episode::Sample>& part = since < 0 ? episode.before : is_on ? episode.during : episode.after;
    part.push_back({error.norm(), error.dot(P.ldlt().solve(error)) < within, estimate.health.level,
                    estimator->watch() ? estimator->watch()->in_words(estimate.health) : "",
                    estimate.parameters[0] - slip,
                    std::sqrt(estimate.covariance(model.state_count(), model.state_count()))});
  }
  episode.counts = estimator->counts();
  return episode;
}

}  // namespace rhec::testing
