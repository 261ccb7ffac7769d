// A random walk (docs/method.md, section 8).
#include "rhec/core/prior/walk_prior.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct WalkOptions : CommonPriorOptions {
  double sigma = 0.01;

  static const OptionTable<WalkOptions>& table() {
    static const auto options = with_common_options(OptionTable<WalkOptions>().number(
        "sigma", &WalkOptions::sigma, "standard deviation of the change per square root of a metre, or of a second",
        greater_than(0.0)));
    return options;
  }
};

class WalkPlugin final : public WalkPrior {
 public:
  using Options = WalkOptions;
  explicit WalkPlugin(const Options& options) : WalkPrior({options, options.sigma}) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::prior, rhec::WalkPlugin,
            {.name = "walk",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "a random walk per metre of ground or per second"});
