#include "format_parts.hpp"

#include <algorithm>
#include <cmath>

namespace rhec::sim {

bool is_ramp(const ProblemRecord& record, const std::string& name) {
  const auto at = record.transition.find(name);
  return at != record.transition.end() && at->second == Transition::ramp;
}

void read_block_starts(const LineValue& starts, ProblemRecord& record) {
  starts.for_each([&](const std::string& name, const LineValue& list) {
    const bool ramp = is_ramp(record, name);
    std::vector<int> intervals;
    for (const LineValue& item : list.items("a list of intervals")) {
      const int start = item.integer(0);
      if (start >= record.intervals && (start > 0 || ramp))
        throw item.mismatch(record.intervals > 0 ? fmt::format("an interval of 0 .. {}", record.intervals - 1)
                                                 : "none: the horizon has no interval");
      if (!intervals.empty() && start <= intervals.back()) throw item.mismatch("starts that increase");
      intervals.push_back(start);
    }
    if (!ramp && (intervals.empty() || intervals.front() != 0))
      throw list.error("expected the intervals at which a block begins, 0 first");
    record.block_starts[name] = std::move(intervals);
  });
}

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json list_of(const std::vector<double>& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(number_or_null(value));
  return list;
}

Json rows_of(const ProblemRecord::Rows& rows) {
  Json list = Json::array();
  for (const std::vector<double>& row : rows) list.push_back(list_of(row));
  return list;
}

std::vector<double> copied(const double* values, int count) { return {values, values + count}; }

void keep_bounds(ProblemRecord& record, const std::vector<Variable>& variables, const std::vector<double>& lower,
                 const std::vector<double>& upper) {
  for (std::size_t j = 0; j < variables.size(); ++j)
    if (std::isfinite(lower[j]) || std::isfinite(upper[j])) record.bounds[variables[j].name] = {lower[j], upper[j]};
}

bool is_one_block(const ProblemRecord& record, const Model& model, int parameter) {
  const std::string& name = model.description().parameters[parameter].name;
  const auto starts = record.block_starts.find(name);
  return starts != record.block_starts.end() && starts->second == std::vector<int>{0} && !is_ramp(record, name);
}

std::vector<std::uint8_t> begins_of(const ProblemRecord& record, const std::string& name) {
  std::vector<std::uint8_t> begins(record.intervals, 0);
  for (const int start : record.block_starts.at(name))
    if (start < record.intervals) begins[start] = 1;
  return begins;
}

void check_guess(const ProblemRecord& record, const HorizonProblem& problem) {
  if (!record.guess) return;
  const auto check = [&](const char* key, const ProblemRecord::Rows& rows, const auto& width_of, const char* what) {
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (const auto width = static_cast<std::size_t>(width_of(static_cast<int>(i))); rows[i].size() != width)
        throw Error(at_key(record.where, fmt::format("guess.{}[{}]", key, i),
                           fmt::format("{} numbers, expected {}: {}", rows[i].size(), width, what)));
  };
  const auto states = [&](int node) { return problem.state_count(node); };
  const auto controls = [&](int interval) { return problem.control_count(interval); };
  constexpr const char *state = "the vehicle's state and the value of each blocked channel",
                       *control = "the free inputs and the value of each block that starts here";
  check("states", record.guess->states, states, state);
  check("controls", record.guess->controls, controls, control);
  check("costates", record.guess->costates, states, state);
  check("state_bounds", record.guess->state_bounds, states, state);
  check("control_bounds", record.guess->control_bounds, controls, control);
  check(
      "limit_bounds", record.guess->limit_bounds, [&](int node) { return problem.limit_count(node); },
      "the limits of the terms at this node");
}

int ModelNames::index_of(const std::vector<Variable>& variables, const std::string& name) {
  for (std::size_t j = 0; j < variables.size(); ++j)
    if (variables[j].name == name) return static_cast<int>(j);
  return -1;
}

void ModelNames::check_name(std::string_view key, const std::string& name,
                            std::initializer_list<const std::vector<Variable>*> groups) const {
  std::vector<std::string> known;
  for (const auto* group : groups)
    for (const Variable& variable : *group) known.push_back(variable.name);
  if (std::find(known.begin(), known.end(), name) != known.end()) return;
  throw error(fmt::format("{}.{}", key, name),
              fmt::format("model '{}' has no such variable here; {}", about_.name, did_you_mean(name, known)));
}

void ModelNames::check_count(std::string_view key, std::size_t count, const std::vector<Variable>& variables) const {
  if (count == variables.size()) return;
  const std::vector<std::string> names = names_of(variables);
  throw error(key, fmt::format("{} numbers, expected {}, for {} of model '{}'", count, names.size(),
                               fmt::join(names, ", "), about_.name));
}

void ModelNames::fill_bounds(const std::vector<Variable>& variables, std::vector<double>& lower,
                             std::vector<double>& upper) const {
  for (const Variable& variable : variables) {
    const auto at = record_.bounds.find(variable.name);
    lower.push_back(at == record_.bounds.end() ? -unbounded : at->second[0]);
    upper.push_back(at == record_.bounds.end() ? unbounded : at->second[1]);
  }
}

std::vector<double> ModelNames::in_order(const std::map<std::string, double>& by_name,
                                         const std::vector<Variable>& variables) {
  std::vector<double> ordered;
  for (const Variable& variable : variables) {
    const auto at = by_name.find(variable.name);
    ordered.push_back(at == by_name.end() ? 0.0 : at->second);
  }
  return ordered;
}

}  // namespace rhec::sim
