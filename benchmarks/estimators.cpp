// Estimators beside each other on the same drives: each closed loop is driven by the estimator of a scenario, and
// others see the same measurements. One line of JSON per drive and estimator: mean absolute errors, mean NEES, the
// shares of samples whose truth lies within two standard deviations, the median time of a sample, and standard
// deviations of outputs that an estimator has learnt, relative to the true ones (null: not identified).
//
//     estimators --scenario scenarios/baseline/ekf.yaml --set speed=5 --set seed=7 --beside 'bank: estimator.name=bank'
//
// What stands after --beside is a name and assignments, separated by ';'. After --smoothed it is the same, and the
// estimates are those of the smoother over the whole drive; its time is that of an interval. scripts/measure/estimators
// runs the whole grid. --first 'ASSIGNMENT; ...' makes another drive before, of which nothing is printed,
// with these assignments in addition; estimators that remember places keep their maps. scripts/measure/second-lap uses
// that. What stands beside sees `--outliers SHARE` of its fixes shifted by metres (5 m standard deviation), and all
// fixes `--late SAMPLES` late; the driving estimator does not. --series FILE takes the parameters, true and estimated,
// of every sample. scripts/measure/conditions uses these. Biases and scale errors of sensors have an entry each under
// "sensors": mean absolute error, shares of samples within one, two and three standard deviations, signed error and
// standard deviation at the end, and the share of the drive until that is half of what it was at the start (null:
// never). scripts/measure/biases uses these.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <exception>
#include <fstream>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Dense>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/numbers/random.hpp"

namespace rhec::bench {
namespace {

struct Beside {
  std::string name;
  std::unique_ptr<Estimator> estimator;
  std::vector<Estimate> estimates = {};
  std::vector<double> microseconds = {};  ///< of each sample, without what is prepared for the next
  std::shared_ptr<NodeLog> nodes = {};    ///< what it has seen, for a smoother; else null
  std::vector<SmoothedRun::Law> laws = {};
  int iterations = 0;
};

/// What happens to fixes, the outputs in metres, on their way to the estimators beside.
struct Trouble {
  double outliers = 0.0;  ///< share of the samples
  int late = 0;           ///< samples
  int seed = 1;
};
constexpr double outlier_sigma = 5.0;  // [m]

/// Passes on what the driving estimator sees.
class Forwarding final : public EstimationMethod {
 public:
  Forwarding(std::unique_ptr<EstimationMethod> inner, std::vector<Beside>& others, const Trouble& trouble)
      : inner_(std::move(inner)),
        others_(others),
        trouble_(trouble),
        random_(static_cast<std::uint64_t>(trouble.seed), "outliers") {}
  const Model& model() const noexcept override { return inner_->model(); }
  int substeps() const noexcept override { return inner_->substeps(); }
  void start(Measured outputs) noexcept override {
    inner_->start(outputs);
    time_ = 0.0;
    for (Beside& other : others_) other.estimator->push_measurement(time_, outputs.values);
  }
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override {
    inner_->add(interval, outputs);
    const double now = time_ + interval.duration;
    Late sample{now, std::vector<double>(outputs.values, outputs.values + model().output_count()), {}};
    sample.fixes.assign(sample.others.size(), std::numeric_limits<double>::quiet_NaN());
    const bool is_outlier = trouble_.outliers > 0.0 && random_.uniform() < trouble_.outliers;
    for (std::size_t j = 0; j < sample.fixes.size(); ++j) {
      if (model().description().outputs[j].unit != "m") continue;
      std::swap(sample.fixes[j], sample.others[j]);
      if (is_outlier) sample.fixes[j] += outlier_sigma * random_.normal();
    }
    waiting_.push_back(std::move(sample));
    for (Beside& other : others_) {
      other.estimator->push_input(time_, interval.inputs);
      for (int k = 0; k < interval.between; ++k)
        other.estimator->push_measurement(time_ + interval.times[k],
                                          interval.outputs + static_cast<std::ptrdiff_t>(k) * model().output_count());
      other.estimator->push_measurement(now, waiting_.back().others.data());
      if (std::ssize(waiting_) > trouble_.late)
        other.estimator->push_measurement(waiting_.front().time, waiting_.front().fixes.data());
    }
    if (std::ssize(waiting_) > trouble_.late) waiting_.pop_front();
    time_ = now;
  }
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override {
    inner_->estimate(result, deadline);
    for (Beside& other : others_) {
      const auto begin = std::chrono::steady_clock::now();
      const Estimate& estimate = other.estimator->estimate(time_);
      const std::chrono::duration<double, std::micro> taken = std::chrono::steady_clock::now() - begin;
      other.estimates.push_back(estimate);
      other.microseconds.push_back(taken.count());
      other.estimator->prepare();
    }
  }
  void prepare() noexcept override { inner_->prepare(); }
  void reset() noexcept override { inner_->reset(); }
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override {
    return inner_->rebase(mean, covariance);
  }
  void end_drive() noexcept override { inner_->end_drive(); }
  std::shared_ptr<const SlipAhead> slip_ahead() const noexcept override { return inner_->slip_ahead(); }

