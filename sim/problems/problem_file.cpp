// Reads and writes records as lines of a file, and writes solution lines.
#include "rhec/sim/problems/problem_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "format_parts.hpp"
#include "rhec/core/model/step_requirement.hpp"

namespace rhec::sim {
namespace {

/// Whether a number that JSON does not have, as other writers put it, begins about there.
bool is_not_finite_at(std::string_view text, std::size_t column) {
  const std::string_view there = text.substr(std::min(text.size(), column > 1 ? column - 2 : 0), 4);
  for (const std::string_view word : {"NaN", "nan", "Inf", "inf"})
    if (there.find(word) != std::string_view::npos) return true;
  return false;
}

Json parse(std::string_view text, const std::string& where) {
  try {
    return Json::parse(text, Json::RepeatedKeys::refused);
  } catch (const JsonParseError& mistake) {
    if (mistake.cause == JsonParseError::Cause::repeated_key)
      throw Error(at_key(where, mistake.key, "the key is written twice; keep one of them"));
    if (mistake.cause == JsonParseError::Cause::nesting)
      throw Error(fmt::format("{}: {}; expected one problem, {{...}}, on each line", where, mistake.what()));
    if (mistake.cause == JsonParseError::Cause::large_number)
      throw Error(fmt::format("{}: a number is too large; expected finite numbers", where));
    if (is_not_finite_at(text, mistake.byte))
      throw Error(
          fmt::format("{}: column {}: a number that is not finite, which JSON does not have; expected null where "
                      "a measurement or a bound is missing",
                      where, mistake.byte));
    throw Error(
        fmt::format("{}: column {}: no JSON; expected one problem, {{...}}, on each line", where, mistake.byte));
  }
}

constexpr const char *explicit_name = "rk4", *implicit_name = "radau5";

void read_version(const LineValue& line, ProblemRecord& record) {
  if (!line.has("version")) return;
  record.version = line["version"].integer(1);
  if (record.version > problem_format_version)
    throw line["version"].mismatch(
        fmt::format("1 .. {}, which is what this rhec understands; use a newer one", problem_format_version));
}

void read_horizon(const LineValue& horizon, const ProblemFormat& format, ProblemRecord& record) {
  horizon.allow({"intervals", "dt", "integrator", "substeps"});
  // Before an estimator's second node its window has no intervals.
  const bool may_be_empty = record.version >= 2 && format.traits().may_be_empty;
  record.intervals = horizon["intervals"].integer(may_be_empty ? 0 : 1);
  constexpr int most_intervals = 1000000;  // a line with a wrong number must not take the machine's memory
  if (record.intervals > most_intervals)
    throw horizon["intervals"].mismatch(fmt::format("at most {} intervals", most_intervals));
  const auto N = static_cast<std::size_t>(record.intervals);
  const LineValue dt = horizon["dt"];
  const auto duration = [](const LineValue& value) {
    if (!(value.number() > 0.0)) throw value.mismatch("a number above 0 [s]");
    return value.number();
  };
  if (record.version >= 2 && dt.is_list()) {
    for (const LineValue& item : dt.items("a list of numbers")) record.durations.push_back(duration(item));
    if (record.durations.size() != N)
      throw dt.error(fmt::format("{} numbers, expected {}: one for each interval", record.durations.size(), N));
  } else {
    if (dt.is_list()) throw dt.mismatch("a number; a list of them is for lines with \"version\": 2");
    record.durations.assign(N, duration(dt));
  }
  const std::string integrator = horizon["integrator"].text();
  record.is_implicit = integrator == implicit_name;
  if (!record.is_implicit && integrator != explicit_name)
    throw horizon["integrator"].mismatch(fmt::format(
        "\"{}\", the classical Runge-Kutta step, or \"{}\", that of Radau IIA", explicit_name, implicit_name));
  if (record.is_implicit && record.version < 4)
    throw horizon["integrator"].mismatch(
        fmt::format("\"{}\"; \"{}\" is for lines with \"version\": 4", explicit_name, implicit_name));
  record.substeps = horizon["substeps"].integer(1);
  if (record.substeps > StepRequirement::most_substeps)
    throw horizon["substeps"].mismatch(fmt::format("at most {}", StepRequirement::most_substeps));
}

/// One side of a pair of bounds, for every interval.
std::vector<double> read_side(const LineValue& side, double none, std::size_t intervals) {
  if (!side.is_list()) return std::vector<double>(intervals, side.number_or(none));
  std::vector<double> values;
  for (const LineValue& item : side.items("a list of numbers")) values.push_back(item.number_or(none));
  if (values.size() != intervals)
    throw side.error(fmt::format("{} numbers, expected {}: one for each interval", values.size(), intervals));
  return values;
}

void read_bounds(const LineValue& bounds, const ProblemFormat& format, ProblemRecord& record) {
  bounds.for_each([&](const std::string& name, const LineValue& pair) {
    constexpr std::string_view expected = "[lower, upper], null for none";
    const std::vector<LineValue> sides = pair.items(expected);
    if (sides.size() != 2) throw pair.mismatch(expected);
    const bool by_interval =
        record.version >= 2 && format.traits().has_interval_bounds && (sides[0].is_list() || sides[1].is_list());
    const std::size_t count = by_interval ? static_cast<std::size_t>(record.intervals) : 1;
    const auto read = [&](const LineValue& side, double none) {
      return by_interval ? read_side(side, none, count) : std::vector<double>{side.number_or(none)};
    };
    const std::vector<double> lower = read(sides[0], -unbounded), upper = read(sides[1], unbounded);
    std::vector<ProblemRecord::Interval> all;
    for (std::size_t i = 0; i < count; ++i) {
      if (!(lower[i] <= upper[i]))
        throw pair.error(fmt::format("found [{}, {}]{}, expected lower <= upper", lower[i], upper[i],
                                     by_interval ? fmt::format(" on interval {}", i) : ""));
      all.push_back({lower[i], upper[i]});
    }
    if (by_interval) {
      record.interval_bounds[name] = std::move(all);
    } else {
      record.bounds[name] = all.front();
    }
  });
}

void read_guess(const LineValue& guess, ProblemRecord& record) {
  guess.allow({"states", "controls", "costates", "state_bounds", "control_bounds"}, {{4, {"limit_bounds"}}},
              record.version);
  const auto N = static_cast<std::size_t>(record.intervals);
  constexpr std::string_view by_node = "one for each node of the horizon", by_interval = "one for each interval";
  ProblemRecord::Guess rows;
  rows.states = guess["states"].ragged(N + 1, by_node);
  rows.controls = guess["controls"].ragged(N, by_interval);
  if (guess.has("costates")) rows.costates = guess["costates"].ragged(N + 1, by_node);
  if (guess.has("state_bounds")) rows.state_bounds = guess["state_bounds"].ragged(N + 1, by_node);
  if (guess.has("control_bounds")) rows.control_bounds = guess["control_bounds"].ragged(N, by_interval);
  if (guess.has("limit_bounds")) rows.limit_bounds = guess["limit_bounds"].ragged(N + 1, by_node);
  record.guess = std::move(rows);
}

Json bounds_of(const ProblemRecord& record) {
  Json all = map_of(record.bounds, [](const ProblemRecord::Interval& bounds) {
    return Json{number_or_null(bounds[0]), number_or_null(bounds[1])};
  });
  for (const auto& [name, bounds] : record.interval_bounds) {
    Json sides = Json::array();
    for (const int side : {0, 1}) {
      std::vector<double> values;
      for (const ProblemRecord::Interval& each : bounds) values.push_back(each[side]);
      const bool same =
          std::all_of(values.begin(), values.end(), [&](double value) { return value == values.front(); });
      sides.push_back(same ? number_or_null(values.front()) : list_of(values));
    }
    if (!sides[0].is_array() && !sides[1].is_array())
      sides[1] = list_of(std::vector<double>(bounds.size(), bounds.front()[1]));
    all[name] = std::move(sides);
  }
  return all;
}

/// Whether any stage has a value at a bound.
bool at_bound(const double* values, const double* lower, const double* upper, int count) {
  for (int j = 0; j < count; ++j) {
    const double hair = 1e-7 * (1.0 + std::abs(values[j]));
    if (values[j] <= lower[j] + hair || values[j] >= upper[j] - hair) return true;
  }
  return false;
}

bool any_bound_active(const HorizonProblem& problem, const Iterate& point) {
  for (int i = 0; i <= problem.intervals(); ++i) {
    if (at_bound(point.state(i), problem.state_lower(i), problem.state_upper(i), problem.state_count(i))) return true;
    if (i < problem.intervals() &&
        at_bound(point.control(i), problem.control_lower(i), problem.control_upper(i), problem.control_count(i)))
      return true;
  }
  return false;
}

void append_number(std::string& text, double value) {
  if (value == 0.0 && std::signbit(value)) {
    text += "-0.0";  // "-0" would be read as an integer and lose its sign
  } else if (std::isfinite(value)) {
    fmt::format_to(std::back_inserter(text), "{:.17g}", value);
  } else {
    text += "null";
  }
}

/// `, "key": [[...], ...]`
template <class Row>
void append_rows(std::string& text, std::string_view key, int rows, int columns, Row row_of) {
  fmt::format_to(std::back_inserter(text), ", \"{}\": [", key);
  std::vector<double> row(columns);
  for (int i = 0; i < rows; ++i) {
    text += i == 0 ? "[" : ", [";
    row_of(i, row.data());
    for (int j = 0; j < columns; ++j) {
      if (j > 0) text += ", ";
      append_number(text, row[j]);
    }
    text += "]";
  }
  text += "]";
}

}  // namespace

ProblemRecord read_problem(std::string_view text, const std::string& file, int line_number) {
  ProblemRecord record;
  record.where = fmt::format("{}:{}", file, line_number);
  const Json parsed = parse(text, record.where);
  const LineValue line(parsed, "", record.where);
  read_version(line, record);
  record.set_id(line["id"].text());
  const std::string kind = line["problem"].text();
  const ProblemFormat* format = find_problem_format(kind);
  if (!format) throw line["problem"].mismatch(fmt::format("\"{}\"", fmt::join(problem_kinds(), "\" or \"")));
  record.kind = kind;
  line.allow(format->traits().keys, format->traits().added, record.version);
  record.model = line["model"]["name"].text();
  record.model_options = Settings::map({file, line_number});
  line["model"].for_each([&](const std::string& key, const LineValue& value) {
    if (key != "name") record.model_options.add(key, value.settings());
  });
  read_horizon(line["horizon"], *format, record);
  read_bounds(line["bounds"], *format, record);
  format->read(line, record);
  if (line.has("guess")) read_guess(line["guess"], record);
  if (line.has("origin"))
    line["origin"].for_each([&](const std::string& key, const LineValue& value) { record.origin[key] = value.text(); });
  return record;
}

std::vector<ProblemRecord> read_problems(std::string_view text, const std::string& file) {
  std::vector<ProblemRecord> records;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view each = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (each.find_first_not_of(" \t\r") != std::string_view::npos) records.push_back(read_problem(each, file, line));
  }
  return records;
}

