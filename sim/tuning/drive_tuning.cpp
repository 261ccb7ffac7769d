#include "rhec/sim/tuning/drive_tuning.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/tuning/innovations.hpp"
#include "rhec/sim/tuning/precision.hpp"
#include "rhec/sim/tuning/search.hpp"
#include "rhec/sim/world/truth_estimator.hpp"
#include "scenario_text.hpp"

namespace rhec::sim {
namespace {

using Seconds = std::chrono::duration<double>;

/// From here on a number is little more certain than before.
constexpr double certain_below = 0.5;

Settings with_filter(Settings settings) {
  settings.set("estimator.name", Settings::scalar("ekf"));
  // A window's sections are none of a filter's.
  settings.set("blocking", Settings::null());
  settings.set("smoother", Settings::null());
  return settings;
}

Robot robot_of(const Host& host, const Settings& settings) {
  return {host, ReplayOptions::table().parse(settings, "scenario"), scenario_estimators()};
}

std::vector<Innovation> innovations_of(const DriveReplay& replay) {
  std::vector<Innovation> innovations;
  innovations.reserve(replay.innovations.size());
  for (const DriveInnovation& each : replay.innovations)
    innovations.push_back(
        {.size = static_cast<int>(each.values.size()), .squared = each.nis, .log_determinant = each.log_determinant});
  return innovations;
}

/// Replays a drive with numbers that are looked for.
class Tuner {
 public:
  Tuner(const Host& host, const Settings& settings, const logs::Drive& drive, const DriveTuningOptions& options,
        const TuningHooks& hooks)
      : host_(host), settings_(settings), drive_(drive), options_(options), hooks_(hooks) {
    if (settings.find("path")) start_ = Scenario(host, settings).initial_state();
    const Robot robot = robot_of(host, settings);
    const DriveReplay first = replay(with_filter(settings));
    result_.measurements = static_cast<int>(first.innovations.size());
    if (result_.measurements < least_fixes)
      throw Error(fmt::format("the log has {} measurements that can be judged; expected at least {} to tune on{}",
                              result_.measurements, least_fixes,
                              !robot.estimator_options().health.watch ? "; estimator.health.watch is false" : ""));
    tunables_ = drive_tunables(host, robot, settings, first.sensors, options.wishes);
    if (tunables_.empty()) throw Error("--keep leaves nothing to tune");
  }

  DriveTuning run() {
    const Eigen::Index n = std::ssize(tunables_);
    SearchOptions search{
        .lower = Eigen::VectorXd(n), .upper = Eigen::VectorXd(n), .step = Eigen::VectorXd::Constant(n, 0.3)};
    for (Eigen::Index i = 0; i < n; ++i) {
      const Tunable& tunable = tunables_[static_cast<std::size_t>(i)];
      search.lower[i] = tunable.coordinate_of(tunable.lower);
      search.upper[i] = tunable.coordinate_of(tunable.upper);
    }
    search.most_evaluations = 40 * static_cast<int>(n);
    search.threads = options_.threads;
    search.stop = [this] { return is_over(); };
    const Objective objective = [this](const Eigen::VectorXd& at) { return log_posterior(at); };
    start_value_ = log_posterior(Eigen::VectorXd::Zero(n));
    const Maximum found = maximise(
        objective, {Eigen::VectorXd::Zero(n), Eigen::VectorXd::Constant(n, 0.2).cwiseMax(search.lower)}, search);
    result_.log_likelihood_before = likelihood(Eigen::VectorXd::Zero(n)).total;
    result_.log_likelihood_after = likelihood(found.at).total;
    write_numbers(found.at, search);
    judge(found.at);
    result_.evaluations = evaluations_;
    result_.stopped = found.stopped;
    result_.seconds = seconds();
    return std::move(result_);
  }

 private:
  double seconds() const { return Seconds(Clock::now() - begin_).count(); }
  bool is_over() const { return (hooks_.stop && hooks_.stop()) || seconds() > options_.most_seconds; }

  DriveReplay replay(const Settings& settings) const {
    return replay_drive(robot_of(host_, settings), drive_, options_.hold_out, start_);
  }

  std::vector<Innovation> innovations_at(const Eigen::VectorXd& at) const {
    return innovations_of(replay(with_filter(with_values(settings_, tunables_, at))));
  }

  LogLikelihood likelihood(const Eigen::VectorXd& at) {
    const std::vector<Innovation> innovations = innovations_at(at);
    return log_likelihood(innovations, std::vector<bool>(innovations.size(), true));
  }

  double log_posterior(const Eigen::VectorXd& at) {
    const double value = likelihood(at).total - 0.5 * at.squaredNorm();
    const std::lock_guard lock(mutex_);
    ++evaluations_;
    best_ = std::max(best_, value);
    if (hooks_.progress)
      hooks_.progress(
          {.stage = "search", .evaluations = evaluations_, .gain = best_ - start_value_, .seconds = seconds()});
    return value;
  }

