#include "rhec/sim/logs/recorded_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/logs/variants.hpp"
#include "rhec/sim/world/truth_estimator.hpp"

namespace rhec::sim {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
// Stamps are decimal: a smaller difference means equal stamps [s].
constexpr double same_time = 1e-6;
// A longer gap means two concatenated logs or a corrupt stamp [s].
constexpr double longest_silence = 3600.0;
// Rows with equal stamps are spread over at most this time, since the start of a subsequent gap is unknown [s].
constexpr double longest_spread = 0.1;

int index_of(const std::string& name, const std::vector<Variable>& variables, const Settings& section,
             const char* what) {
  const std::vector<std::string> names = names_of(variables);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw section.error(
        fmt::format("the model has no {} '{}'; expected one of {}", what, name, fmt::join(names, ", ")));
  return static_cast<int>(found - names.begin());
}

void check_names(const LogOptions& log, const ModelDescription& about, const Settings& section) {
  if (log.position.size() != 2) throw section.error("position: expected two outputs, [x, y]");
  for (const std::string& name : log.position) index_of(name, about.outputs, section, "output");
  index_of(log.steering, about.outputs, section, "output");
  index_of(log.speed, about.inputs, section, "input");
  index_of(log.steering_rate, about.inputs, section, "input");
}

/// Maps the columns of a log to the model's outputs and inputs.
struct Places {
  int x, y, steering, speed, steering_rate;
  Places(const LogOptions& log, const ModelDescription& about)
      : x(index_of(log.position[0], about.outputs, {}, "output")),
        y(index_of(log.position[1], about.outputs, {}, "output")),
        steering(index_of(log.steering, about.outputs, {}, "output")),
        speed(index_of(log.speed, about.inputs, {}, "input")),
        steering_rate(index_of(log.steering_rate, about.inputs, {}, "input")) {}
};

/// Rows with equal stamps were recorded in sequence by a coarse clock.
void spread_rows(std::vector<DeadReckoning>& rows) {
  for (std::size_t first = 0; first < rows.size();) {
    std::size_t next = first + 1;
    while (next < rows.size() && rows[next].stamp == rows[first].stamp) ++next;
    if (next < rows.size()) {
      const double gap = std::min(rows[next].stamp - rows[first].stamp, longest_spread);
      for (std::size_t i = first; i < next; ++i)
        rows[i].time = rows[first].stamp + gap * static_cast<double>(i - first) / static_cast<double>(next - first);
    }
    first = next;
  }
}

/// Linear in time between the rows about it; missing before the first row and where one of the two is.
double reading_at(const std::vector<DeadReckoning>& rows, double DeadReckoning::*reading, double time) {
  const auto after =
      std::upper_bound(rows.begin(), rows.end(), time, [](double at, const auto& row) { return at < row.time; });
  if (after == rows.begin()) return missing;
  const DeadReckoning& before = *std::prev(after);
  if (after == rows.end() || before.time == time) return before.*reading;
  const double share = (time - before.time) / (after->time - before.time);
  return before.*reading + share * ((*after).*reading - before.*reading);
}

/// Puts a row's two readings at the time of the one that is read late: a row tells of a time before its stamp, and is
/// taken for one that was stamped then. So nothing is used before it is known, and fixes wait for the rows about them.
void align_steering(std::vector<DeadReckoning>& rows, double delay) {
  const std::vector<DeadReckoning> read = rows;
  const auto prompt = delay > 0.0 ? &DeadReckoning::speed : &DeadReckoning::steering;
  for (DeadReckoning& row : rows) {
    row.time -= std::abs(delay);
    row.stamp -= std::abs(delay);
    row.*prompt = reading_at(read, prompt, row.time);
  }
}

void check_times(const CsvTable& table) {
  check_time_order(table);
  for (std::int64_t row = 1; row < table.rows(); ++row)
    if (table.at(row, 0) - table.at(row - 1, 0) > longest_silence)
      throw Error(
          fmt::format("{}:{}: time leaps from {} s to {} s; expected rows at most {} s apart; mend the stamp, or cut "
                      "the log there",
                      table.name, table.line_of(row), table.at(row - 1, 0), table.at(row, 0), longest_silence));
}

void mark_agreement(std::vector<Fix>& fixes, const LogOptions& options) {
  for (std::size_t i = 1; i + 1 < fixes.size(); ++i) {
    const Fix &before = fixes[i - 1], &after = fixes[i + 1];
    Fix& fix = fixes[i];
    const double length = after.time - before.time;
    if (fix.time - before.time > options.neighbour_time || after.time - fix.time > options.neighbour_time) continue;
    const double share = length > 0.0 ? (fix.time - before.time) / length : 0.5;
    // False for missing coordinates.
    fix.agrees = std::hypot(fix.x - before.x - share * (after.x - before.x),
                            fix.y - before.y - share * (after.y - before.y)) <= options.agreement;
  }
}

/// Drives an estimator through a log.
class Driver {
 public:
  Driver(const Robot& robot, const RecordedLog& log, const LogOptions& options, const HoldOut& hold_out,
         const LoopHooks& hooks)
      : log_(log),
        hold_out_(hold_out),
        hooks_(hooks),
        places_(options, robot.model()->description()),
        step_(robot.step()),
        estimator_(with_hooks(robot, hooks, [this] { return estimator_->counts().nodes - 1; }).make_estimator()),
        outputs_(robot.model()->description().outputs.size(), missing),
        inputs_(robot.model()->description().inputs.size(), missing) {}

