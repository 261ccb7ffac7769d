// A level that holds and jumps (docs/method.md, section 8): patches of ground.
#include "rhec/core/prior/matern_prior.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct JumpsOptions : CommonPriorOptions {
  double length = MaternPrior::Law{}.length;
  std::optional<double> sigma, mean_walk;
  JumpsOptions() { course = Course::held; }

  static const OptionTable<JumpsOptions>& table() {
    using J = JumpsOptions;
    static const auto options = with_common_options(
        OptionTable<J>()
            .number("length", &J::length, "mean distance between two jumps [m, or s]", greater_than(0.0))
            .optional_number("sigma", &J::sigma,
                             "standard deviation of the levels; none: 0.15 of the width of the parameter's bounds",
                             greater_than(0.0))
            .optional_number("mean_walk", &J::mean_walk,
                             "standard deviation of the random walk of the levels' mean per square root of a metre, or "
                             "of a second; none: 0.005 of that width",
                             at_least(0.0)));
    return options;
  }
};

/// Levels N(m, sigma^2) that change at the points of a Poisson process have the covariance sigma^2 exp(-d / length):
/// that of the Matern process with nu = 1/2, which is their best linear description.
class JumpsPlugin final : public MaternPrior {
 public:
  using Options = JumpsOptions;
  explicit JumpsPlugin(const Options& options)
      : MaternPrior({options, 1, options.length, options.sigma, options.mean_walk}) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::prior, rhec::JumpsPlugin,
            {.name = "jumps",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "levels that jump, by their exponential covariance"});
