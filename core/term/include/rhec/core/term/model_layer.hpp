#pragma once

#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/expression.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// The variables of a stage in a graph.
struct StageVariables {
  std::vector<Expression> states, inputs, parameters;
  Expression duration;           ///< of the interval [s]
  std::vector<Expression> data;  ///< of the interval, Model::data_count numbers
};

/// A model over another one that has other variables, e.g. rates as inputs: terms apply to the vehicle at the bottom.
class RHEC_EXPORT ModelLayer {
 public:
  virtual ~ModelLayer() = default;
  virtual const Model& below() const noexcept = 0;
  /// The variables of the model below, in terms of this one's.
  virtual StageVariables variables_below(const StageVariables& own) const = 0;
};

}  // namespace rhec