  Driver(const Driver&) = delete;  // the estimator's solver queries this object for the step
  Driver& operator=(const Driver&) = delete;

  Replay run() {
    const auto start = Clock::now();
    for (std::size_t i = 0; i < log_.fixes.size(); ++i) {
      const Fix& fix = log_.fixes[i];
      take_rows_until(fix.time);
      if (hold_out_.holds(i)) {
        predict(fix, static_cast<std::int64_t>(i));
      } else {
        take_fix(fix, static_cast<std::int64_t>(i));
      }
      if (hooks_.progress) hooks_.progress(static_cast<double>(i + 1) / static_cast<double>(log_.fixes.size()));
    }
    take_rows_until(std::numeric_limits<double>::infinity());
    estimator_->end_drive();
    result_.counts = estimator_->counts();
    result_.seconds = std::chrono::duration<double>(Clock::now() - start).count();
    return std::move(result_);
  }

 private:
  void take_rows_until(double time) {
    for (; known_ < log_.rows.size() && log_.rows[known_].stamp <= time + same_time; ++known_) {
      const DeadReckoning& row = log_.rows[known_];
      double rate = missing;
      if (known_ > 0) {
        // The new row determines the inputs since the previous row; they replace the assumed ones.
        const DeadReckoning& before = log_.rows[known_ - 1];
        const double duration = row.time - before.time;
        if (duration > 0.0) {
          rate = (row.steering - before.steering) / duration;
          push_input(before.time, std::isnan(row.speed) ? before.speed : 0.5 * (before.speed + row.speed), rate);
        }
      }
      push_input(row.time, row.speed, rate);
      // A node between fixes waits half a step, in case a fix follows immediately.
      while (started_ && row.stamp >= newest_ + 1.5 * step_) add_node(newest_ + step_);
    }
  }

  void push_input(double time, double speed, double rate) {
    inputs_[places_.speed] = speed;
    inputs_[places_.steering_rate] = rate;
    estimator_->push_input(time, inputs_.data());
  }

  /// From the known rows: interpolated between two, held after the last.
  double steering_at(double time) const {
    std::size_t after = known_;
    while (after > 0 && log_.rows[after - 1].time > time) --after;
    if (after == 0) return missing;
    const DeadReckoning& before = log_.rows[after - 1];
    if (after == known_ || std::isnan(log_.rows[after].steering)) return before.steering;
    const double length = log_.rows[after].time - before.time;
    const double share = length > 0.0 ? (time - before.time) / length : 0.0;
    return before.steering + share * (log_.rows[after].steering - before.steering);
  }

