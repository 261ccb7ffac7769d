#include "rhec/sim/horizons/horizon_log.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rhec/sim/files/json.hpp"
#include "rhec/sim/files/number_text.hpp"

namespace rhec::sim {
namespace {

// How far beyond a window's end to predict where blocks will start [intervals].
constexpr int outlook = 256;
// Limit on the total intervals of all recorded windows and plans, so that long horizons do not produce large files.
constexpr std::int64_t most_intervals = 40000;

/// The block structure in one window.
struct BlocksInView {
  std::vector<std::int64_t> starts, suppressed;
  std::int64_t first_start = 0;  ///< where the first block actually began
  std::int64_t next_start = -1;  ///< where the block after the last will begin; -1: nowhere
};

class Line {
 public:
  explicit Line(std::string& text) : text_(text) {}
  void key(const char* name) {
    separate();
    text_ += '"';
    text_ += name;
    text_ += "\":";
    fresh_ = true;
  }
  void open(char bracket) {
    separate();
    text_ += bracket;
    fresh_ = true;
  }
  void close(char bracket) {
    text_ += bracket;
    fresh_ = false;
  }
  void number(double value, int decimals) {
    separate();
    append_number(value, decimals, text_);
  }
  void integer(std::int64_t value) { number(static_cast<double>(value), 0); }
  void flag(bool value) {
    separate();
    text_ += value ? "true" : "false";
  }
  void word(std::string_view value) {
    separate();
    append_quoted(value, text_);
  }
  void null() {
    separate();
    text_ += "null";
  }
  template <class Function>
  void column(int count, int decimals, const Function& value_of) {
    open('[');
    for (int i = 0; i < count; ++i) number(value_of(i), decimals);
    close(']');
  }
  void integers(const std::vector<std::int64_t>& values) {
    open('[');
    for (const std::int64_t value : values) integer(value);
    close(']');
  }

 private:
  void separate() {
    if (!fresh_) text_ += ',';
    fresh_ = false;
  }
  std::string& text_;
  bool fresh_ = true;
};

std::vector<int> decimals_of(const std::vector<Variable>& variables) {
  std::vector<int> decimals;
  decimals.reserve(variables.size());
  for (const Variable& variable : variables) decimals.push_back(decimals_for(variable.scale));
  return decimals;
}

constexpr int time_decimals = 6;

}  // namespace

struct HorizonLog::Parts {
  std::shared_ptr<const Model> model;
  std::vector<std::shared_ptr<const Blocking>> blockings;
  std::vector<int> state_decimals, input_decimals, parameter_decimals, output_decimals;
  std::int64_t every = 1, kept = 0;
  int horizon = 0;
  std::string records;

  // Measurements by node.
  std::vector<double> times, outputs, inputs;
  struct Change {
    std::int64_t node;
    double time;
    Status status;
  };
  std::vector<Change> statuses;

  // Workspace for the covariances of all nodes, allocated with the first window.
  StageQp qp;
  Riccati riccati;
  ActiveSet no_bounds;
  std::vector<double> scratch, covariances;
  std::vector<std::uint8_t> begins;
  std::vector<double> row;

  std::int64_t nodes() const { return std::ssize(times); }

  void note_nodes(const WindowedEstimation& method, double time) {
    const RheProblem& problem = method.problem();
    const Window& window = method.window();
    const int nu = model->input_count(), ny = model->output_count();
    const std::int64_t newest = window.first + window.intervals;
    for (std::int64_t node = nodes(); node <= newest; ++node) {
      const int place = static_cast<int>(std::max<std::int64_t>(0, node - window.first));
      double at = time;
      for (int i = window.intervals - 1; i >= place; --i) at -= problem.duration(i);
      times.push_back(at);
      outputs.insert(outputs.end(), problem.output(place), problem.output(place) + ny);
      if (node == 0) continue;
      if (place == 0) {  // the preceding interval left the window unrecorded
        inputs.insert(inputs.end(), static_cast<std::size_t>(nu), std::numeric_limits<double>::quiet_NaN());
      } else {
        inputs.insert(inputs.end(), problem.measured_input(place - 1), problem.measured_input(place - 1) + nu);
      }
    }
  }

