#pragma once

#include <utility>

#include "rhec/core/config/options.hpp"
#include "rhec/core/term/term_writer.hpp"

namespace rhec {

/// What a violation costs, if limits are soft.
struct SoftOptions {
  double linear = 100.0, quadratic = 10.0;

  static const OptionTable<SoftOptions>& table() {
    static const auto options =
        OptionTable<SoftOptions>()
            .number("linear", &SoftOptions::linear,
                    "cost of a violation per unit; large enough, and nothing is violated that need not be",
                    at_least(0.0))
            .number("quadratic", &SoftOptions::quadratic, "half of the cost per unit squared", at_least(0.0));
    return options;
  }
};

/// Options common to terms that are limits; theirs derive from this and add it to their table.
struct LimitOptions {
  bool hard = false;
  SoftOptions soft;
  Softness softness() const {
    if (hard) return {};
    return {.linear = soft.linear, .quadratic = soft.quadratic};
  }
};
template <class Options>
OptionTable<Options> with_limit_options(OptionTable<Options> table) {
  bool Options::*const hard = &LimitOptions::hard;
  SoftOptions Options::*const soft = &LimitOptions::soft;
  table
      .flag("hard", hard,
            "never violated, so that there may be no plan at all; otherwise a violation costs what `soft` says")
      .group("soft", soft, SoftOptions::table());
  return table;
}

}  // namespace rhec