std::string problem_line(const ProblemRecord& record) {
  Json line;
  line["version"] = problem_format_version;
  line["id"] = record.id;
  line["problem"] = record.kind;
  line["model"]["name"] = record.model;
  for (const auto& [key, value] : record.model_options.members()) line["model"][key] = json_of(value);
  const auto& durations = record.durations;
  const bool same = !durations.empty() && std::all_of(durations.begin(), durations.end(),
                                                      [&](double value) { return value == durations.front(); });
  line["horizon"] = {{"intervals", record.intervals},
                     {"dt", same ? number_or_null(durations.front()) : list_of(durations)},
                     {"integrator", record.is_implicit ? implicit_name : explicit_name},
                     {"substeps", record.substeps}};
  problem_format(record.kind).write(record, line);
  line["bounds"] = bounds_of(record);
  if (record.guess) {
    Json& guess = line["guess"];
    guess["states"] = rows_of(record.guess->states);
    guess["controls"] = rows_of(record.guess->controls);
    const auto add = [&](const char* key, const ProblemRecord::Rows& rows) {
      const auto is_zero = [](const std::vector<double>& row) {
        return std::all_of(row.begin(), row.end(), [](double value) { return value == 0.0 && !std::signbit(value); });
      };
      if (!std::all_of(rows.begin(), rows.end(), is_zero)) guess[key] = rows_of(rows);
    };
    add("costates", record.guess->costates);
    add("state_bounds", record.guess->state_bounds);
    add("control_bounds", record.guess->control_bounds);
    add("limit_bounds", record.guess->limit_bounds);
  }
  if (!record.origin.empty())
    line["origin"] = map_of(record.origin, [](const std::string& text) { return Json(text); });
  return line.dump();
}

