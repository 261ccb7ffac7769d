#pragma once

#include <optional>
#include <utility>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/prior/prior.hpp"

namespace rhec {

struct Variable;

/// The start of a process: options common to all. Its options derive from this and add it to their table.
struct PriorStartOptions {
  std::optional<double> mean;        ///< none: half way between the middle of the bounds and `nominal`
  std::optional<double> mean_sigma;  ///< none: a fifth of the width of the bounds
};
/// The table followed by the options of PriorStartOptions.
template <class Options>
OptionTable<Options> with_start_options(OptionTable<Options> table) {
  table
      .optional_number("mean", &PriorStartOptions::mean,
                       "mean before anything is known; none: half way from the middle of the parameter's bounds to its "
                       "value without slip")
      .optional_number("mean_sigma", &PriorStartOptions::mean_sigma,
                       "standard deviation of that mean; none: a fifth of the width of the bounds", at_least(0.0));
  return table;
}

/// The same with the options of all processes that vary.
struct CommonPriorOptions : PriorStartOptions {
  Along along = Along::distance;
  Course course = Course::ramp;
};
template <class Options>
OptionTable<Options> with_common_options(OptionTable<Options> table) {
  Along Options::*const along = &CommonPriorOptions::along;
  Course Options::*const course = &CommonPriorOptions::course;
  table = with_start_options(std::move(table));
  table
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