  BlocksInView blocks_of(const RheProblem& problem, const Window& window, int parameter) {
    BlocksInView view;
    const Blocking& blocking = *blockings[static_cast<std::size_t>(parameter)];
    const int N = window.intervals, farther = N + horizon + outlook;
    begins.assign(static_cast<std::size_t>(farther), 0);
    view.first_start = blocking.starts(window, begins.data());
    for (int i = 0; i < N; ++i)
      if (i == 0 || problem.structure().starts_block(i, parameter)) view.starts.push_back(window.first + i);
    if (blocking.is_one_block()) return view;
    // Starts that a longer window adds on the same intervals are suppressed now by the overlap. This holds only if the
    // block borders do not move with the window.
    std::fill(begins.begin(), begins.end(), std::uint8_t{0});
    blocking.starts({window.first, farther}, begins.data());
    const bool borders_stay = std::all_of(view.starts.begin(), view.starts.end(), [&](std::int64_t start) {
      return begins[static_cast<std::size_t>(start - window.first)] != 0;
    });
    if (!borders_stay) return view;
    for (int i = 1; i < N; ++i)
      if (begins[static_cast<std::size_t>(i)] && !problem.structure().starts_block(i, parameter))
        view.suppressed.push_back(window.first + i);
    for (int i = N; i < farther && view.next_start < 0; ++i)
      if (begins[static_cast<std::size_t>(i)]) view.next_start = window.first + i;
    return view;
  }

  static BlocksInView every_interval(const Window& window) {
    BlocksInView view;
    for (int i = 0; i < window.intervals; ++i) view.starts.push_back(window.first + i);
    view.first_start = window.first;
    view.next_start = window.first + window.intervals;
    return view;
  }

  /// Non-finite numbers if a window is not observable.
  void find_covariances(const WindowedEstimation& method) {
    const RheProblem& problem = method.problem();
    const Capacity capacity = problem.capacity();
    if (scratch.empty()) {
      qp = StageQp(capacity);
      riccati = Riccati(capacity);
      no_bounds = ActiveSet(capacity);
      scratch.assign(problem.scratch_size(), 0.0);
      covariances.assign(static_cast<std::size_t>(capacity.intervals + 1) * capacity.states * capacity.states, 0.0);
    }
    problem.linearise(all_stages(problem), method.solution(), Hessian::gauss_newton, qp, scratch);
    riccati.factor(qp, no_bounds);
    riccati.covariances(qp, covariances.data(), nullptr);
  }

  double sigma(int node, int entry, int states) const {
    const double variance =
        covariances[static_cast<std::size_t>(node) * states * states + static_cast<std::size_t>(entry) * (states + 1)];
    return variance >= 0.0 ? std::sqrt(variance) : std::numeric_limits<double>::quiet_NaN();
  }