std::string solution_line(const ProblemRecord& record, const HorizonProblem& problem, const Iterate& point,
                          const Outcome& outcome) {
  const Model& model = problem.model();
  const int N = problem.intervals();
  std::string text = fmt::format("{{\"id\": {}, \"objective\": ", Json(record.id).dump());
  append_number(text, outcome.objective);
  append_rows(text, "states", N + 1, model.state_count(),
              [&](int i, double* row) { std::copy_n(point.state(i), model.state_count(), row); });
  append_rows(text, "inputs", N, model.input_count(),
              [&](int i, double* row) { problem.structure().inputs_on(point, i, row); });
  if (problem_format(record.kind).traits().finds_parameters)
    append_rows(text, "parameters", N, model.parameter_count(),
                [&](int i, double* row) { problem.structure().parameters_on(point, i, row); });
  fmt::format_to(
      std::back_inserter(text), ", \"bounds_active\": {}, \"solver\": {}, \"status\": \"{}\", \"iterations\": {}",
      any_bound_active(problem, point), Json(outcome.solver).dump(), name_of(outcome.status), outcome.iterations);
  text += ", \"kkt_residual\": ";
  append_number(text, outcome.kkt_residual);
  text += ", \"solve_time_us\": ";
  append_number(text, std::round(outcome.solve_time_us * 1e3) / 1e3);
  return text + "}";
}

}  // namespace rhec::sim
