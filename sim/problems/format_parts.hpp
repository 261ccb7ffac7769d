#pragma once

#include <cstdint>
#include <initializer_list>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "line_value.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/sim/problems/problem_format.hpp"

// Common parts of the problem formats.
namespace rhec::sim {

const ProblemFormat& rhe_format() noexcept;
const ProblemFormat& rhc_format() noexcept;

constexpr double unbounded = std::numeric_limits<double>::infinity();

/// The problem, cast to the class of its kind.
template <class Problem>
const Problem& as_kind(const HorizonProblem& problem) {
  if (const auto* found = dynamic_cast<const Problem*>(&problem)) return *found;
  throw Error(
      fmt::format("a problem calls itself '{0}' but is of another class than rhec's problems of that name; give "
                  "your own kind of problem another name than '{0}'",
                  problem.kind()));
}
template <class Problem>
Problem& as_kind(HorizonProblem& problem) {
  return const_cast<Problem&>(as_kind<Problem>(std::as_const(problem)));
}

// ---- from a line to a record

void read_block_starts(const LineValue& starts, ProblemRecord& record);
bool is_ramp(const ProblemRecord& record, const std::string& parameter);

// ---- from a record to a line

Json number_or_null(double value);
Json list_of(const std::vector<double>& values);
Json rows_of(const ProblemRecord::Rows& rows);
template <class Map, class Value>
Json map_of(const Map& map, const Value& value_of) {
  Json object = Json::object();
  for (const auto& [name, value] : map) object[name] = value_of(value);
  return object;
}

// ---- from a problem to a record

std::vector<double> copied(const double* values, int count);
void keep_bounds(ProblemRecord& record, const std::vector<Variable>& variables, const std::vector<double>& lower,
                 const std::vector<double>& upper);

// ---- from a record to a problem

/// Whether a parameter has a single value over the record's estimation horizon.
bool is_one_block(const ProblemRecord& record, const Model& model, int parameter);
/// For each interval, whether a block of the channel starts there; the channel must have blocks.
std::vector<std::uint8_t> begins_of(const ProblemRecord& record, const std::string& channel);
/// Throws Error unless the guess matches the problem's dimensions.
void check_guess(const ProblemRecord& record, const HorizonProblem& problem);

/// Maps names to the model's order.
class ModelNames {
 public:
  ModelNames(const ProblemRecord& record, const Model& model) : record_(record), about_(model.description()) {}

  Error error(std::string_view key, std::string_view what) const { return Error(at_key(record_.where, key, what)); }

  /// -1 if there is no such name.
  static int index_of(const std::vector<Variable>& variables, const std::string& name);
  /// Throws Error unless every key of a map names a variable of the given groups.
  template <class Map>
  void check(std::string_view key, const Map& map, std::initializer_list<const std::vector<Variable>*> groups) const {
    for (const auto& [name, value] : map) check_name(key, name, groups);
  }
  void check_count(std::string_view key, std::size_t count, const std::vector<Variable>& variables) const;
  void fill_bounds(const std::vector<Variable>& variables, std::vector<double>& lower,
                   std::vector<double>& upper) const;
  /// Missing values are 0.
  static std::vector<double> in_order(const std::map<std::string, double>& by_name,
                                      const std::vector<Variable>& variables);

 private:
  void check_name(std::string_view key, const std::string& name,
                  std::initializer_list<const std::vector<Variable>*> groups) const;

  const ProblemRecord& record_;
  const ModelDescription& about_;
};

}  // namespace rhec::sim