  void write_window(const WindowedEstimation& method, const Estimate& estimate, Line& line) {
    const RheProblem& problem = method.problem();
    const Iterate& point = method.solution();
    const Window& window = method.window();
    const int N = window.intervals, nx = model->state_count(), nu = model->input_count(), np = model->parameter_count();
    // Of the vehicle's states; errors of sensors stand behind them.
    const int ns = problem.capacity().states, all = method.model().state_count();
    find_covariances(method);
    line.open('{');
    line.key("first");
    line.integer(window.first);
    line.key("intervals");
    line.integer(N);
    line.key("state");
    line.open('[');
    for (int j = 0; j < nx; ++j) line.column(N + 1, state_decimals[j], [&](int i) { return point.state(i)[j]; });
    line.close(']');
    const int decided = problem.model().input_count();
    // Behind those of the vehicle, a problem may have inputs and parameters that are process noise.
    const int shared = std::max(np, problem.model().parameter_count());
    row.resize(static_cast<std::size_t>(N) * std::max(decided, shared));
    line.key("input");
    line.open('[');
    for (int i = 0; i < N; ++i)
      problem.structure().inputs_on(point, i, row.data() + static_cast<std::ptrdiff_t>(i) * decided);
    for (int j = 0; j < nu; ++j) line.column(N, input_decimals[j], [&](int i) { return row[i * decided + j]; });
    line.close(']');
    line.key("blocks");
    line.open('[');
    const std::vector<int>& among_states = problem.model().description().parameter_states;
    for (int i = 0; i < N && among_states.empty(); ++i)
      problem.structure().parameters_on(point, i, row.data() + static_cast<std::ptrdiff_t>(i) * shared);
    for (int j = 0; j < np && N > 0; ++j) {
      const int entry = among_states.empty() ? all + j : among_states[j];
      // A parameter that is a state has a value at every node: that at the end of an interval.
      for (int i = 0; i < N && !among_states.empty(); ++i) row[i * shared + j] = point.state(i + 1)[entry];
      const BlocksInView view = among_states.empty() ? blocks_of(problem, window, j) : every_interval(window);
      const int count = static_cast<int>(view.starts.size());
      const auto interval = [&](int block) { return static_cast<int>(view.starts[block] - window.first); };
      line.open('{');
      line.key("starts");
      line.integers(view.starts);
      line.key("values");
      line.column(count, parameter_decimals[j], [&](int b) { return row[interval(b) * shared + j]; });
      line.key("sigmas");
      line.column(count, parameter_decimals[j] + 1, [&](int b) { return sigma(interval(b) + 1, entry, ns); });
      line.key("first_start");
      line.integer(view.first_start);
      line.key("next_start");
      if (view.next_start < 0) {
        line.null();
      } else {
        line.integer(view.next_start);
      }
      line.key("suppressed");
      line.integers(view.suppressed);
      line.close('}');
    }
    line.close(']');
    row.resize(2 * static_cast<std::size_t>(all + np));
    const bool has_arrival = method.arrival(row.data(), row.data() + all + np);
    const auto place = [&](int j) { return j < nx ? j : j - nx + all; };
    const auto decimals = [&](int j) { return j < nx ? state_decimals[j] : parameter_decimals[j - nx]; };
    line.key("arrival");
    line.open('{');
    line.key("mean");
    line.open('[');
    for (int j = 0; j < nx + np; ++j) line.number(row[place(j)], decimals(j));
    line.close(']');
    line.key("sigma");
    if (!has_arrival) {
      line.null();
    } else {
      line.open('[');
      for (int j = 0; j < nx + np; ++j) line.number(row[all + np + place(j)], decimals(j) + 1);
      line.close(']');
    }
    line.close('}');
    if (!among_states.empty()) {
      // What was given out: the mixture of all laws, not the window of one.
      line.key("estimate");
      line.open('[');
      for (int j = 0; j < nx; ++j) line.number(estimate.state[j], state_decimals[j]);
      for (int j = 0; j < np; ++j) line.number(estimate.parameters[j], parameter_decimals[j]);
      line.close(']');
    }
    line.key("status");
    line.word(name_of(estimate.report.status));
    line.key("fallback");
    line.flag(estimate.fallback);
    line.close('}');
  }

