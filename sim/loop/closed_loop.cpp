#include "rhec/sim/loop/closed_loop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "consistency.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/sim/loop/loop_world.hpp"
#include "rhec/sim/world/truth_estimator.hpp"

namespace rhec::sim {
namespace {

// A vehicle farther than this from its path is lost [m].
constexpr double lost = 50.0;
// A robot that takes itself to be at the end of its path is there if its estimate is no farther off than this, and the
// vehicle no farther beside the path [m]: far more than one that is right errs by, or one that lags behind.
constexpr double most_off = 5.0, most_beside = 10.0;

/// Sums of absolute and squared errors.
class Errors {
 public:
  explicit Errors(const ModelDescription& about) : about_(about), parameters_(about.parameters.size()) {}
  void add(const Sample& sample) {
    ++count_;
    const Roles& roles = about_.roles;
    for (std::size_t j = 0; j < parameters_.size(); ++j)
      parameters_[j].add(sample.parameters[j] - sample.true_parameters[j]);
    position_.add(std::hypot(sample.state[roles.position_x] - sample.true_state[roles.position_x],
                             sample.state[roles.position_y] - sample.true_state[roles.position_y]));
    if (roles.heading >= 0)
      heading_.add(angle_difference(sample.state[roles.heading], sample.true_state[roles.heading]));
    tracking_.add(sample.tracking);
  }
  ErrorSummary absolute() const {
    return make([this](const Sum& sum) { return sum.absolute / static_cast<double>(count_); });
  }
  ErrorSummary root_mean_square() const {
    return make([this](const Sum& sum) { return std::sqrt(sum.squared / static_cast<double>(count_)); });
  }