  void write_numbers(const Eigen::VectorXd& at, const SearchOptions& search) {
    const double degrees = likelihood(at).degrees;
    const auto size = static_cast<Eigen::Index>(innovations_at(at).size());
    const LikelihoodTerms terms = [&](const Eigen::VectorXd& where) {
      const std::vector<Innovation> innovations = innovations_at(where);
      Eigen::VectorXd values = Eigen::VectorXd::Zero(size);
      for (Eigen::Index i = 0; i < std::min<Eigen::Index>(size, std::ssize(innovations)); ++i)
        values[i] = log_density(innovations[static_cast<std::size_t>(i)], degrees);
      return values;
    };
    const Precision precision = precision_at(
        terms, at, {.lower = search.lower, .upper = search.upper, .threads = options_.threads, .stop = [this] {
                      return is_over();
                    }});
    for (std::size_t i = 0; i < tunables_.size(); ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      TunedNumber number{.tunable = tunables_[i], .value = tunables_[i].value_at(at[j]), .slice = {}};
      number.is_at_bound = !precision.is_free[i];
      number.error = tunables_[i].error_of(precision.error(static_cast<int>(i)), number.value);
      number.hessian_error = tunables_[i].error_of(precision.hessian_errors[j], number.value);
      number.is_told = number.is_at_bound || precision.error(static_cast<int>(i)) < certain_below;
      result_.numbers.push_back(std::move(number));
    }
  }

  /// What was found is taken unless it predicts worse what nothing was tuned on: covariances, which the likelihood has
  /// made right, count, too.
  void judge(const Eigen::VectorXd& at) {
    constexpr int digits = 4;
    const Settings tuned = with_values(settings_, tunables_, at, digits);
    const Robot before = robot_of(host_, settings_), after = robot_of(host_, tuned);
    const DriveReplay one = replay_drive(before, drive_, options_.hold_out, start_),
                      other = replay_drive(after, drive_, options_.hold_out, start_);
    result_.before = summarise_predictions(one, before);
    result_.after = summarise_predictions(other, after);
    result_.innovations_before = summarise_innovations(one, before);
    result_.innovations_after = summarise_innovations(other, after);
    const auto score = [](const AccuracySummary& accuracy) { return accuracy.median * accuracy.rms; };
    constexpr double by_chance = 1.05;
    // Without anything withheld nothing judges, and the likelihood decides.
    result_.is_taken = result_.after.count == 0 || score(result_.after) < by_chance * score(result_.before);
    result_.settings = result_.is_taken ? tuned : settings_;
  }

  const Host& host_;
  Settings settings_;
  const logs::Drive& drive_;
  DriveTuningOptions options_;
  TuningHooks hooks_;
  Clock::time_point begin_ = Clock::now();
  std::optional<Eigen::VectorXd> start_;
  std::vector<Tunable> tunables_;
  std::mutex mutex_;
  int evaluations_ = 0;
  double start_value_ = 0.0, best_ = -std::numeric_limits<double>::infinity();
  DriveTuning result_;
};

Json json_of(const AccuracySummary& accuracy) {
  return {{"sensor", accuracy.sensor}, {"count", accuracy.count}, {"median", accuracy.median}, {"rms", accuracy.rms}};
}

}  // namespace

DriveTuning tune_on_drive(const Host& host, const Settings& settings, const logs::Drive& drive,
                          const DriveTuningOptions& options, const TuningHooks& hooks) {
  return Tuner(host, settings, drive, options, hooks).run();
}

std::string tuned_yaml(const DriveTuning& tuning, const std::string& origin) {
  return fmt::format("# Tuned by 'rhec tune' {}.\n{}", origin, scenario_text(tuning.settings));
}

std::string summary_json(const DriveTuning& tuning) {
  Json json;
  json["measurements"] = tuning.measurements;
  json["log_likelihood"] = {{"before", tuning.log_likelihood_before}, {"after", tuning.log_likelihood_after}};
  Json& numbers = json["numbers"] = Json::object();
  for (const TunedNumber& number : tuning.numbers)
    numbers[number.tunable.name] = {{"before", number.tunable.start},
                                    {"after", number.value},
                                    {"error", std::isfinite(number.error) ? Json(number.error) : Json()},
                                    {"told", number.is_told},
                                    {"at_bound", number.is_at_bound}};
  json["held_out"] = {{"before", json_of(tuning.before)}, {"after", json_of(tuning.after)}};
  json["taken"] = tuning.is_taken;
  json["evaluations"] = tuning.evaluations;
  json["stopped"] = tuning.stopped;
  json["seconds"] = tuning.seconds;
  return json.dump(2) + "\n";
}

}  // namespace rhec::sim
