#include "rhec/sim/loop/run_files.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "rhec/sim/figures/run_picture.hpp"

namespace rhec::sim {
namespace {

Json json_of(const ErrorSummary& errors) {
  Json json;
  for (const auto& [name, value] : errors.parameters) json[name] = value;
  json["position"] = errors.position;
  json["heading"] = errors.heading;
  json["tracking"] = errors.tracking;
  return json;
}

Json json_of(const Spread& times) { return {{"median", times.median}, {"p99", times.p99}, {"max", times.max}}; }

/// The range of the truth and nearly all estimates; the first, uninformed ones would dwarf the rest.
void set_range(Panel& panel, double lower, double upper, std::vector<double> estimates) {
  std::sort(estimates.begin(), estimates.end());
  const std::size_t few = estimates.size() / 50;
  if (!estimates.empty()) {
    lower = std::min(lower, estimates[few]);
    upper = std::max(upper, estimates[estimates.size() - 1 - few]);
  }
  panel.lower = lower - 0.3 * (upper - lower);
  panel.upper = upper + 0.3 * (upper - lower);
}

/// The smallest and largest true value of a parameter during the run, slightly apart if it was constant.
std::pair<double, double> true_range(const RunLog& log, Eigen::Index parameter) {
  double lower = std::numeric_limits<double>::infinity(), upper = -lower;
  for (const Sample& sample : log.samples) {
    lower = std::min(lower, sample.true_parameters[parameter]);
    upper = std::max(upper, sample.true_parameters[parameter]);
  }
  const double least_width = 0.05 * std::max(std::abs(lower), std::abs(upper)) + 1e-3;
  if (upper - lower >= least_width) return {lower, upper};
  const double middle = 0.5 * (lower + upper);
  return {middle - 0.5 * least_width, middle + 0.5 * least_width};
}

/// A comma and the number like "{:.10g}", in half the time.
void append_number(double value, std::string& text) {
  std::array<char, 32> digits;
  const auto [end, error] = std::to_chars(digits.begin(), digits.end(), value, std::chars_format::general, 10);
  text += ',';
  text.append(digits.begin(), end);
}

/// Adds a span from each sample that is meant to the next that is not; half a step on either side.
template <class Function>
void add_spans(const RunLog& log, bool is_suspected, const Function& is_meant, std::vector<Span>& spans) {
  const double half = log.samples.size() > 1 ? 0.5 * (log.samples[1].time - log.samples[0].time) : 0.0;
  bool is_open = false;
  for (const Sample& sample : log.samples) {
    const bool is_in = is_meant(sample);
    if (is_in && !is_open) spans.push_back({sample.time - half, sample.time + half, is_suspected});
    if (is_in) spans.back().to = sample.time + half;
    is_open = is_in;
  }
}

/// When something went wrong, and when the estimator thought so.
std::vector<Span> fault_spans(const RunLog& log) {
  std::vector<Span> spans;
  add_spans(
      log, false, [](const Sample& sample) { return !sample.faults.empty(); }, spans);
  add_spans(
      log, true, [](const Sample& sample) { return sample.health != HealthLevel::ok; }, spans);
  return spans;
}

template <class Function>
Curve curve_of(const RunLog& log, std::string label, CurveRole role, const Function& value_of) {
  Curve curve;
  curve.label = std::move(label);
  curve.role = role;
  for (const Sample& sample : log.samples) {
    curve.times.push_back(sample.time);
    curve.values.push_back(value_of(sample));
  }
  return curve;
}

}  // namespace

std::string steps_csv(const RunLog& log, const Scenario& scenario) {
  const ModelDescription& about = scenario.robot().estimated_description();
  std::string text = "step,time";
  const auto head = [&](const char* prefix, const std::vector<Variable>& variables) {
    for (const Variable& variable : variables) text += fmt::format(",{}{}", prefix, variable.name);
  };
  head("true_", about.states);
  head("true_", about.parameters);
  head("", about.states);
  head("", about.parameters);
  head("sigma_", about.states);
  head("sigma_", about.parameters);
  head("", about.inputs);
  text +=
      ",reference_x,reference_y,reference_heading,reference_speed,tracking,heading_error,nees,estimator_status,"
      "controller_status,estimator_fallback,"
      "controller_fallback,relaxed,faults,health,findings\n";
  const std::size_t sigmas = about.states.size() + about.parameters.size();
  for (const Sample& sample : log.samples) {
    fmt::format_to(std::back_inserter(text), "{}", sample.step);
    append_number(sample.time, text);
    const auto row = [&](const auto& values) {
      for (const double value : values) append_number(value, text);
    };
    row(sample.true_state);
    row(sample.true_parameters);
    row(sample.state);
    row(sample.parameters);
    if (sample.sigma.size() > 0) {
      row(sample.sigma);
    } else {
      text.append(sigmas, ',');
    }
    row(sample.inputs);
    row(std::array{sample.reference.x, sample.reference.y, sample.reference.heading, sample.reference.speed,
                   sample.tracking, sample.heading_error});
    if (std::isfinite(sample.nees)) {
      append_number(sample.nees, text);
    } else {
      text += ',';
    }
    fmt::format_to(std::back_inserter(text), ",{},{},{:d},{:d},{:d},{},{},{}\n", name_of(sample.estimator_status),
                   name_of(sample.controller_status), sample.estimator_fallback, sample.controller_fallback,
                   sample.relaxed, sample.faults, name_of(sample.health), sample.findings);
  }
  return text;
}

std::string times_csv(const RunLog& log) {
  std::string text = "step,rhe_us,rhc_us\n";
  for (const Sample& sample : log.samples)
    fmt::format_to(std::back_inserter(text), "{},{:.3f},{:.3f}\n", sample.step, sample.estimator_us,
                   sample.controller_us);
  return text;
}

Json json_of(const RunSummary& summary) {
  Json json;
  json["steps"] = summary.steps;
  json["completed"] = summary.completed;
  json["ended"] = summary.ended;
  json["mae"] = json_of(summary.mae);
  json["rmse"] = json_of(summary.rmse);
  json["mae_after_start"] = json_of(summary.mae_after_start);
  json["nees"] = summary.nees;  // null if unknown
  json["nees_expected"] = summary.nees_expected;
  if (!summary.noise.empty()) {
    Json& noise = json["noise"] = Json::object();
    for (const auto& [output, learnt] : summary.noise)
      noise[output] = {{"sigma", learnt.sigma}, {"identified", learnt.is_identified}};
  }
  if (!summary.limits.empty()) {
    Json& limits = json["limits"] = Json::object();
    for (const auto& [name, record] : summary.limits)
      limits[name] = {{"violated", record.violated}, {"most", record.most}};
  }
  json["within_two_sigma"] = summary.within_two_sigma;
  json["certainty"] = summary.certainty == Certainty::unknown ? Json(nullptr) : Json(name_of(summary.certainty));
  json["solve_time_us"] = {{"rhe", json_of(summary.estimator_us)}, {"rhc", json_of(summary.controller_us)}};
  json["statuses"] = {{"rhe", summary.estimator_statuses}, {"rhc", summary.controller_statuses}};
  json["solves"] = summary.solves;
  json["fallbacks"] = summary.fallbacks;
  json["integration"] = {{"checked", summary.counts.integrated}, {"coarse", summary.counts.coarse}};
  json["health"] = summary.health;
  json["measurements"] = {{"late", summary.counts.late},       {"dropped", summary.counts.dropped},
                          {"missing", summary.counts.missing}, {"rejected", summary.counts.rejected},
                          {"rebased", summary.counts.rebased}, {"clocks_set", summary.counts.clocks_set}};
  return json;
}

std::string summary_json(const RunSummary& summary) { return json_of(summary).dump(2) + "\n"; }

std::string run_svg(const RunLog& log, const Scenario& scenario, const RunLog* causal) {
  const ModelDescription& about = scenario.robot().model()->description();
  const Roles& roles = about.roles;
  RunPicture picture;
  picture.title = scenario.options().name;
  picture.subtitle = fmt::format("{:g} m/s, seed {}; {}", scenario.options().speed, scenario.options().seed, log.ended);
  if (causal) picture.subtitle += "; estimated with hindsight";
  for (double s = 0.0; s <= scenario.path().length(); s += 0.5) {
    const PathPoint point = scenario.path().point_at(s);
    picture.path.push_back({point.x, point.y});
  }
  for (const Sample& sample : log.samples) {
    picture.driven.push_back({sample.true_state[roles.position_x], sample.true_state[roles.position_y]});
    picture.estimated.push_back({sample.state[roles.position_x], sample.state[roles.position_y]});
  }
  picture.spans = fault_spans(log);
  if (!about.parameters.empty()) {
    const int shown = std::max(0, roles.speed_factor);
    BaseMap base;
    base.title = "true " + about.parameters[shown].name;
    std::tie(base.lower, base.upper) = true_range(log, shown);
    base.value = [&scenario, shown, values = std::vector<double>(about.parameters.size())](double x, double y) mutable {
      scenario.terrain().sample(x, y, values.data());
      return values[shown];
    };
    picture.base = base;
  }
  const std::vector<Variable>& known = scenario.robot().estimated_description().states;
  const auto states = std::ssize(known);
  for (std::size_t j = 0; j < about.parameters.size(); ++j) {
    Panel panel;
    panel.title = about.parameters[j].meaning.empty()
                      ? about.parameters[j].name
                      : fmt::format("{} ({})", about.parameters[j].name, about.parameters[j].meaning);
    panel.unit = about.parameters[j].unit;
    const auto index = static_cast<Eigen::Index>(j);
    panel.curves.push_back(
        curve_of(log, "true", CurveRole::truth, [=](const Sample& s) { return s.true_parameters[index]; }));
    if (causal)
      panel.curves.push_back(
          curve_of(*causal, "while driving", CurveRole::other, [=](const Sample& s) { return s.parameters[index]; }));
    Curve estimate = curve_of(log, causal ? "with hindsight" : "estimated", CurveRole::estimate,
                              [=](const Sample& s) { return s.parameters[index]; });
    for (const Sample& sample : log.samples)
      if (sample.sigma.size() > 0) estimate.sigmas.push_back(sample.sigma[states + index]);
    panel.curves.push_back(std::move(estimate));
    const auto [lower, upper] = true_range(log, index);
    std::vector<double> estimates;
    for (const Sample& sample : log.samples)
      if (std::isfinite(sample.parameters[index])) estimates.push_back(sample.parameters[index]);
    set_range(panel, lower, upper, std::move(estimates));
    picture.panels.push_back(std::move(panel));
  }
  for (std::ptrdiff_t index = std::ssize(about.states); index < states; ++index) {
    const Variable& variable = known[static_cast<std::size_t>(index)];
    Panel panel;
    panel.title = fmt::format("{} ({})", variable.name, variable.meaning);
    panel.unit = variable.unit;
    panel.curves.push_back(
        curve_of(log, "true", CurveRole::truth, [=](const Sample& s) { return s.true_state[index]; }));
    Curve estimate = curve_of(log, "estimated", CurveRole::estimate, [=](const Sample& s) { return s.state[index]; });
    std::vector<double> values = panel.curves.front().values, estimates;
    for (const Sample& sample : log.samples) {
      if (sample.sigma.size() > 0) estimate.sigmas.push_back(sample.sigma[index]);
      if (std::isfinite(sample.state[index])) estimates.push_back(sample.state[index]);
    }
    panel.curves.push_back(std::move(estimate));
    const auto [lower, upper] = std::minmax_element(values.begin(), values.end());
    const double least = 1e-3 * variable.scale;
    set_range(panel, *lower - least, *upper + least, std::move(estimates));
    picture.panels.push_back(std::move(panel));
  }
  Panel tracking;
  tracking.title = "Distance from the path";
  tracking.unit = "m";
  tracking.curves.push_back(
      curve_of(log, "tracking error", CurveRole::other, [](const Sample& s) { return s.tracking; }));
  picture.panels.push_back(std::move(tracking));
  return draw_run(picture);
}

}  // namespace rhec::sim
