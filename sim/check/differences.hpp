#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/sim/check/derivative_check.hpp"

// Derivatives of functions of a stage against differences, whatever the functions are.
namespace rhec::sim {

/// One entry of z = [x; u; p], or of [x; u; p; p_end].
struct DifferenceEntry {
  std::string name;
  double scale = 1.0;
  double step = 1.0;  ///< unit of the distances
};
void append_entries(std::vector<DifferenceEntry>& entries, const std::vector<Variable>& variables,
                    const char* suffix = "");
/// Where values of a variable are typical: its bounds, but no more than some scales of it.
std::pair<double, double> typical_range(const Variable& variable);

/// What is differentiated: the names and scales of the results, and what their names begin with.
struct DifferenceResults {
  const std::vector<Variable>* variables;
  const char* prefix;
};

/// Results of all stages, one after the other.
using ValuesOfStages = std::function<std::vector<double>(const StagePoints& points)>;
/// The same, weighted with multipliers, one for each result of each stage.
using WeightedOfStages =
    std::function<std::vector<double>(const StagePoints& points, const std::vector<double>& multipliers)>;

/// First derivatives: `jacobians` (by stage, entry, result) against five-point differences of `values` (by stage,
/// result). `about` says how long the rows of stages are.
void compare_first_derivatives(const StagePoints& stages, const ModelDescription& about,
                               const std::vector<DifferenceEntry>& entries, const DifferenceResults& results,
                               const ValuesOfStages& values, const ValuesOfStages& jacobians, WorstEntry& into,
                               DerivativeErrors& all);
/// Second derivatives of each result separately, and their sum weighted with multipliers: `hessians` (by stage, entry,
/// entry) against differences of `jacobians`.
void compare_second_derivatives(const StagePoints& stages, const ModelDescription& about,
                                const std::vector<DifferenceEntry>& entries, const DifferenceResults& results,
                                const ValuesOfStages& jacobians, const WeightedOfStages& hessians, WorstEntry& into,
                                DerivativeErrors& all);

}  // namespace rhec::sim
