#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "report_parts.hpp"
#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> other_errors = {"position", "heading", "tracking"};

/// The variables of a run, from the names of its columns.
struct Names {
  std::vector<std::string> states, parameters, inputs;
};

Names names_of(const ResultTable& steps, const Json& summary, const fs::path& folder) {
  Names names;
  const Json& mae = member(summary, "mae", folder / "summary.json", run_maker);
  for (const std::string& column : steps.header()) {
    if (!column.starts_with("true_")) continue;
    const std::string name = column.substr(5);
    if (std::find(other_errors.begin(), other_errors.end(), name) == other_errors.end() && mae.contains(name)) {
      names.parameters.push_back(name);
    } else {
      names.states.push_back(name);
    }
  }
  // step, time, then four groups of states and parameters, then the inputs.
  const std::size_t first = 2 + 3 * (names.states.size() + names.parameters.size()), end = steps.column("reference_x");
  if (names.states.empty() || end < first)
    throw Error(fmt::format("{}:1: has no columns of a run; expected those of docs/results.md; make it again with '{}'",
                            steps.file().string(), run_maker));
  for (std::size_t i = first; i < end; ++i) names.inputs.push_back(steps.header()[i]);
  return names;
}

/// Default description of variables if only their names are known.
Json bare(const std::vector<std::string>& names) {
  Json list = Json::array();
  for (const std::string& name : names)
    list.push_back({{"name", name},
                    {"unit", ""},
                    {"meaning", ""},
                    {"is_angle", false},
                    {"lower", nullptr},
                    {"upper", nullptr},
                    {"scale", 1.0},
                    {"nominal", nullptr}});
  return list;
}

int role_of(const Json& model, const char* role) { return model.at("roles").value(role, -1); }

class RunReport {
 public:
  RunReport(const fs::path& folder, const Json& summary)
      : folder_(folder),
        summary_(summary),
        steps_(folder / "steps.csv", run_maker),
        names_(names_of(steps_, summary, folder)),
        time_(steps_.numbers("time")) {
    steps_.require_rows(member(summary, "steps", folder / "summary.json", run_maker).get<std::int64_t>(),
                        "summary.json");
    if (fs::exists(folder / "horizons.jsonl")) {
      horizons_ = read_horizons(folder / "horizons.jsonl", run_maker, "run");
      require_same_run();
    }
  }

  Json document() {
    notes_ = Json::array();
    describe();
    const std::size_t curves = names_.states.size() + names_.parameters.size() + names_.inputs.size() + 4;
    most_ = std::clamp(most_values / curves, std::size_t{600}, most_rows);
    document_["times"] = Json::object();
    if (time_.size() <= most_) document_["times"]["all"] = column_of(time_, thin({}, time_.size(), most_).rows);
    document_["samples"] = {{"total", time_.size()}, {"kept", std::min(time_.size(), most_)}, {"how", "every sample"}};
    variables("states", names_.states);
    variables("parameters", names_.parameters);
    inputs();
    errors();
    statuses();
    faults();
    map();
    solve_times();
    horizons();
    if (time_.size() > most_) {
      document_["samples"]["how"] = words_;
      add_note(notes_, "samples", words_);
    }
    document_["notes"] = std::move(notes_);
    return std::move(document_);
  }

 private:
  /// An older program may have written to the folder since; its windows are then from another run.
  void require_same_run() const {
    const Json& head = horizons_->head;
    bool same = head.value("samples", std::size_t{0}) == time_.size();
    const auto same_names = [&](const char* key, const std::vector<std::string>& names) {
      const Json list = head.contains("model") ? head.at("model").value(key, Json::array()) : Json::array();
      bool equal = list.size() == names.size();
      for (std::size_t i = 0; equal && i < names.size(); ++i) equal = list[i].value("name", "") == names[i];
      return equal;
    };
    same = same && same_names("states", names_.states) && same_names("parameters", names_.parameters) &&
           same_names("inputs", names_.inputs);
    const std::vector<Json>& records = horizons_->variants.front().records;
    for (std::size_t i = 0; same && i < records.size(); ++i) same = is_of_this_run(records[i]);
    if (!same)
      throw Error(
          fmt::format("{}: is of another run than steps.csv; make the run again with '{}', or take the file away (the "
                      "report then does without horizons)",
                      (folder_ / "horizons.jsonl").string(), run_maker));
  }

