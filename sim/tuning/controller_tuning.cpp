#include "rhec/sim/tuning/controller_tuning.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>

#include <fmt/format.h>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/numbers/statistics.hpp"
#include "rhec/sim/tuning/search.hpp"

namespace rhec::sim {
namespace {

// Weights of the effort's logarithm beside that of tracking.
constexpr double trade_offs[] = {0.1, 0.3, 1.0, 3.0};
// A run that does not reach the end of its path counts as tracking so many times worse than the scenario.
constexpr double lost = 100.0;

struct Drive {
  double tracking = 0.0, effort = 0.0;
  bool is_complete = false;
};

/// Root mean square of the changes of the inputs from sample to sample, in units of their typical magnitudes.
double effort_of(const RunLog& log, const ModelDescription& about) {
  double sum = 0.0;
  std::int64_t count = 0;
  for (std::size_t j = 0; j < about.inputs.size(); ++j) {
    // How fast the vehicle is to go is the path's affair.
    if (static_cast<int>(j) == about.roles.speed && about.inputs.size() > 1) continue;
    for (std::size_t i = 1; i < log.samples.size(); ++i) {
      const double change = (log.samples[i].inputs[j] - log.samples[i - 1].inputs[j]) / about.inputs[j].scale;
      sum += change * change;
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
}

class ControllerTuner {
 public:
  ControllerTuner(const Host& host, const Settings& settings, const std::vector<DrivingCase>& cases,
                  const ControllerTuningOptions& options, const TuningHooks& hooks)
      : host_(host), cases_(cases), options_(options), hooks_(hooks) {
    result_.settings = settings;
    const Scenario scenario(host, settings);
    result_.numbers = controller_tunables(scenario.robot(), settings);
  }

  ControllerTuning run() {
    const auto n = static_cast<Eigen::Index>(result_.numbers.size());
    Eigen::VectorXd start = Eigen::VectorXd::Zero(n);
    begin("the scenario as it is");
    own_ = drives_at(start, options_.first_seed, options_.seeds);
    for (const Drive& drive : own_)
      if (!drive.is_complete)
        throw Error("the scenario's own controller does not reach the end of its path; mend that first");
    keep(start, own_);

    SearchOptions search;
    search.lower.resize(n);
    search.upper.resize(n);
    search.step = Eigen::VectorXd::Constant(n, 0.4);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Tunable& number = result_.numbers[static_cast<std::size_t>(i)];
      search.lower[i] = number.coordinate_of(number.lower);
      search.upper[i] = number.coordinate_of(number.upper);
    }
    search.most_evaluations = options_.most_evaluations;
    search.tolerance = 1e-3;
    search.stop = [this] { return stopped(); };
    for (const double trade_off : trade_offs) {
      if (stopped()) break;
      begin(fmt::format("effort weighed {:g}", trade_off));
      const auto value = [&](const TriedController& tried) {
        return -std::log(tried.tracking) - trade_off * std::log(tried.effort);
      };
      // What serves this trade-off best so far.
      std::size_t best = 0;
      for (std::size_t i = 1; i < result_.tried.size(); ++i)
        if (value(result_.tried[i]) > value(result_.tried[best])) best = i;
      maximise(
          [&](const Eigen::VectorXd& at) {
            keep(at, drives_at(at, options_.first_seed, options_.seeds));
            return value(result_.tried.back());
          },
          {places_[best]}, search);
    }
    choose();
    if (!stopped()) judge();
    result_.stopped = stopped_;
    result_.runs = runs_;
    result_.seconds = seconds();
    return std::move(result_);
  }

 private:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - began_).count(); }
  bool stopped() const {
    if (!stopped_ && ((hooks_.stop && hooks_.stop()) || seconds() > options_.most_seconds)) stopped_ = true;
    return stopped_;
  }
  void begin(const std::string& stage) {
    const std::lock_guard lock(mutex_);
    stage_ = stage;
    tell();
  }
  void tell() const {
    if (hooks_.progress) hooks_.progress({stage_, runs_, 0.0, seconds()});
  }

  /// One drive for each case and seed.
  std::vector<Drive> drives_at(const Eigen::VectorXd& at, int first_seed, int seeds) {
    std::vector<Drive> drives(cases_.size() * static_cast<std::size_t>(seeds));
    in_parallel(static_cast<int>(drives.size()), options_.threads, [&](int k) {
      Settings settings =
          with_values(cases_[static_cast<std::size_t>(k / seeds)].settings, result_.numbers, at, written_digits);
      settings.set("seed", Settings::scalar(fmt::format("{}", first_seed + k % seeds)));
      const Scenario scenario(host_, settings);
      const RunLog log = run_closed_loop(scenario);
      Drive& drive = drives[static_cast<std::size_t>(k)];
      drive.is_complete = log.completed;
      drive.effort = effort_of(log, scenario.robot().model()->description());
      double sum = 0.0;
      for (const Sample& sample : log.samples) sum += std::abs(sample.tracking);
      drive.tracking = sum / static_cast<double>(std::max<std::size_t>(log.samples.size(), 1));
      const std::lock_guard lock(mutex_);
      ++runs_;
      tell();
    });
    return drives;
  }