 private:
  struct Late {
    double time;
    std::vector<double> others, fixes;  ///< NaN where the other has the number
  };
  std::unique_ptr<EstimationMethod> inner_;
  std::vector<Beside>& others_;
  Trouble trouble_;
  sim::RandomStream random_;
  std::deque<Late> waiting_;
  double time_ = 0.0;
};

/// Keeps the map of an estimator from drive to drive.
class KeepingHooks final : public RobotHooks {
 public:
  explicit KeepingHooks(std::shared_ptr<SlipMap>& kept) : kept_(kept) {}
  std::shared_ptr<SlipMap> provide_map(const MemorySection&, std::shared_ptr<SlipMap> map) const override {
    if (!kept_) kept_ = std::move(map);
    kept_->begin_drive(kept_->time());
    return kept_;
  }

 private:
  std::shared_ptr<SlipMap>& kept_;
};

class ForwardingHooks final : public RobotHooks {
 public:
  ForwardingHooks(std::vector<Beside>& others, const Trouble& trouble) : others_(others), trouble_(trouble) {}
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override {
    return std::make_unique<Forwarding>(std::move(method), others_, trouble_);
  }

 private:
  std::vector<Beside>& others_;
  Trouble trouble_;
};

/// What is found of a bias or a scale error.
struct SensorErrors {
  int count = 0, known_from = -1;
  double sum = 0.0, start_sigma = 0.0, end = 0.0, end_sigma = 0.0;
  std::array<int, 3> within{};
  void add(double error, double sigma) {
    if (count == 0) start_sigma = sigma;
    for (std::size_t k = 0; k < within.size(); ++k) within[k] += std::abs(error) <= static_cast<double>(k + 1) * sigma;
    if (known_from < 0 && sigma <= 0.5 * start_sigma) known_from = count;
    ++count;
    sum += std::abs(error);
    end = error;
    end_sigma = sigma;
  }
  std::string json() const {
    const auto share = [&](int part) { return static_cast<double>(part) / count; };
    return fmt::format(
        R"({{"error": {:.6g}, "within": [{:.6g}, {:.6g}, {:.6g}], "end": {:.6g}, "end_sigma": {:.6g}, "known": {}}})",
        sum / count, share(within[0]), share(within[1]), share(within[2]), end, end_sigma,
        known_from < 0 ? "null" : fmt::format("{:.6g}", share(known_from)));
  }
};

/// Errors of one estimator over a drive.
struct Errors {
  /// `vehicle_states`: of the description's states, those before the errors of sensors.
  Errors(const ModelDescription& description, Eigen::Index vehicle_states)
      : about(description),
        first_sensor(vehicle_states),
        parameters(description.parameters.size(), 0.0),
        inside(description.parameters.size(), 0.0),
        sensors(description.states.size() - static_cast<std::size_t>(vehicle_states)) {}
  void add(const sim::Sample& truth, const Eigen::VectorXd& state, const Eigen::VectorXd& p,
           const Eigen::MatrixXd& covariance) {
    ++count;
    // Of an estimated state [x; b; k; m] nobody knows the m, the values of outputs of motion.
    const Eigen::Index nx = truth.true_state.size(), skipped = state.size() - nx;
    Eigen::VectorXd error(nx + p.size());
    error << state.head(nx) - truth.true_state, p - truth.true_parameters;
    const auto at = [&](Eigen::Index j) { return j < nx ? j : j + skipped; };
    const Eigen::MatrixXd known = Eigen::MatrixXd::NullaryExpr(
        error.size(), error.size(), [&](Eigen::Index r, Eigen::Index c) { return covariance(at(r), at(c)); });
    for (Eigen::Index j = 0; j < nx; ++j)
      if (about.states[static_cast<std::size_t>(j)].is_angle)
        error[j] = angle_difference(state[j], truth.true_state[j]);
    const Roles& roles = about.roles;
    if (roles.position_x >= 0) position += std::hypot(error[roles.position_x], error[roles.position_y]);
    if (roles.heading >= 0) heading += std::abs(error[roles.heading]);
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      const auto k = nx + static_cast<Eigen::Index>(j);
      parameters[j] += std::abs(error[k]);
      inside[j] += std::abs(error[k]) <= 2.0 * std::sqrt(known(k, k));
    }
    for (std::size_t e = 0; e < sensors.size(); ++e) {
      const Eigen::Index k = first_sensor + static_cast<Eigen::Index>(e);
      sensors[e].add(error[k], std::sqrt(known(k, k)));
    }
    nees += error.dot(known.ldlt().solve(error));
  }
  std::string json() const {
    const auto mean = [&](double sum) { return sum / count; };
    std::string text = fmt::format("\"samples\": {}, \"position\": {:.6g}, \"heading\": {:.6g}, \"nees\": {:.6g}",
                                   count, mean(position), mean(heading), mean(nees));
    for (std::size_t j = 0; j < parameters.size(); ++j)
      text += fmt::format(", \"{0}\": {1:.6g}, \"{0}_inside\": {2:.6g}", about.parameters[j].name, mean(parameters[j]),
                          mean(inside[j]));
    if (sensors.empty()) return text;
    text += ", \"sensors\": {";
    for (std::size_t e = 0; e < sensors.size(); ++e)
      text += fmt::format("{}\"{}\": {}", e == 0 ? "" : ", ",
                          about.states[static_cast<std::size_t>(first_sensor) + e].name, sensors[e].json());
    return text + "}";
  }