  bool is_of_this_run(const Json& record) const {
    const auto row = record.at("sample").get<std::int64_t>();
    if (row >= steps_.rows()) return false;
    const Json &window = record.at("rhe"), &plan = record.at("rhc");
    if (plan.is_object()) {
      const std::size_t first = steps_.column(names_.inputs.front());
      for (std::size_t j = 0; j < names_.inputs.size(); ++j) {
        const Json& planned = plan.at("input").at(j);
        // The applied input can differ from the plan if the plan was unusable.
        if (plan.at("fallback").get<bool>() || planned.empty()) continue;
        if (!is_close(planned.front(), steps_.number(row, first + j))) return false;
      }
    }
    if (window.is_object() && !window.at("fallback").get<bool>())
      for (std::size_t j = 0; j < names_.states.size(); ++j) {
        const Json& last = window.contains("estimate") ? window.at("estimate").at(j) : window.at("state").at(j).back();
        if (!is_close(last, steps_.number(row, steps_.column(names_.states[j])))) return false;
      }
    return true;
  }

  static bool is_close(const Json& number, double value) {
    if (!number.is_number()) return !std::isfinite(value);
    return std::abs(number.get<double>() - value) <= 1e-3 * std::max(1.0, std::abs(value));
  }

  void describe() {
    document_["kind"] = "run";
    document_["title"] = folder_.filename().string();
    if (horizons_) {
      const Json& head = horizons_->head;
      document_["title"] = head.value("name", "run");
      document_["model"] = head.at("model");
      document_["settings"] = head.at("settings");
    } else {
      Json& model = document_["model"] = {{"name", ""}, {"source", ""}};
      model["states"] = bare(names_.states);
      model["inputs"] = bare(names_.inputs);
      model["parameters"] = bare(names_.parameters);
      model["outputs"] = Json::array();
      // The vehicle's position and heading come first in all models of rhec, but the files do not state this.
      model["roles"] = {{"position_x", -1}, {"position_y", -1}, {"heading", -1}, {"speed", -1}, {"speed_factor", -1}};
      model["position_outputs"] = nullptr;
      document_["settings"] = nullptr;
      add_note(notes_, "horizons",
               "The run has no horizons.jsonl, since an older program made it: windows, plans, path, the map of slip, "
               "units and bounds are left out. Run it again with this program to have them.");
    }
    const bool is_angle_known = horizons_.has_value();
    for (const std::string& name : names_.states) {
      const Json* found = find_variable("states", name);
      is_angle_.push_back(is_angle_known && found && found->at("is_angle").get<bool>());
    }
    document_["subtitle"] = member(summary_, "ended", folder_ / "summary.json", run_maker);
    document_["summary"] = summary_;
  }

  const Json* find_variable(const char* kind, const std::string& name) const {
    for (const Json& variable : document_.at("model").at(kind))
      if (variable.at("name") == name) return &variable;
    return nullptr;
  }

  /// The time column of the given rows: that of all samples, or a separate one with this name.
  Json time_key(const std::string& name, const Thinned& thinned) {
    if (thinned.stretch == 1) return "all";
    document_["times"][name] = column_of(time_, thinned.rows);
    words_ = thinning_words(thinned, time_.size(), "Curves");
    return name;
  }

  void variables(const char* kind, const std::vector<std::string>& names) {
    Json& list = document_[kind] = Json::array();
    for (std::size_t j = 0; j < names.size(); ++j) {
      const std::string& name = names[j];
      const bool is_angle = std::string(kind) == "states" && is_angle_[j];
      const std::vector<double> truth = steps_.numbers("true_" + name), estimate = steps_.numbers(name),
                                sigma = steps_.numbers("sigma_" + name);
      std::vector<double> error(truth.size());
      for (std::size_t i = 0; i < truth.size(); ++i)
        error[i] = is_angle ? angle_difference(estimate[i], truth[i]) : estimate[i] - truth[i];
      const bool has_sigma = std::any_of(sigma.begin(), sigma.end(), [](double value) { return std::isfinite(value); });
      const Thinned thinned = thin({&truth, &estimate, &error, &sigma}, time_.size(), most_);
      Json series = {{"name", name}, {"time", time_key(name, thinned)}};
      series["true"] = column_of(truth, thinned.rows);
      series["estimate"] = column_of(estimate, thinned.rows);
      series["sigma"] = has_sigma ? column_of(sigma, thinned.rows) : Json(nullptr);
      series["error"] = column_of(error, thinned.rows);
      list.push_back(std::move(series));
    }
  }

