#pragma once

#include <optional>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/prior/prior.hpp"

namespace rhec {

struct Variable;

/// Options common to all processes. A process' options derive from it and add it to their table (with_common_options).
struct CommonPriorOptions {
  std::optional<double> mean;        ///< at the start; none: half way between the middle of the bounds and `nominal`
  std::optional<double> mean_sigma;  ///< none: a fifth of the width of the bounds
  Along along = Along::distance;
  Course course = Course::ramp;
};

/// The table followed by the options of CommonPriorOptions.
template <class Options>
OptionTable<Options> with_common_options(OptionTable<Options> table) {
  Along Options::*const along = &CommonPriorOptions::along;
  Course Options::*const course = &CommonPriorOptions::course;
  table
      .optional_number("mean", &CommonPriorOptions::mean,
                       "mean before anything is known; none: half way from the middle of the parameter's bounds to its "
                       "value without slip")
      .optional_number("mean_sigma", &CommonPriorOptions::mean_sigma,
                       "standard deviation of that mean; none: a fifth of the width of the bounds", at_least(0.0))
      .choice("along", along, {{"distance", Along::distance}, {"time", Along::time}},
              "what the parameter varies along: metres of ground covered, or seconds")
      .choice("course", course, {{"ramp", Course::ramp}, {"held", Course::held}},
              "how it moves over an interval: in a straight line to its next value, or not at all until the next node");
  return table;
}

/// Mean and spread that follow from a parameter's bounds. Without finite bounds the width is twice the typical
/// magnitude, about the value without slip.
struct RHEC_EXPORT ParameterRange {
  double width = 1.0;
  double mean = 0.0;
  explicit ParameterRange(const Variable& parameter);
};

}  // namespace rhec
