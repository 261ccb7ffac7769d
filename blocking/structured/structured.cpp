// Structured blocking (SB), optionally with overlap (SB-O): docs/method.md, section 4 [1].
#include <fmt/format.h>

#include <algorithm>

#include "rhec/core/horizon/linked_blocking.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct StructuredOptions : BlockLink {
  int size = 5;
  int overlap = 0;
  Anchor anchor = Anchor::time;

  static const OptionTable<StructuredOptions>& table() {
    static const auto options = with_block_link(
        OptionTable<StructuredOptions>()
            .integer("size", &StructuredOptions::size, "block length S [intervals]", at_least(1))
            .integer("overlap", &StructuredOptions::overlap,
                     "overlap o [intervals]: a block starts only once so many intervals lie behind its start; before "
                     "that they belong to the block before",
                     at_least(0))
            .choice("anchor", &StructuredOptions::anchor, {{"time", Anchor::time}, {"horizon", Anchor::horizon}},
                    "borders are counted from the start of the run (estimation) or of the horizon (move blocking)"));
    return options;
  }
};

/// A block starts at the window's first interval and at the intervals s with s mod S = 0 and k - s >= o, where k is the
/// window's step. With the anchor `horizon`, s is counted from the window's first interval.
class Structured : public LinkedBlocking {
 public:
  using Options = StructuredOptions;
  explicit Structured(const Options& options) : LinkedBlocking(options), options_(options) {}

  std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept override {
    const std::int64_t size = options_.size;
    const std::int64_t origin = options_.anchor == Anchor::time ? 0 : window.first;
    const std::int64_t newest = window.step() - options_.overlap;  // no block starts later than this yet
    for (int i = 0; i < window.intervals; ++i) {
      const std::int64_t s = window.first + i;
      begins[i] = (s - origin) % size == 0 && s <= newest;
    }
    begins[0] = 1;
    // At the start of the run the window can be shorter than the overlap; then its only block began with the run.
    const std::int64_t last_possible = std::max(origin, std::min(window.first, newest));
    return last_possible - (last_possible - origin) % size;
  }

  std::string why_not(int intervals) const override {
    if (intervals < 1 || options_.overlap <= intervals) return Blocking::why_not(intervals);
    return fmt::format(
        "an overlap of {} needs a horizon of at least {} intervals, and this one has {}; make the overlap smaller or "
        "the "
        "horizon longer",
        options_.overlap, options_.overlap, intervals);
  }

 private:
  Options options_;
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::blocking, rhec::Structured,
            {.name = "structured",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .source = "Wallace et al., Receding horizon estimation and control with structured noise blocking for "
                       "mobile robot slip compensation",
             .capabilities = "blocks of one length, fixed in time or to the horizon, with overlap"});