 private:
  struct Sum {
    double absolute = 0.0, squared = 0.0;
    void add(double error) {
      absolute += std::abs(error);
      squared += error * error;
    }
  };
  template <class Function>
  ErrorSummary make(const Function& value_of) const {
    ErrorSummary summary;
    for (std::size_t j = 0; j < parameters_.size(); ++j)
      summary.parameters[about_.parameters[j].name] = value_of(parameters_[j]);
    summary.position = value_of(position_);
    summary.heading = value_of(heading_);
    summary.tracking = value_of(tracking_);
    return summary;
  }
  const ModelDescription& about_;
  std::vector<Sum> parameters_;
  Sum position_, heading_, tracking_;
  std::int64_t count_ = 0;
};

Spread spread_of_times(std::vector<double> times) {
  return times.empty() ? Spread{0.0, 0.0, 0.0} : spread_of(std::move(times));
}

/// Counts the states and parameters whose truth is within two standard deviations.
void count_inside(const Sample& sample, const ModelDescription& about, std::vector<std::int64_t>& inside) {
  const auto states = static_cast<Eigen::Index>(about.states.size());
  for (Eigen::Index j = 0; j < std::ssize(inside); ++j) {
    const bool is_state = j < states;
    double error = is_state ? sample.state[j] - sample.true_state[j]
                            : sample.parameters[j - states] - sample.true_parameters[j - states];
    if (is_state && about.states[j].is_angle) error = angle_difference(sample.state[j], sample.true_state[j]);
    inside[j] += std::abs(error) <= 2.0 * sample.sigma[j];
  }
}

/// A step of a controller that takes few of them keeps a limit this well, in its unit.
constexpr double kept = 1e-3;

void take_violations(const Controller& controller, std::map<std::string, LimitRecord>& limits) {
  const Controller::Command& command = controller.command();
  const TermFunctions* const terms = controller.problem().terms().functions();
  for (std::size_t j = 0; j < command.violations.size(); ++j) {
    LimitRecord& record = limits[terms->limit_names()[j]];
    record.violated += command.violations[j] > kept;
    record.most = std::max(record.most, command.violations[j]);
  }
}

}  // namespace

RunLog run_closed_loop(const Scenario& scenario, const LoopHooks& hooks) {
  std::int64_t k = 0;
  Robot robot = with_hooks(scenario.robot(), hooks, [&k] { return k; });
  const Model& model = *robot.model();
  const Roles& roles = model.description().roles;
  LoopWorld world(scenario, noise_of(robot));
  const TruthVehicle& truth = world.truth();
  const Sensors& sensors = world.sensors();
  robot.use_estimators(scenario_estimators(&truth));
  const auto estimator = robot.make_estimator(scenario.initial_state());
  const auto controller = robot.make_controller(scenario.path(), estimator->slip_ahead());
  PathFollower true_follower(scenario.path());

  const double step = robot.step();
  // Three times the path's nominal duration, enough for a vehicle that lags behind its literal reference.
  const auto limit = static_cast<std::int64_t>(3.0 * scenario.path().duration() / step) + 100;
  Consistency consistency(robot.estimated_description());
  int path_segment = 0;
  // By its place alone a start on a later lap, or on the other branch of a crossing, is not to be known.
  true_follower.reset(scenario.start());
  controller->locate(scenario.start());
  RunLog log;
  log.samples.reserve(static_cast<std::size_t>(limit));
  const auto begin = [&hooks](LoopPart part) {
    if (hooks.begins) hooks.begins(part);
  };
  begin(LoopPart::simulate);
  for (;; ++k) {
    const double time = static_cast<double>(k) * step;
    world.measure(time);
    begin(LoopPart::estimate);
    world.deliver(time, [&](double stamp, const double* outputs) {
      estimator->push_measurement(stamp, outputs);
      if (hooks.measured) hooks.measured(world.on_robots_clock(time), stamp, outputs);
    });
    const Estimate& estimate = estimator->estimate(world.on_robots_clock(time));
    begin(LoopPart::control);
    const Controller::Command& command = controller->control(estimate);
    begin(LoopPart::log_sample);
    true_follower.advance_with(controller->follower(), truth.state()[roles.position_x],
                               truth.state()[roles.position_y]);

    Sample sample;
    sample.step = k;
    sample.time = time;
    sample.true_state.resize(truth.state().size() + sensors.errors().size());
    sample.true_state << truth.state(), sensors.errors();
    sample.true_parameters = truth.parameters();
    // Behind the biases and scale errors there are values of motion, which are no result.
    sample.state = sample.true_state;
    const Eigen::Index known = std::min(estimate.state.size(), sample.state.size());
    sample.state.head(known) = estimate.state.head(known);
    sample.parameters = estimate.parameters;
    consistency.write(estimate.covariance, sample);
    sample.inputs = command.inputs;
    sample.reference = command.reference;
    sample.tracking = true_follower.lateral();
    if (roles.heading >= 0)
      sample.heading_error = angle_difference(
          truth.state()[roles.heading], scenario.path().point_at(true_follower.arc_length(), path_segment).heading);
    sample.estimator_status = estimate.report.status;
    sample.controller_status = command.report.status;
    sample.estimator_fallback = estimate.fallback;
    sample.controller_fallback = command.fallback;
    sample.relaxed = command.relaxed;
    sample.health = estimate.health.level;
    if (estimate.health.level != HealthLevel::ok && estimator->watch())
      sample.findings = estimator->watch()->in_words(estimate.health);
    sample.faults = world.take_faults();
    sample.estimator_us = estimate.report.preparation_us + estimate.report.feedback_us;
    sample.estimator_feedback_us = estimate.report.feedback_us;
    sample.controller_us = command.report.preparation_us + command.report.feedback_us;
    log.samples.push_back(std::move(sample));
    if (hooks.sampled) hooks.sampled({k, time, estimator.get(), &estimate, controller.get(), &command});
    if (hooks.progress) hooks.progress(std::min(1.0, true_follower.arc_length() / scenario.path().length()));

    // By where it is, or by what the robot knows.
    if (true_follower.finished() || controller->finished()) {
      const double off = std::hypot(truth.state()[roles.position_x] - estimate.state[roles.position_x],
                                    truth.state()[roles.position_y] - estimate.state[roles.position_y]);
      const double beside = std::abs(true_follower.lateral());
      if (!true_follower.finished() && !(off < most_off)) {
        log.ended = fmt::format("the robot takes itself to be at the end of the path, and is {:.3g} m off", off);
      } else if (!(beside < most_beside)) {
        log.ended = fmt::format("the vehicle has passed the end of the path {:.3g} m beside it", beside);
      } else {
        log.completed = true;
        log.ended = "the end of the path was reached";
      }
      break;
    }
    if (!(std::abs(true_follower.lateral()) < lost)) {
      log.ended = "the vehicle left its path and was lost";
      break;
    }
    if (k >= limit) {
      log.ended = command.faces_away ? "the vehicle stands, facing away from the path"
                  : command.stands   ? "the vehicle stands where its path goes on; what keeps it from that is in its "
                                       "way, or one of its limits"
                                     : "the vehicle took more than three times as long as it should have";
      break;
    }
    begin(LoopPart::simulate);
    world.drive(command.inputs, time, step);
    if (!truth.state().allFinite() || !truth.parameters().allFinite()) {
      log.ended =
          "the true vehicle moves faster than numbers can say; expected slip, options and bounds nearer to what it can "
          "do";
      break;
    }
    const std::vector<double>& measured = world.measured_inputs(command.inputs);
    begin(LoopPart::prepare_control);
    controller->prepare();
    take_violations(*controller, log.limits);
    begin(LoopPart::prepare_estimate);
    estimator->push_input(world.on_robots_clock(time), measured.data());
    if (hooks.moved) hooks.moved(world.on_robots_clock(time), measured.data());
    estimator->prepare();
    begin(LoopPart::simulate);
  }
  controller->finish();
  take_violations(*controller, log.limits);
  estimator->end_drive();
  const std::vector<Variable>& about_outputs = model.description().outputs;
  for (std::size_t j = 0; j < about_outputs.size(); ++j)
    if (const auto noise = estimator->method().output_noise(static_cast<int>(j)))
      log.noise[about_outputs[j].name] = *noise;
  log.counts = estimator->counts();
  begin(LoopPart::end);
  return log;
}

Certainty certainty_of(const RunSummary& summary) noexcept {
  if (!std::isfinite(summary.nees)) return Certainty::unknown;
  const bool covers = std::all_of(summary.within_two_sigma.begin(), summary.within_two_sigma.end(),
                                  [](const auto& share) { return share.second >= least_share; });
  if (summary.nees > most_nees * summary.nees_expected || !covers) return Certainty::too_certain;
  return summary.nees < least_nees * summary.nees_expected ? Certainty::too_cautious : Certainty::right;
}

std::string_view name_of(Certainty certainty) noexcept {
  switch (certainty) {
    case Certainty::too_certain:
      return "too certain";
    case Certainty::right:
      return "right";
    case Certainty::too_cautious:
      return "too cautious";
    case Certainty::unknown:
      break;
  }
  return "";
}

RunSummary summarise(const RunLog& log, const Scenario& scenario) {
  const ModelDescription& about = scenario.robot().estimated_description();
  RunSummary summary;
  summary.steps = static_cast<std::int64_t>(log.samples.size());
  summary.completed = log.completed;
  summary.ended = log.ended;
  Errors all(about), after_start(about);
  std::vector<double> estimator_us, controller_us;
  std::map<Status, std::int64_t> estimator_statuses, controller_statuses;
  double nees = 0.0;
  std::int64_t with_nees = 0;
  std::vector<std::int64_t> inside(about.states.size() + about.parameters.size(), 0);
  const bool solves_estimation = scenario.robot().estimator_options().name == "rhe";
  for (const Sample& sample : log.samples) {
    all.add(sample);
    if (sample.step >= scenario.robot().estimator_options().horizon) after_start.add(sample);
    if (std::isfinite(sample.nees)) {
      nees += sample.nees;
      ++with_nees;
      count_inside(sample, about, inside);
    }
    if (solves_estimation) {
      estimator_us.push_back(sample.estimator_us);
      ++estimator_statuses[sample.estimator_status];
      summary.fallbacks += sample.estimator_fallback;
      ++summary.solves;
    }
    ++summary.health[name_of(sample.health)];
    controller_us.push_back(sample.controller_us);
    ++controller_statuses[sample.controller_status];
    summary.fallbacks += sample.controller_fallback;
    ++summary.solves;
  }
  for (const auto& [status, count] : estimator_statuses) summary.estimator_statuses[name_of(status)] = count;
  for (const auto& [status, count] : controller_statuses) summary.controller_statuses[name_of(status)] = count;
  summary.mae = all.absolute();
  summary.rmse = all.root_mean_square();
  summary.mae_after_start = after_start.absolute();
  summary.nees = with_nees > 0 ? nees / static_cast<double>(with_nees) : std::numeric_limits<double>::quiet_NaN();
  summary.nees_expected = static_cast<int>(inside.size());
  for (std::size_t j = 0; j < inside.size() && with_nees > 0; ++j) {
    const std::size_t states = about.states.size();
    const Variable& variable = j < states ? about.states[j] : about.parameters[j - states];
    summary.within_two_sigma[variable.name] = static_cast<double>(inside[j]) / static_cast<double>(with_nees);
  }
  summary.certainty = certainty_of(summary);
  summary.noise = log.noise;
  summary.counts = log.counts;
  summary.limits = log.limits;
  summary.estimator_us = spread_of_times(std::move(estimator_us));
  summary.controller_us = spread_of_times(std::move(controller_us));
  return summary;
}

}  // namespace rhec::sim
