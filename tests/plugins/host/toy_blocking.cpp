// A good plugin, as an author would write it: blocks of one size that begin where the absolute index is a multiple of
// it.
#include <stdexcept>

#include "rhec/core/horizon/blocking.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace {

struct ToyOptions {
  int size = 3;
  std::optional<double> sigma;
  static const rhec::OptionTable<ToyOptions>& table() {
    static const auto options =
        rhec::OptionTable<ToyOptions>()
            .integer("size", &ToyOptions::size, "block length [intervals]", rhec::at_least(1))
            .optional_number("sigma", &ToyOptions::sigma, "of the link [1]", rhec::greater_than(0));
    return options;
  }
};

class Toy : public rhec::Blocking {
 public:
  using Options = ToyOptions;
  explicit Toy(const Options& options) : options_(options) {
    if (options.size == 13) throw rhec::Error("size 13 does not fit; take 12");
  }

  std::int64_t starts(const rhec::Window& window, std::uint8_t* begins) const noexcept override {
    for (int i = 0; i < window.intervals; ++i) begins[i] = i == 0 || (window.first + i) % options_.size == 0;
    return window.first - window.first % options_.size;
  }
  std::optional<double> neighbour_sigma() const noexcept override { return options_.sigma; }

 private:
  Options options_;
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::blocking, Toy,
            {.name = "toy", .version = TOY_VERSION, .licence = "MIT", .backend = "none", .backend_version = "7"});
