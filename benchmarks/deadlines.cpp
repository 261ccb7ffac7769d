// How long calls of an estimator and a controller take once their deadline has passed, on the worst samples that
// we know: a cold start, a burst of measurements that have waited, data that come late by a window, a silence, jumps of
// the position. Every call is given a deadline that has passed already, so all that it computes is overrun, or one that
// is a budget away; it is measured in time of the thread, which other programs do not lengthen.
//
//     deadlines [--budget MICROSECONDS] [SCENARIO ...]
//
// One line of JSON per scenario, estimator and kind of trouble: the longest call of each function [us]. Without
// arguments it takes scenarios of all vehicles. scripts/measure/deadlines makes a table of that.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <exception>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/numbers/random.hpp"

namespace rhec::bench {
namespace {

const std::vector<std::string> all_vehicles = {
    "figure8",   "skid_steer", "tractor_trailer", "bicycle_sideslip", "unicycle_traction",
    "obstacles", "gyro",       "noise_blocking"};
struct Variant {
  const char* name;
  std::vector<std::string> assignments;
};
const std::vector<Variant> variants = {
    {"as it is", {}},
    {"ekf", {"estimator.name=ekf", "blocking={}"}},
    {"bank", {"estimator.name=bank", "blocking={}"}},
    {"rhe", {"estimator.name=rhe", "blocking={}"}},
};
constexpr int samples = 240, begin_of_trouble = 80, end_of_trouble = 130;
constexpr double start_time = 1000.0;

enum class Trouble { cold_start, often, burst, late, silence, jumps };
constexpr std::array<std::pair<Trouble, const char*>, 6> troubles = {{{Trouble::cold_start, "cold start"},
                                                                      {Trouble::often, "often"},
                                                                      {Trouble::burst, "burst"},
                                                                      {Trouble::late, "late"},
                                                                      {Trouble::silence, "silence"},
                                                                      {Trouble::jumps, "jumps"}}};

double thread_microseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

/// The longest call of each function.
class Longest {
 public:
  template <class Function>
  void measure(const char* name, const Function& call) {
    const double begin = thread_microseconds();
    call();
    double& longest = longest_[name];
    longest = std::max(longest, thread_microseconds() - begin);
  }
  std::string json() const {
    std::string text;
    for (const auto& [name, microseconds] : longest_) text += fmt::format(", \"{}\": {:.1f}", name, microseconds);
    return text;
  }

 private:
  std::map<std::string, double> longest_;
};

/// A vehicle on slipping ground, driven by what the controller commands.
class Drive {
 public:
  Drive(const Robot& robot, Eigen::VectorXd state)
      : state_(std::move(state)), model_(*robot.model()), robot_(robot), random_(1, "sensors") {
    inputs.assign(model_.input_count(), 0.0);
    outputs.assign(model_.output_count(), 0.0);
    const ModelDescription& about = model_.description();
    for (const Variable& p : about.parameters) slip_.push_back(middle_value(p));
    next_ = state_;
  }
  void measure() {
    model_.observe({.count = 1, .states = state_.data(), .outputs = outputs.data()});
    for (std::size_t j = 0; j < outputs.size(); ++j) outputs[j] += robot_.output_sigmas()[j] * random_.normal();
  }
  void advance(double step) {
    model_.integrate({.count = 1,
                      .states = state_.data(),
                      .inputs = inputs.data(),
                      .parameters = slip_.data(),
                      .durations = &step,
                      .substeps = 4,
                      .next_states = next_.data()});
    if (next_.allFinite()) state_ = next_;
  }
  std::vector<double> inputs, outputs;

