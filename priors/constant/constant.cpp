// A parameter that does not vary (docs/method.md, section 8).
#include "rhec/core/prior/walk_prior.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct ConstantOptions {
  std::optional<double> mean, mean_sigma;

  static const OptionTable<ConstantOptions>& table() {
    static const auto options =
        OptionTable<ConstantOptions>()
            .optional_number("mean", &ConstantOptions::mean,
                             "mean before anything is known; none: half way from the middle of the parameter's bounds "
                             "to its value without slip")
            .optional_number("mean_sigma", &ConstantOptions::mean_sigma,
                             "standard deviation of that mean; none: a fifth of the width of the bounds",
                             at_least(0.0));
    return options;
  }
};

class ConstantPlugin final : public WalkPrior {
 public:
  using Options = ConstantOptions;
  explicit ConstantPlugin(const Options& options)
      : WalkPrior({{options.mean, options.mean_sigma, Along::time, Course::held}, 0.0}) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::prior, rhec::ConstantPlugin,
            {.name = "constant",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "one value, unknown but the same everywhere"});
