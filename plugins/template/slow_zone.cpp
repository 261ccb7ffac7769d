// A term: formulas of a node that are limits or costs of a controller's problem. Here the vehicle is slow on a part of
// the path.
//
// To write one of your own: change the options, `write` (the formula, once) and `write_data` (the numbers of each
// node), and the two names in RHEC_PLUGIN. rhec/core/term/term.hpp says what these have to do. Try it with: rhec
// plugins slow_zone
#include <limits>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_options.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace {

struct SlowZoneOptions : rhec::LimitOptions {
  double from = 0.0, to = 10.0, most = 1.0;

  static const rhec::OptionTable<SlowZoneOptions>& table() {
    using S = SlowZoneOptions;
    static const auto options =
        rhec::with_limit_options(rhec::OptionTable<S>()
                                     .number("from", &S::from, "where it begins along the path [m]")
                                     .number("to", &S::to, "where it ends [m]")
                                     .number("most", &S::most, "speed over ground there [m/s]", rhec::greater_than(0)));
    return options;
  }
};

class SlowZone final : public rhec::Term {
 public:
  using Options = SlowZoneOptions;
  explicit SlowZone(const Options& options) : options_(options) {}

  /// The formula, once.
  void write(rhec::TermWriter& writer) const override {
    writer.limit(writer.ground_speed(), options_.softness(), "speed");
  }
  /// What differs from node to node: no data here, but the bounds.
  void write_data(const rhec::TermPlace& place, double*, double* lower, double* upper) const noexcept override {
    const bool is_inside = place.arc_length >= options_.from && place.arc_length <= options_.to;
    *lower = -rhec::infinity;
    *upper = is_inside ? options_.most : rhec::infinity;
  }

 private:
  Options options_;
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::term, SlowZone,
            {.name = "slow_zone",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "bounds the speed over ground on a part of the path"});
