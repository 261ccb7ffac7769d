// A parameter that does not vary (docs/method.md, section 8).
#include "rhec/core/prior/walk_prior.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct ConstantOptions : PriorStartOptions {
  static const OptionTable<ConstantOptions>& table() {
    static const auto options = with_start_options(OptionTable<ConstantOptions>());
    return options;
  }
};

class ConstantPlugin final : public WalkPrior {
 public:
  using Options = ConstantOptions;
  explicit ConstantPlugin(const Options& options) : WalkPrior({{options, Along::time, Course::held}, 0.0}) {}
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::prior, rhec::ConstantPlugin,
            {.name = "constant",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "one value, unknown but the same everywhere"});
