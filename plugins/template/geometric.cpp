// A blocking: which consecutive intervals share one value of a parameter (estimation) or of an input (control). Here
// blocks grow by a factor with their distance from the current time: fine near the newest data or the next input,
// coarse far away.
//
// To write one of your own: change the options, `starts`, and the two names in RHEC_PLUGIN.
// rhec/core/horizon/blocking.hpp says what `starts` has to do. Try it with: rhec plugins geometric
#include <algorithm>

#include "rhec/core/horizon/linked_blocking.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace {

enum class Now { not_said, start, end };

// BlockLink provides the options `transition` and `neighbour_sigma`, which every blocking with several blocks has.
struct GeometricOptions : rhec::BlockLink {
  int first = 1;
  int factor = 2;
  Now now = Now::not_said;

  static const rhec::OptionTable<GeometricOptions>& table() {
    static const auto rows = rhec::with_block_link(
        rhec::OptionTable<GeometricOptions>()
            .integer("first", &GeometricOptions::first, "length of the block at now [intervals]", rhec::at_least(1))
            .integer("factor", &GeometricOptions::factor, "what lengths grow by from block to block",
                     rhec::between(2, 1000))
            .choice("now", &GeometricOptions::now, {{"start", Now::start}, {"end", Now::end}},
                    "where now is: at the end of an estimator's window, at the start of a controller's horizon; it has "
                    "to be said"));
    return rows;
  }
};

class Geometric : public rhec::LinkedBlocking {
 public:
  using Options = GeometricOptions;
  explicit Geometric(const Options& options) : LinkedBlocking(options), options_(options) {
    // Mistakes that the option's range cannot exclude are thrown here: name the plugin, the key, and what to write.
    if (options.now == Now::not_said)
      throw rhec::Error("blocking 'geometric': now: expected 'end' for an estimator or 'start' for a controller");
  }

  std::int64_t starts(const rhec::Window& window, std::uint8_t* begins) const noexcept override {
    std::fill_n(begins, window.intervals, std::uint8_t{0});
    begins[0] = 1;  // always
    if (options_.now == Now::start) {
      // Lengths first, first * factor, ... from the window's start: the borders move with it.
      std::int64_t length = options_.first;
      for (std::int64_t i = length; i < window.intervals; i += length) {
        begins[i] = 1;
        length *= options_.factor;
      }
      return window.first;
    }
    // An estimator sees the same interval again at every step, so borders are counted from the start of the run: they
    // stand at multiples of the block length for their age. Each length divides the next. So with time adjacent blocks
    // merge into longer ones, and no border moves or reappears.
    for (int i = 1; i < window.intervals; ++i) begins[i] = (window.first + i) % length_at(window.intervals - i) == 0;
    // The window's edge may cut the first block. Blocks outside the window no longer merge.
    return window.first - window.first % length_at(window.intervals);
  }

  std::string why_not(int intervals) const override {
    if (options_.first < intervals || intervals < 1) return Blocking::why_not(intervals);
    return "its first block alone is as long as the horizon; make 'first' smaller, or use full_horizon";
  }

 private:
  /// The length of blocks that start `age` intervals back: the longest length not above `age`.
  std::int64_t length_at(std::int64_t age) const noexcept {
    std::int64_t length = options_.first;
    while (length * options_.factor <= age) length *= options_.factor;
    return length;
  }

  Options options_;
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::blocking, Geometric,
            {.name = "geometric",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "blocks that grow with their distance from now"});