 private:
  Eigen::VectorXd state_, next_;
  std::vector<double> slip_;
  const Model& model_;
  const Robot& robot_;
  sim::RandomStream random_;
};

struct Row {
  double time;
  std::vector<double> inputs, outputs;
};

void push(const Row& row, Estimator& estimator, Longest& longest) {
  longest.measure("push", [&] {
    estimator.push_input(row.time, row.inputs.data());
    estimator.push_measurement(row.time, row.outputs.data());
  });
}

Longest drive(const sim::Scenario& scenario, Trouble trouble, std::chrono::microseconds budget) {
  const Robot& robot = scenario.robot();
  const bool is_cold = trouble == Trouble::cold_start;
  const auto estimator = is_cold ? robot.make_estimator() : robot.make_estimator(scenario.initial_state());
  const auto controller = robot.make_controller(scenario.path(), estimator->slip_ahead());
  controller->locate(scenario.start());
  Drive vehicle(robot, scenario.initial_state());
  Longest longest;
  std::deque<Row> waiting;
  constexpr int most_late = 15, most_often = 20;
  for (int k = 0; k < samples; ++k) {
    // A silence is as long as a robot may stand in its shed.
    const bool is_in_trouble = k >= begin_of_trouble && k < end_of_trouble;
    const double step = robot.step();
    const double shed = trouble == Trouble::silence && k >= end_of_trouble ? 3600.0 : 0.0;
    const double time = start_time + k * step + shed;
    vehicle.measure();
    Row row{time, vehicle.inputs, vehicle.outputs};
    if (trouble == Trouble::jumps && is_in_trouble)
      for (double& value : row.outputs) value += k % 3 == 0 ? 100.0 : 0.0;
    if (trouble == Trouble::silence && is_in_trouble) {
      // Nothing comes.
    } else if (trouble == Trouble::often && is_in_trouble) {
      for (int part = 1; part <= most_often; ++part) {
        row.time = time + step * (part - most_often) / most_often;
        push(row, *estimator, longest);
      }
    } else if (trouble == Trouble::burst && is_in_trouble) {
      // All comes at once, and as often as an encoder is read.
      for (int part = 0; part < most_often; ++part) {
        waiting.push_back(row);
        waiting.back().time += step * part / most_often;
      }
    } else if (trouble == Trouble::late && is_in_trouble) {
      waiting.push_back(row);
      while (waiting.size() > most_late) {
        push(waiting.front(), *estimator, longest);
        waiting.pop_front();
      }
    } else {
      for (const Row& each : waiting) push(each, *estimator, longest);
      waiting.clear();
      push(row, *estimator, longest);
    }
    const bool may_settle = !is_cold && k < begin_of_trouble;  // the trouble is to begin in a usual state
    const auto deadline = may_settle ? Clock::time_point::max() : Clock::now() + budget;
    Longest settling;
    Longest& counted = may_settle ? settling : longest;
    const Estimate* estimate = nullptr;
    counted.measure("estimate", [&] { estimate = &estimator->estimate(time, deadline); });
    if (!estimator->has_started()) continue;
    const Controller::Command* command = nullptr;
    counted.measure("control", [&] { command = &controller->control(*estimate, deadline); });
    vehicle.inputs = command->inputs;
    vehicle.advance(step);
    counted.measure("prepare", [&] {
      estimator->prepare();
      controller->prepare();
    });
  }
  return longest;
}

void run(const std::vector<std::string>& names, std::chrono::microseconds budget) {
  const Host host;
  for (const std::string& name : names) {
    for (const Variant& variant : variants) {
      Settings settings = load_yaml(fmt::format("{}/scenarios/{}.yaml", RHEC_SOURCE_DIRECTORY, name));
      for (const std::string& assignment : variant.assignments) apply_assignment(settings, assignment);
      const sim::Scenario scenario(host, settings);
      for (const auto& [trouble, words] : troubles) {
        const Longest longest = drive(scenario, trouble, budget);
        fmt::print("{{\"scenario\": \"{}\", \"estimator\": \"{}\", \"trouble\": \"{}\"{}}}\n", name, variant.name,
                   words, longest.json());
      }
    }
  }
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) {
  try {
    std::vector<std::string> names(words + 1, words + count);
    std::chrono::microseconds budget{0};
    if (names.size() > 1 && names.front() == "--budget") {
      budget = std::chrono::microseconds(std::stol(names[1]));
      names.erase(names.begin(), names.begin() + 2);
    }
    rhec::bench::run(names.empty() ? rhec::bench::all_vehicles : names, budget);
  } catch (const std::exception& mistake) {
    fmt::print(stderr, "deadlines: {}\n", mistake.what());
    return EXIT_FAILURE;
  }
}