  void keep(const Eigen::VectorXd& at, const std::vector<Drive>& drives) {
    TriedController tried;
    for (Eigen::Index i = 0; i < at.size(); ++i)
      tried.values.push_back(result_.numbers[static_cast<std::size_t>(i)].value_at(at[i]));
    double tracking = 0.0, effort = 0.0;
    for (std::size_t k = 0; k < drives.size(); ++k) {
      tried.is_complete = tried.is_complete && drives[k].is_complete;
      tracking += drives[k].is_complete ? std::log(drives[k].tracking / own_[k].tracking) : std::log(lost);
      if (drives[k].is_complete) effort += std::log(drives[k].effort / own_[k].effort);
    }
    tried.tracking = std::exp(tracking / static_cast<double>(drives.size()));
    tried.effort = std::exp(effort / static_cast<double>(drives.size()));
    result_.tried.push_back(tried);
    places_.push_back(at);
  }

  void choose() {
    std::vector<TriedController>& all = result_.tried;
    for (TriedController& one : all)
      one.is_efficient = one.is_complete && std::none_of(all.begin(), all.end(), [&](const TriedController& other) {
                           return other.is_complete && other.tracking <= one.tracking && other.effort <= one.effort &&
                                  (other.tracking < one.tracking || other.effort < one.effort);
                         });
    for (std::size_t i = 1; i < all.size(); ++i) {
      const TriedController& chosen = all[static_cast<std::size_t>(result_.chosen)];
      const bool is_allowed = all[i].is_complete && all[i].effort <= options_.effort;
      if (is_allowed && (all[i].tracking < chosen.tracking || chosen.effort > options_.effort))
        result_.chosen = static_cast<int>(i);
    }
    if (result_.chosen > 0)
      result_.settings = with_values(std::move(result_.settings), result_.numbers,
                                     places_[static_cast<std::size_t>(result_.chosen)], written_digits);
  }

  /// Means of paired logarithms, with Student's intervals over seeds and cases.
  void judge() {
    begin("judging");
    const Eigen::VectorXd start = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(result_.numbers.size()));
    const auto before = drives_at(start, options_.judge_first_seed, options_.judges);
    const auto after =
        drives_at(places_[static_cast<std::size_t>(result_.chosen)], options_.judge_first_seed, options_.judges);
    const auto add = [&](const char* name, const char* unit, double Drive::*figure) {
      Compared compared;
      compared.name = name;
      compared.unit = unit;
      Moments own, tuned, ratio;
      for (std::size_t k = 0; k < before.size(); ++k) {
        own.add(before[k].*figure);
        tuned.add(after[k].*figure);
        ratio.add(std::log(after[k].*figure / before[k].*figure));
      }
      StudentQuantiles quantiles;
      const auto interval = [&](const Moments& moments) {
        const double half = moments.half_width(quantiles);
        return std::pair{moments.mean() - half, moments.mean() + half};
      };
      compared.before = own.mean();
      compared.after = tuned.mean();
      compared.before_interval = interval(own);
      compared.after_interval = interval(tuned);
      const auto [lower, upper] = interval(ratio);
      compared.change_interval = {std::exp(lower), std::exp(upper)};
      result_.judged.push_back(compared);
    };
    add("mean distance from the path", "m", &Drive::tracking);
    add("RMS change of the inputs", "", &Drive::effort);
    const auto missed = [](const std::vector<Drive>& drives) {
      return static_cast<double>(
          std::count_if(drives.begin(), drives.end(), [](const Drive& drive) { return !drive.is_complete; }));
    };
    Compared ends;
    ends.name = "runs that did not reach the end";
    ends.before = missed(before);
    ends.after = missed(after);
    result_.judged.push_back(ends);
  }

  const Host& host_;
  const std::vector<DrivingCase>& cases_;
  ControllerTuningOptions options_;
  const TuningHooks& hooks_;
  ControllerTuning result_;
  std::vector<Eigen::VectorXd> places_;  ///< of `result_.tried`
  std::vector<Drive> own_;               ///< of the scenario's controller

  Clock::time_point began_ = Clock::now();
  mutable std::mutex mutex_;
  mutable std::atomic<bool> stopped_ = false;
  int runs_ = 0;
  std::string stage_;
};

}  // namespace

ControllerTuning tune_controller(const Host& host, const Settings& settings, const std::vector<DrivingCase>& cases,
                                 const ControllerTuningOptions& options, const TuningHooks& hooks) {
  return ControllerTuner(host, settings, cases, options, hooks).run();
}

}  // namespace rhec::sim