  /// Bounds of the input in the controller at each recorded sample; a single number if constant.
  Json bounds_of(std::size_t input, const char* side, const std::vector<std::size_t>& rows) const {
    if (!horizons_) return nullptr;
    std::vector<std::pair<std::size_t, Json>> found;
    for (const Json& record : horizons_->variants.front().records)
      if (record.at("rhc").is_object())
        found.emplace_back(record.at("sample").get<std::size_t>(), record.at("rhc").at(side).at(input));
    if (found.empty()) return nullptr;
    if (std::all_of(found.begin(), found.end(), [&](const auto& entry) { return entry.second == found[0].second; }))
      return found[0].second;
    Json column = Json::array();
    std::size_t entry = 0;
    for (const std::size_t row : rows) {
      while (entry + 1 < found.size() && found[entry + 1].first <= row) ++entry;
      column.push_back(found[entry].second);
    }
    return column;
  }

  void inputs() {
    Json& list = document_["inputs"] = Json::array();
    for (std::size_t j = 0; j < names_.inputs.size(); ++j) {
      const std::vector<double> values = steps_.numbers(names_.inputs[j]);
      const Thinned thinned = thin({&values}, time_.size(), most_);
      Json series = {{"name", names_.inputs[j]}, {"time", time_key(names_.inputs[j], thinned)}};
      series["values"] = column_of(values, thinned.rows);
      series["lower"] = bounds_of(j, "lower", thinned.rows);
      series["upper"] = bounds_of(j, "upper", thinned.rows);
      list.push_back(std::move(series));
    }
  }

