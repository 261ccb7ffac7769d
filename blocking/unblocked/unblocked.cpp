// One value for every interval.
#include <algorithm>

#include "rhec/core/horizon/linked_blocking.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct UnblockedOptions : BlockLink {
  static const OptionTable<UnblockedOptions>& table() {
    static const auto options = with_block_link(OptionTable<UnblockedOptions>());
    return options;
  }
};

class Unblocked : public LinkedBlocking {
 public:
  using Options = UnblockedOptions;
  explicit Unblocked(const Options& options) : LinkedBlocking(options) {}

  std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept override {
    std::fill_n(begins, window.intervals, std::uint8_t{1});
    return window.first;
  }
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(
    rhec::PluginKind::blocking, rhec::Unblocked,
    {.name = "unblocked", .version = "1.0.0", .licence = "BSD-2-Clause", .capabilities = "a value for every interval"});