  void write_plan(const Controller& controller, const Controller::Command& command, Line& line) {
    const RhcProblem& problem = controller.problem();
    const Iterate& plan = controller.plan();
    const Roles& roles = model->description().roles;
    const int N = problem.intervals(), nx = model->state_count(), nu = model->input_count();
    line.open('{');
    line.key("state");
    line.open('[');
    for (int j = 0; j < nx; ++j) line.column(N + 1, state_decimals[j], [&](int i) { return plan.state(i)[j]; });
    line.close(']');
    row.resize(static_cast<std::size_t>(N) * nu);
    for (int i = 0; i < N; ++i) controller.plan_inputs(i, row.data() + static_cast<std::ptrdiff_t>(i) * nu);
    line.key("input");
    line.open('[');
    for (int j = 0; j < nu; ++j) line.column(N, input_decimals[j], [&](int i) { return row[i * nu + j]; });
    line.close(']');
    line.key("reference");
    line.open('{');
    for (const auto& [name, index] : {std::pair{"x", roles.position_x}, std::pair{"y", roles.position_y}}) {
      line.key(name);
      line.column(N + 1, state_decimals[index],
                  [&, index = index](int i) { return problem.state_reference(i)[index]; });
    }
    line.close('}');
    line.key("input_reference");
    line.open('[');
    for (int j = 0; j < nu; ++j)
      line.column(N, input_decimals[j], [&](int i) { return controller.input_reference(i, j); });
    line.close(']');
    line.key("lower");
    line.column(nu, 9, [&](int j) { return controller.input_lower(j); });
    line.key("upper");
    line.column(nu, 9, [&](int j) { return controller.input_upper(j); });
    line.key("status");
    line.word(name_of(command.report.status));
    line.key("fallback");
    line.flag(command.fallback);
    line.key("relaxed");
    line.flag(command.relaxed);
    line.close('}');
  }
};

HorizonLog::HorizonLog(const Robot& robot, std::int64_t samples, std::int64_t most)
    : parts_(std::make_unique<Parts>()) {
  Parts& parts = *parts_;
  parts.model = robot.model();
  parts.blockings = robot.make_blockings();
  parts.horizon = robot.estimator_options().horizon;
  const ModelDescription& about = parts.model->description();
  parts.state_decimals = decimals_of(about.states);
  parts.input_decimals = decimals_of(about.inputs);
  parts.parameter_decimals = decimals_of(about.parameters);
  parts.output_decimals = decimals_of(about.outputs);
  const std::int64_t room = std::clamp<std::int64_t>(most_intervals / std::max(1, parts.horizon), 10, most);
  parts.every = std::max<std::int64_t>(1, (samples + room - 1) / room);
}

HorizonLog::~HorizonLog() = default;
HorizonLog::HorizonLog(HorizonLog&&) noexcept = default;

std::int64_t HorizonLog::every() const noexcept { return parts_->every; }
std::int64_t HorizonLog::kept() const noexcept { return parts_->kept; }
const std::string& HorizonLog::records() const noexcept { return parts_->records; }

void HorizonLog::take(const LoopSample& sample) {
  Parts& parts = *parts_;
  const auto* window = dynamic_cast<const WindowedEstimation*>(&sample.estimator->method());
  if (window && !window->has_window()) window = nullptr;
  if (window) {
    parts.note_nodes(*window, sample.time);
    const Status status = sample.estimate->report.status;
    if (parts.statuses.empty() || parts.statuses.back().status != status)
      parts.statuses.push_back({sample.step, sample.time, status});
  }
  const bool fell_back = sample.estimate->fallback || (sample.command && sample.command->fallback);
  if (sample.step % parts.every != 0 && !fell_back) return;
  if (!window && !sample.controller) return;
  ++parts.kept;
  Line line(parts.records);
  line.open('{');
  line.key("sample");
  line.integer(sample.step);
  line.key("time");
  line.number(sample.time, time_decimals);
  line.key("rhe");
  if (window) {
    parts.write_window(*window, *sample.estimate, line);
  } else {
    line.null();
  }
  line.key("rhc");
  if (sample.controller) {
    parts.write_plan(*sample.controller, *sample.command, line);
  } else {
    line.null();
  }
  line.close('}');
  parts.records += '\n';
}

std::string HorizonLog::nodes_line(int variant) const {
  const Parts& parts = *parts_;
  const int count = static_cast<int>(parts.times.size());
  const int nu = parts.model->input_count(), ny = parts.model->output_count();
  std::string text;
  Line line(text);
  line.open('{');
  line.key("variant");
  line.integer(variant);
  line.key("every");
  line.integer(parts.every);
  line.key("records");
  line.integer(parts.kept);
  line.key("node_time");
  line.column(count, time_decimals, [&](int i) { return parts.times[i]; });
  line.key("output");
  line.open('[');
  for (int j = 0; j < ny; ++j)
    line.column(count, parts.output_decimals[j], [&](int i) { return parts.outputs[i * ny + j]; });
  line.close(']');
  line.key("input");
  line.open('[');
  for (int j = 0; j < nu; ++j)
    line.column(std::max(0, count - 1), parts.input_decimals[j], [&](int i) { return parts.inputs[i * nu + j]; });
  line.close(']');
  line.key("statuses");
  line.open('[');
  for (const Parts::Change& change : parts.statuses) {
    line.open('[');
    line.integer(change.node);
    line.number(change.time, time_decimals);
    line.word(name_of(change.status));
    line.close(']');
  }
  line.close(']');
  line.close('}');
  text += '\n';
  return text;
}

}  // namespace rhec::sim
