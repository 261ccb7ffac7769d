#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "rhec/core/term/term_functions.hpp"
#include "rhec/sim/check/derivative_check.hpp"

namespace rhec::sim {

/// What a term writes for a node, and whether it wrote beyond its place.
struct NodeNumbers {
  std::vector<double> data, lower, upper;  ///< NaN where nothing was written
  bool is_beyond = false;
};

/// A term on a vehicle: its formula for people, and its functions as a controller has them.
class TermFormula {
 public:
  /// Throws Error if the vehicle does not suit.
  TermFormula(const NamedTerm& term, std::shared_ptr<const Model> vehicle);

  const Model& vehicle() const { return *vehicle_; }
  const TermFunctions& functions() const { return functions_; }
  /// The vehicle's description, with the rows as outputs: limits first, in the order of the functions, then costs.
  const ModelDescription& about() const { return about_; }
  int row_count() const { return static_cast<int>(about_.outputs.size()); }
  /// The names of limits and costs in the order in which the term wrote them, and of its data.
  const std::vector<std::string>& limit_names() const { return limit_names_; }
  const std::vector<std::string>& cost_names() const { return cost_names_; }
  const std::vector<std::string>& data_names() const { return data_names_; }

  NodeNumbers at(const TermPlace& place) const;
  /// The formula, whose outputs are the rows, with these data as options.
  VehicleGraph graph_with(const std::vector<double>& data) const;

  /// Rows of arguments of the functions.
  std::vector<double> arguments(const StagePoints& points, const std::vector<double>& data) const;
  // For all stages, those of z = [x; u; p]; data of all stages, one after the other.
  std::vector<double> values(const StagePoints& points, const std::vector<double>& data) const;
  /// By stage, entry and row.
  std::vector<double> jacobians(const StagePoints& points, const std::vector<double>& data) const;
  /// By stage, entry and entry; multipliers by stage and row.
  std::vector<double> hessians(const StagePoints& points, const std::vector<double>& data,
                               const std::vector<double>& multipliers) const;

 private:
  int entries() const { return nx_ + nu_ + np_; }
  /// From a column of the functions, [x; p; u], to an entry of z.
  int entry_of(int column) const;

  NamedTerm term_;
  std::shared_ptr<const Model> vehicle_;
  TermFunctions functions_;
  int nx_, nu_, np_;
  ModelDescription about_;
  VehicleGraph formula_;
  std::vector<int> data_nodes_;
  std::vector<std::string> limit_names_, cost_names_, data_names_;
};

}  // namespace rhec::sim