  void add_node(double time) {
    std::fill(outputs_.begin(), outputs_.end(), missing);
    outputs_[places_.steering] = steering_at(time);
    push(time);
    note(time, -1, false);
  }

  void take_fix(const Fix& fix, std::int64_t index) {
    if (known_ == 0) return;  // the motion before the first row of dead reckoning is unknown
    if (started_) {
      const double from = newest_;
      const int parts = static_cast<int>(std::ceil((fix.time - from) / step_ - 1e-6));
      for (int i = 1; i < parts; ++i) add_node(from + (fix.time - from) * i / parts);
    }
    std::fill(outputs_.begin(), outputs_.end(), missing);
    outputs_[places_.steering] = steering_at(fix.time);
    outputs_[places_.x] = fix.x;
    outputs_[places_.y] = fix.y;
    push(fix.time);
    note(fix.time, index, false);
  }

  void push(double time) {
    estimator_->push_measurement(time, outputs_.data());
    newest_ = time;
    started_ = true;
  }

  void predict(const Fix& fix, std::int64_t index) {
    if (!started_) {
      ++result_.unpredicted;
    } else {
      note(fix.time, index, true);
    }
  }

  void note(double time, std::int64_t index, bool held_out) {
    const Estimate& estimate = estimator_->estimate(time);
    LoggedEstimate entry;
    entry.time = time;
    entry.fix = index;
    entry.held_out = held_out;
    entry.fallback = estimate.fallback;
    const Eigen::Index nx = estimate.state.size(), np = estimate.parameters.size();
    entry.values.resize(nx + np);
    entry.values << estimate.state, estimate.parameters;
    entry.sigmas = estimate.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
    if (!held_out && hooks_.sampled)
      hooks_.sampled({estimator_->counts().nodes - 1, time, estimator_.get(), &estimate, nullptr, nullptr});
    if (!held_out) result_.solve_us.push_back(estimate.report.preparation_us + estimate.report.feedback_us);
    if (index >= 0) {
      Model::Nodes request;
      request.count = 1;
      request.states = estimate.state.data();
      request.outputs = outputs_.data();
      estimator_->model().observe(request);
      const Fix& fix = log_.fixes[static_cast<std::size_t>(index)];
      entry.residual = std::hypot(outputs_[places_.x] - fix.x, outputs_[places_.y] - fix.y);
    }
    result_.estimates.push_back(std::move(entry));
  }

  const RecordedLog& log_;
  HoldOut hold_out_;
  const LoopHooks& hooks_;
  Places places_;
  double step_;
  std::unique_ptr<Estimator> estimator_;
  std::vector<double> outputs_, inputs_;
  std::size_t known_ = 0;  ///< rows received so far
  double newest_ = 0.0;    ///< time of the newest node
  bool started_ = false;
  Replay result_;
};

PredictionErrors errors_of(std::vector<double> errors) {
  PredictionErrors summary;
  summary.count = std::ssize(errors);
  if (errors.empty()) return summary;
  double sum = 0.0;
  for (const double error : errors) sum += std::min(error, error_cap) * std::min(error, error_cap);
  summary.rmse_capped = std::sqrt(sum / static_cast<double>(errors.size()));
  std::sort(errors.begin(), errors.end());
  const std::size_t half = errors.size() / 2;
  summary.median = errors.size() % 2 == 1 ? errors[half] : 0.5 * (errors[half - 1] + errors[half]);
  return summary;
}

}  // namespace