  const ModelDescription& about;
  Eigen::Index first_sensor;
  int count = 0;
  double position = 0.0, heading = 0.0, nees = 0.0;
  std::vector<double> parameters, inside;
  std::vector<SensorErrors> sensors;
};

/// What a smoother says of the drive, node by node, in place of its estimator's causal estimates.
void smooth(const sim::Scenario& variant, const Eigen::VectorXd& start, Beside& beside) {
  const ModelDescription& about = variant.robot().bounded_description();
  const auto nx = std::ssize(about.states), np = std::ssize(about.parameters), n = nx + np;
  const auto begin = std::chrono::steady_clock::now();
  const SmoothedRun run = variant.robot().make_smoother(start)->estimate(*beside.nodes);
  const std::chrono::duration<double, std::micro> taken = std::chrono::steady_clock::now() - begin;
  if (run.report.status != Status::solved || run.covariances.empty())
    throw Error(
        fmt::format("'{}': {} after {} iterations", beside.name, name_of(run.report.status), run.report.iterations));
  beside.estimates.assign(static_cast<std::size_t>(run.intervals()) + 1, Estimate{});
  for (std::ptrdiff_t i = 0; i <= run.intervals(); ++i) {
    Estimate& estimate = beside.estimates[static_cast<std::size_t>(i)];
    estimate.state = Eigen::Map<const Eigen::VectorXd>(run.states.data() + i * nx, nx);
    estimate.parameters = Eigen::Map<const Eigen::VectorXd>(run.node_parameters.data() + i * np, np);
    estimate.covariance = Eigen::Map<const Eigen::MatrixXd>(run.covariances.data() + i * n * n, n, n);
  }
  beside.laws = run.laws;
  beside.iterations = run.report.iterations;
  beside.microseconds.assign(1, taken.count() / static_cast<double>(run.intervals()));
}

struct Arguments {
  std::string scenario, first, series;
  Trouble trouble;
  std::vector<std::string> assignments, beside, smoothed;
};

Arguments read(int count, char** words) {
  Arguments arguments;
  for (int i = 1; i < count; ++i) {
    const std::string word = words[i];
    if (i + 1 == count) throw Error("'" + word + "' needs a value");
    const std::string value = words[++i];
    if (word == "--scenario")
      arguments.scenario = value;
    else if (word == "--set")
      arguments.assignments.push_back(value);
    else if (word == "--beside")
      arguments.beside.push_back(value);
    else if (word == "--smoothed")
      arguments.smoothed.push_back(value);
    else if (word == "--first")
      arguments.first = value;
    else if (word == "--series")
      arguments.series = value;
    else if (word == "--outliers")
      arguments.trouble.outliers = std::stod(value);
    else if (word == "--late")
      arguments.trouble.late = std::stoi(value);
    else
      throw Error("'" + word +
                  "' is none of --scenario, --set, --beside, --smoothed, --first, --series, --outliers, --late");
  }
  if (arguments.scenario.empty()) throw Error("--scenario FILE is missing");
  return arguments;
}

sim::Scenario scenario_with(const Host& host, const Arguments& arguments, const std::string& more) {
  Settings settings = load_yaml(arguments.scenario);
  for (const std::string& assignment : arguments.assignments) apply_assignment(settings, assignment);
  for (std::size_t at = 0; at < more.size();) {
    const std::size_t end = std::min(more.find(';', at), more.size());
    const std::size_t first = more.find_first_not_of(' ', at);
    if (first < end) apply_assignment(settings, more.substr(first, end - first));
    at = end + 1;
  }
  return {host, settings};
}

/// One line a sample and parameter, for each estimator.
void write_series(const std::string& file, const ModelDescription& about, const sim::RunLog& log,
                  const std::vector<Beside>& others) {
  std::ofstream out(file);
  out << "estimator;sample;parameter;true;estimated\n";
  for (const Beside& other : others)
    for (std::size_t i = 0; i < std::min(log.samples.size(), other.estimates.size()); ++i)
      for (std::size_t j = 0; j < about.parameters.size(); ++j) {
        const auto at = static_cast<Eigen::Index>(j);
        out << fmt::format("{};{};{};{:.6g};{:.6g}\n", other.name, i, about.parameters[j].name,
                           log.samples[i].true_parameters[at], other.estimates[i].parameters[at]);
      }
  if (!out.flush()) throw Error(file + ": cannot be written");
}

/// One drive; `maps` are those of the estimators, in their order.
void drive(const Host& host, const Arguments& arguments, const std::string& more,
           std::vector<std::shared_ptr<SlipMap>>& maps, bool is_printed) {
  // The others hear what the driver's method is given: a measurement that its judge withholds would be lost for them.
  sim::Scenario driver = scenario_with(host, arguments, more + "; estimator.health.watch=false");
  std::vector<sim::Scenario> variants;
  std::vector<Beside> others;
  variants.reserve(arguments.beside.size() + arguments.smoothed.size());
  const auto add = [&](const std::string& beside, std::shared_ptr<NodeLog> nodes) {
    const std::size_t colon = beside.find(':');
    if (colon == std::string::npos) throw Error("'" + beside + "': expected 'NAME: ASSIGNMENT; ...'");
    variants.push_back(scenario_with(host, arguments, more + ";" + beside.substr(colon + 1)));
    Robot robot = variants.back().robot();
    robot.add_hooks(std::make_shared<KeepingHooks>(maps[others.size()]));
    if (nodes) robot.add_hooks(recording_nodes(nodes));
    others.push_back({.name = beside.substr(0, colon), .estimator = robot.make_estimator(driver.initial_state())});
    others.back().nodes = std::move(nodes);
  };
  for (const std::string& beside : arguments.beside) add(beside, nullptr);
  for (const std::string& smoothed : arguments.smoothed) add(smoothed, std::make_shared<NodeLog>());
  const ModelDescription& about = driver.robot().estimated_description();
  const auto vehicle_states = std::ssize(driver.robot().bounded_description().states);
  sim::LoopHooks hooks;
  Trouble trouble = arguments.trouble;
  trouble.seed = driver.options().seed;
  hooks.robot = std::make_shared<ForwardingHooks>(others, trouble);
  const sim::RunLog log = sim::run_closed_loop(driver, hooks);
  for (Beside& other : others) other.estimator->end_drive();
  if (!is_printed) return;
  for (std::size_t i = 0; i < others.size(); ++i)
    if (others[i].nodes) smooth(variants[i], driver.initial_state(), others[i]);
  if (!arguments.series.empty()) write_series(arguments.series, about, log, others);
  for (Beside& other : others) {
    if (other.estimates.size() != log.samples.size())
      throw Error(fmt::format("{} estimates for {} samples", other.estimates.size(), log.samples.size()));
    Errors errors(about, vehicle_states);
    for (std::size_t i = 0; i < log.samples.size(); ++i)
      errors.add(log.samples[i], other.estimates[i].state, other.estimates[i].parameters,
                 other.estimates[i].covariance);
    const auto middle = other.microseconds.begin() + static_cast<std::ptrdiff_t>(other.microseconds.size() / 2);
    std::nth_element(other.microseconds.begin(), middle, other.microseconds.end());
    std::string laws;  // of a smoother: members of the bank that it mixes, with their probabilities
    for (const SmoothedRun::Law& law : other.laws)
      laws += fmt::format("{}\"{:.3g}: {}\"", laws.empty() ? "" : ", ", law.probability, fmt::join(law.texts, "; "));
    if (!laws.empty()) laws = fmt::format(", \"laws\": [{}], \"iterations\": {}", laws, other.iterations);
    std::string noise;  // what has been learnt of it, relative to the true one
    for (std::size_t j = 0; j < about.outputs.size(); ++j)
      if (const auto learnt = other.estimator->method().output_noise(static_cast<int>(j)))
        noise += fmt::format(
            ", \"noise_{}\": {}", about.outputs[j].name,
            learnt->is_identified ? fmt::format("{:.4g}", learnt->sigma / driver.robot().output_sigmas()[j]) : "null");
    fmt::print("{{\"estimator\": \"{}\", {}, \"median_us\": {:.4g}{}{}}}\n", other.name, errors.json(), *middle, laws,
               noise);
  }
}

void run(const Arguments& arguments) {
  const Host host;
  std::vector<std::shared_ptr<SlipMap>> maps(arguments.beside.size() + arguments.smoothed.size());
  if (!arguments.first.empty()) drive(host, arguments, arguments.first, maps, false);
  drive(host, arguments, "", maps, true);
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) {
  try {
    rhec::bench::run(rhec::bench::read(count, words));
  } catch (const std::exception& mistake) {
    fmt::print(stderr, "estimators: {}\n", mistake.what());
    return EXIT_FAILURE;
  }
}
