#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/prior/prior.hpp"

namespace rhec {

/// A law by which a parameter may vary along the ground, by numbers that serve for every parameter: sizes are fractions
/// of the width of its bounds.
struct RHEC_EXPORT ParameterLaw {
  enum class Kind {
    walk,   ///< random walk
    jumps,  ///< Matern 1/2, held on an interval: levels that change at the points of a Poisson process
    matern_3_2,
    matern_5_2
  };
  Kind kind = Kind::matern_3_2;
  double rate_or_length = 10.0;  ///< of a walk per square root of a metre; else [m]
  double sigma = 0.15;           ///< standard deviation about the mean; not of a walk

  std::shared_ptr<const Prior> make(const Variable& parameter) const;
  /// In words, with the parameter's sizes.
  std::string text(const Variable& parameter) const;
};

/// Laws of all kinds, from hardly any change to quick and large ones, for a search of the one that explains a log best.
RHEC_EXPORT std::vector<ParameterLaw> wide_laws();

}  // namespace rhec