const OptionTable<LogOptions>& LogOptions::table() {
  static const auto rows =
      OptionTable<LogOptions>()
          .number("wheel_offset", &LogOptions::wheel_offset,
                  "the speed was measured at a wheel this far left of the axle's middle [m]; negative: right of it")
          .number("speed_bias", &LogOptions::speed_bias, "the speed's reading when standing [m/s]")
          .number("speed_scale", &LogOptions::speed_scale, "speed by metre of the reading, once the bias is taken off",
                  greater_than(0.0))
          .number("steering_bias", &LogOptions::steering_bias, "the steering's reading when driving straight [rad]")
          .number("steering_scale", &LogOptions::steering_scale,
                  "steering angle by radian of the reading, once the bias is taken off", greater_than(0.0))
          .number("fix_delay", &LogOptions::fix_delay, "how much later than the dead reckoning a fix is stamped [s]")
          .number("steering_delay", &LogOptions::steering_delay,
                  "how much later than the speed the steering is read, in one row [s]", between(-10.0, 10.0))
          .number("agreement", &LogOptions::agreement,
                  "a fix agrees with its neighbours where it is this near to the line between them [m]",
                  greater_than(0.0))
          .number("neighbour_time", &LogOptions::neighbour_time, "and they are this near in time [s]",
                  greater_than(0.0))
          .names("position", &LogOptions::position, "the two outputs that a fix measures")
          .text("steering", &LogOptions::steering, "the output that the steering's reading is")
          .text("speed", &LogOptions::speed, "the input that is the speed of the wheels")
          .text("steering_rate", &LogOptions::steering_rate, "the input that is the steering's rate");
  return rows;
}

const OptionTable<LogScenarioOptions>& LogScenarioOptions::table() {
  static const auto rows = [] {
    OptionTable<LogScenarioOptions> table;
    table.text("name", &LogScenarioOptions::name, "of the log, for titles")
        .subtree("log", &LogScenarioOptions::log, "how the log was recorded")
        .subtree("variants", &LogScenarioOptions::variants,
                 "by a name of your own: keys of the scenario that differ in this estimator; all run side by side");
    RobotOptions::add_to(table);
    return table;
  }();
  return rows;
}

std::vector<OptionSection> log_sections() {
  return {{"log", "For `rhec estimate`: how a drive was recorded, and what its columns mean to the model.",
           LogOptions::table().schema()},
          {"variants",
           "For `rhec estimate`: robots that run side by side on one recorded drive.",
           {{"NAME", "keys of a robot", "", "", "put over those of the scenario, for the variant so called"}}}};
}

namespace {

/// A scenario of `rhec run` says what it is.
void refuse_simulation(const Settings& settings) {
  for (const char* key : {"speed", "path", "terrain", "vehicle", "seed", "sensors", "faults"})
    if (const Settings* found = settings.find(key))
      throw found->error(
          "is that of a simulated drive: this scenario is for 'rhec run'; that of a recorded drive has a section 'log' "
          "instead, as scenarios/victoria_park.yaml, or 'signals' for a log with its own topics or columns");
}

}  // namespace

LogScenario::LogScenario(const Host& host, const Settings& settings, const std::vector<std::string>& chosen) {
  refuse_simulation(settings);
  const LogScenarioOptions base = LogScenarioOptions::table().parse(settings, "scenario");
  name_ = base.name;
  log_ = LogOptions::table().parse(base.log, "log");
  const auto add = [&](const std::string& name, const Settings& with) {
    const LogScenarioOptions options = LogScenarioOptions::table().parse(with, "scenario");
    variants_.push_back({name, Robot(host, options, scenario_estimators()), with});
    if (!options.variants.is_null()) variants_.back().settings.set("variants", Settings::null());
    check_names(log_, variants_.back().robot.model()->description(), base.log);
    const Settings* wheelbase = options.model.find("wheelbase");
    wheelbase_ = wheelbase ? wheelbase->as_number() : 0.0;
    if (log_.wheel_offset != 0.0 && !(wheelbase_ > 0.0))
      throw base.log.error("wheel_offset: needs model.wheelbase, the distance of the axles; give both or neither");
    variants_.back().robot.make_estimator();  // reports errors before anything runs
  };
  for (const auto& [name, with] : variant_settings(base.name, settings, chosen, {"name", "log", "variants"}))
    add(name, with);
}