  void error_curve(const char* name, const char* unit, const char* meaning, const std::vector<double>& values) {
    if (std::none_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); })) return;
    const Thinned thinned = thin({&values}, time_.size(), most_);
    document_["errors"].push_back({{"name", name},
                                   {"unit", unit},
                                   {"meaning", meaning},
                                   {"time", time_key(std::string("error ") + name, thinned)},
                                   {"values", column_of(values, thinned.rows)}});
  }

  std::vector<double> state_column(const char* prefix, int state) const {
    return steps_.numbers(prefix + names_.states[static_cast<std::size_t>(state)]);
  }

  void errors() {
    document_["errors"] = Json::array();
    const Json& model = document_["model"];
    const int x = role_of(model, "position_x"), y = role_of(model, "position_y"), heading = role_of(model, "heading");
    if (x >= 0 && y >= 0) {
      const std::vector<double> true_x = state_column("true_", x), true_y = state_column("true_", y),
                                estimated_x = state_column("", x), estimated_y = state_column("", y);
      std::vector<double> values(time_.size());
      for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = std::hypot(estimated_x[i] - true_x[i], estimated_y[i] - true_y[i]);
      error_curve("position", "m", "distance of the estimated position from the true one", values);
    }
    if (heading >= 0) {
      const std::vector<double> truth = state_column("true_", heading), estimate = state_column("", heading);
      std::vector<double> values(time_.size());
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = angle_difference(estimate[i], truth[i]);
      error_curve("heading", "rad", "estimated heading less the true one", values);
    }
    error_curve("tracking", "m", "distance of the true position from the path, positive to its left",
                steps_.numbers("tracking"));
    error_curve("nees", "1", "normalised estimation error squared", steps_.numbers("nees"));
  }

  Json events(const char* name) const {
    const std::size_t index = steps_.column(name);
    Json list = Json::array();
    for (std::int64_t row = 0; row < steps_.rows(); ++row)
      if (steps_.text(row, index) != "0") list.push_back({row, seen(time_[static_cast<std::size_t>(row)])});
    return list;
  }

  /// What went wrong, and what the estimator found, as spans of time; runs of older programs do not say.
  void faults() {
    for (const char* column : {"faults", "findings"}) {
      Json& spans = document_[column] = Json::array();
      if (steps_.has(column) && time_.size() > 1) add_spans(column, spans);
    }
  }

  void add_spans(const char* column, Json& spans) {
    const std::size_t index = steps_.column(column);
    const double half = 0.5 * (time_[1] - time_[0]);
    std::string_view last;
    for (std::size_t row = 0; row < time_.size(); ++row) {
      const std::string_view now = steps_.text(static_cast<std::int64_t>(row), index);
      if (!now.empty() && now != last) spans.push_back({{"from", seen(time_[row] - half)}, {"what", std::string(now)}});
      if (!now.empty()) spans.back()["to"] = seen(time_[row] + half);
      last = now;
    }
  }

  Json status_of(const char* name, const Json& counts, const char* who) {
    if (counts.empty()) return nullptr;
    const std::size_t index = steps_.column(name);
    Json changes = Json::array();
    std::string_view last;
    for (std::int64_t row = 0; row < steps_.rows(); ++row) {
      const std::string_view status = steps_.text(row, index);
      if (row > 0 && status == last) continue;
      last = status;
      changes.push_back({row, seen(time_[static_cast<std::size_t>(row)]), std::string(status)});
    }
    if (changes.size() > most_status_changes) {
      add_note(notes_, "statuses",
               fmt::format("The {}'s status changes {} times, so that only how often there was which is shown.", who,
                           counted(std::ssize(changes))));
      changes = nullptr;
    }
    return {{"counts", counts}, {"changes", std::move(changes)}};
  }

  void statuses() {
    const Json& counts = member(summary_, "statuses", folder_ / "summary.json", run_maker);
    document_["statuses"] = {
        {"rhe", status_of("estimator_status", counts.value("rhe", Json::object()), "estimator")},
        {"rhc", status_of("controller_status", counts.value("rhc", Json::object()), "controller")}};
    document_["fallbacks"] = {{"rhe", events("estimator_fallback")}, {"rhc", events("controller_fallback")}};
    document_["relaxed"] = events(steps_.has("relaxed") ? "relaxed" : "softened");  // name in earlier versions
  }

  void map() {
    const Json& model = document_["model"];
    const int x = role_of(model, "position_x"), y = role_of(model, "position_y");
    if (x < 0 || y < 0) {
      document_["map"] = nullptr;
      return;
    }
    const std::vector<double> true_x = state_column("true_", x), true_y = state_column("true_", y),
                              estimated_x = state_column("", x), estimated_y = state_column("", y);
    const Thinned truth = thin({&true_x, &true_y}, time_.size(), most_track_points / 2),
                  estimate = thin({&estimated_x, &estimated_y}, time_.size(), most_track_points / 2);
    Json map;
    map["path"] = horizons_->head.at("path");
    map["true"] = {{"x", column_of(true_x, truth.rows)},
                   {"y", column_of(true_y, truth.rows)},
                   {"time", time_key("true track", truth)}};
    map["estimated"] = {{"x", column_of(estimated_x, estimate.rows)},
                        {"y", column_of(estimated_y, estimate.rows)},
                        {"time", time_key("estimated track", estimate)}};
    map["slip"] = horizons_->head.at("slip");
    for (Json& raster : map["slip"]) {
      double lower = std::numeric_limits<double>::infinity(), upper = -lower;
      for (const Json& value : raster.at("values")) {
        if (!value.is_number()) continue;
        lower = std::min(lower, value.get<double>());
        upper = std::max(upper, value.get<double>());
      }
      raster["lower"] = seen(lower);
      raster["upper"] = seen(upper);
    }
    document_["map"] = std::move(map);
  }

  void solve_times() {
    document_["solve_times"] = {{"rhe", nullptr}, {"rhc", nullptr}};
    if (!fs::exists(folder_ / "times.csv"))
      throw Error(fmt::format("{}: is missing; expected steps.csv, times.csv and summary.json; make it again with '{}'",
                              (folder_ / "times.csv").string(), run_maker));
    const ResultTable times(folder_ / "times.csv", run_maker);
    times.require_rows(steps_.rows(), "steps.csv");
    const Json& spreads = member(summary_, "solve_time_us", folder_ / "summary.json", run_maker);
    for (const char* who : {"rhe", "rhc"}) {
      Json histogram = times_histogram(times.numbers(std::string(who) + "_us"));
      if (histogram.is_null()) continue;
      histogram.update(spreads.at(who));
      document_["solve_times"][who] = std::move(histogram);
    }
    if (document_["solve_times"]["rhe"].is_null())
      add_note(notes_, "times", "The estimator solves no problems, so it has no solve times and no statuses.");
  }

  void horizons() {
    document_["horizons"] = nullptr;
    if (!horizons_) return;
    std::vector<std::vector<double>> truth;
    for (const std::string& name : names_.parameters) truth.push_back(steps_.numbers("true_" + name));
    const HorizonFile::Variant& variant = horizons_->variants.front();
    document_["horizons"] = horizons_of(variant, time_.size(), most_horizon_bytes, truth, notes_);
    if (document_["horizons"].is_null()) return;
    document_["settings"]["control_horizon"] = document_["horizons"]["control_horizon"];
    if (variant.records.front().at("rhe").is_null())
      add_note(notes_, "horizons",
               "The estimator has no window, so that only what the controller plans is shown of each sample.");
  }

  fs::path folder_;
  const Json& summary_;
  ResultTable steps_;
  Names names_;
  std::vector<double> time_;
  std::optional<HorizonFile> horizons_;
  std::vector<bool> is_angle_;
  std::size_t most_ = most_rows;
  Json document_, notes_;
  std::string words_;  ///< describes how curves were thinned
};

}  // namespace

Json run_report(const fs::path& folder, const Json& summary) { return RunReport(folder, summary).document(); }

}  // namespace rhec::sim
