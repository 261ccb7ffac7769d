// One value for the whole horizon (FHB). A strategy of its own, since large blocks would still have a border that
// slides through the window from time to time.
#include <algorithm>

#include "rhec/core/horizon/blocking.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

class FullHorizon : public Blocking {
 public:
  using Options = NoOptions;
  explicit FullHorizon(const Options&) {}

  std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept override {
    std::fill_n(begins, window.intervals, std::uint8_t{0});
    begins[0] = 1;
    return 0;  // the only block began with the run
  }
  bool is_one_block() const noexcept override { return true; }
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::blocking, rhec::FullHorizon,
            {.name = "full_horizon",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = "Wallace et al., Receding horizon estimation and control with structured noise blocking for "
                       "mobile robot slip compensation, ICRA 2019",
             .capabilities = "one value for the whole horizon"});
