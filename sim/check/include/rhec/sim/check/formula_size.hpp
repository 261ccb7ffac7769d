#pragma once

#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

/// How large a formula is, and which derivatives it has.
namespace rhec::sim {

/// Which entries of a matrix of derivatives are not always zero.
struct RHEC_EXPORT DerivativePattern {
  enum class Entry : char { zero, constant, varies };
  std::vector<std::string> rows, columns;
  std::vector<Entry> entries;  ///< row by row

  Entry at(std::size_t row, std::size_t column) const { return entries[row * columns.size() + column]; }
  int count() const;  ///< entries that are not zero
  /// Lines of '.', 'c' and 'x' with the names of rows, and groups of columns under a head.
  std::vector<std::string> lines() const;
};

struct FormulaSize {
  std::string model;
  int depth = 0;                                    ///< of f and h: the longest chain of operations
  std::vector<std::pair<std::string, int>> kinds;   ///< operations of f and h by kind, most first
  std::vector<std::pair<std::string, int>> counts;  ///< operations of "f and h", "with their Jacobians", ...
  DerivativePattern rates, outputs;                 ///< of df/d[x; p; u] and dh/dx
  DerivativePattern hessian;                        ///< of f, weighted, by [x; p; u]; its lower triangle
};

RHEC_EXPORT FormulaSize size_of_formula(const VehicleGraph& vehicle, const ModelDescription& about);
/// As a JSON object.
RHEC_EXPORT std::string size_json(const FormulaSize& size);

}  // namespace rhec::sim
