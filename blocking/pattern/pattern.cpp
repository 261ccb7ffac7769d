// Blocks of given lengths, the usual form of move blocking, e.g. [1, 1, 3, 5].
#include <algorithm>

#include "rhec/core/horizon/linked_blocking.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct PatternOptions : BlockLink {
  std::vector<int> lengths;
  Anchor anchor = Anchor::horizon;

  static const OptionTable<PatternOptions>& table() {
    static const auto options = with_block_link(
        OptionTable<PatternOptions>()
            .integers("lengths", &PatternOptions::lengths,
                      "block lengths [intervals]; the last block goes on to the end of a longer horizon", at_least(1))
            .choice("anchor", &PatternOptions::anchor, {{"time", Anchor::time}, {"horizon", Anchor::horizon}},
                    "the list begins at the start of the horizon (move blocking), or at that of the run, and again "
                    "whenever it is through (estimation)"));
    return options;
  }
};

class Pattern : public LinkedBlocking {
 public:
  using Options = PatternOptions;
  explicit Pattern(const Options& options) : LinkedBlocking(options), anchor_(options.anchor) {
    if (options.lengths.empty()) {
      throw Error("blocking 'pattern': lengths: expected at least one block length; write e.g. lengths: [1, 2, 4]");
    }
    for (const int length : options.lengths) borders_.push_back(borders_.back() + length);
  }

  std::int64_t starts(const Window& window, std::uint8_t* begins) const noexcept override {
    std::fill_n(begins, window.intervals, std::uint8_t{0});
    begins[0] = 1;
    if (anchor_ == Anchor::horizon) {
      // Not the last border: the last block continues beyond it.
      for (auto border = borders_.begin(); border + 1 != borders_.end() && *border < window.intervals; ++border) {
        begins[*border] = 1;
      }
      return window.first;
    }
    const std::int64_t period = borders_.back();
    const std::int64_t phase = window.first % period;
    auto next = std::upper_bound(borders_.begin(), borders_.end(), phase);
    const std::int64_t first_start = window.first - phase + *(next - 1);
    for (std::int64_t i = *next - phase; i < window.intervals; i += *next - *(next - 1)) {
      begins[i] = 1;
      if (++next == borders_.end()) next = borders_.begin() + 1;
    }
    return first_start;
  }

 private:
  Anchor anchor_;
  std::vector<std::int64_t> borders_{0};  ///< where the blocks of the list start, and where the last one ends
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::blocking, rhec::Pattern,
            {.name = "pattern",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "blocks of given lengths, fixed to the horizon or repeated in time"});