LogTables read_log_tables(const std::filesystem::path& dead_reckoning, const std::filesystem::path& gps) {
  LogTables tables{read_csv(dead_reckoning, {.columns = 3}), read_csv(gps, {.columns = 3})};
  const CsvTable &rows = tables.rows, &fixes = tables.fixes;
  check_times(rows);
  check_times(fixes);
  if (fixes.at(fixes.rows() - 1, 0) < rows.at(0, 0) || fixes.at(0, 0) > rows.at(rows.rows() - 1, 0))
    throw Error(fmt::format("{}: from {} s to {} s, but {}: from {} s to {} s; expected logs of one drive by one clock",
                            rows.name, rows.at(0, 0), rows.at(rows.rows() - 1, 0), fixes.name, fixes.at(0, 0),
                            fixes.at(fixes.rows() - 1, 0)));
  return tables;
}

RecordedLog recorded_log(const LogTables& tables, const LogScenario& scenario) {
  const LogOptions& options = scenario.log();
  const CsvTable &rows = tables.rows, &fixes = tables.fixes;
  RecordedLog log;
  log.missing_speeds = rows.missing[1];
  log.missing_steerings = rows.missing[2];
  log.missing_coordinates = fixes.missing[1] + fixes.missing[2];
  log.rows.reserve(static_cast<std::size_t>(rows.rows()));
  for (std::int64_t i = 0; i < rows.rows(); ++i)
    log.rows.push_back({rows.at(i, 0), rows.at(i, 0), options.speed_scale * (rows.at(i, 1) - options.speed_bias),
                        options.steering_scale * (rows.at(i, 2) - options.steering_bias)});
  spread_rows(log.rows);
  if (options.steering_delay != 0.0) align_steering(log.rows, options.steering_delay);
  double steering = 0.0;  // last known
  for (std::size_t i = 0; i < log.rows.size() && options.wheel_offset != 0.0; ++i) {
    DeadReckoning& row = log.rows[i];
    if (!std::isnan(row.steering)) steering = row.steering;
    // In a bend an off-centre wheel runs on a circle of a different radius.
    const double factor = 1.0 - std::tan(steering) * options.wheel_offset / scenario.wheelbase();
    if (!(factor > 0.1))
      throw Error(
          fmt::format("{}:{}: with a steering angle of {} rad the wheel would stand still or run backwards; "
                      "expected an angle in radians; check the column and log.wheel_offset",
                      rows.name, rows.line_of(static_cast<std::int64_t>(i)), steering));
    row.speed /= factor;
  }
  log.fixes.reserve(static_cast<std::size_t>(fixes.rows()));
  for (std::int64_t i = 0; i < fixes.rows(); ++i)
    log.fixes.push_back({fixes.at(i, 0) - options.fix_delay, fixes.at(i, 1), fixes.at(i, 2), fixes.line_of(i)});
  mark_agreement(log.fixes, options);
  return log;
}

RecordedLog read_recorded_log(const std::filesystem::path& dead_reckoning, const std::filesystem::path& gps,
                              const LogScenario& scenario) {
  return recorded_log(read_log_tables(dead_reckoning, gps), scenario);
}

Replay replay(const Robot& robot, const RecordedLog& log, const LogOptions& options, const HoldOut& hold_out,
              const LoopHooks& hooks) {
  return Driver(robot, log, options, hold_out, hooks).run();
}

HeldOutSummary summarise(const Replay& replay, const RecordedLog& log) {
  std::vector<double> all, consistent;
  for (const LoggedEstimate& entry : replay.estimates) {
    if (!entry.held_out || std::isnan(entry.residual)) continue;
    all.push_back(entry.residual);
    if (log.fixes[static_cast<std::size_t>(entry.fix)].agrees) consistent.push_back(entry.residual);
  }
  for (std::int64_t i = 0; i < replay.unpredicted; ++i) all.push_back(error_cap);
  return {errors_of(std::move(all)), errors_of(std::move(consistent))};
}

}  // namespace rhec::sim
