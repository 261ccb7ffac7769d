// Inputs cost what they are, whatever the reference (docs/terms.md).
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_options.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct EffortOptions {
  Settings weights;
  double delta = 0.0;

  static const OptionTable<EffortOptions>& table() {
    using E = EffortOptions;
    static const auto options =
        OptionTable<E>()
            .map("weights", &E::weights,
                 {{"INPUT", "number", "0", "at least 0",
                   "of the squared input on an interval [1 / unit of the input squared]"}})
            .number("delta", &E::delta,
                    "beyond this an input costs in proportion to its size, not to its square (pseudo-Huber loss) [unit "
                    "of the input]; 0: the square everywhere",
                    at_least(0.0));
    return options;
  }
};

class Effort final : public Term {
 public:
  using Options = EffortOptions;
  explicit Effort(const Options& options)
      : delta_(options.delta > 0.0 ? options.delta : std::numeric_limits<double>::infinity()) {
    if (!options.weights.is_null() && options.weights.kind() != Settings::Kind::map)
      throw options.weights.mismatch("a map from inputs to weights");
    for (const auto& [name, weight] : options.weights.members()) {
      const double number = weight.as_number();
      if (!(number >= 0.0)) throw weight.mismatch("a weight of at least 0");
      weights_.emplace_back(name, number);
    }
  }

  void write(TermWriter& writer) const override {
    for (const auto& [name, weight] : weights_)
      writer.residual(writer.input(name), {.weight = weight, .delta = delta_}, name);
  }
  void write_data(const TermPlace&, double*, double*, double*) const noexcept override {}

 private:
  double delta_;
  std::vector<std::pair<std::string, double>> weights_;
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::term, rhec::Effort,
            {.name = "effort",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "adds the weighted squares of inputs to the cost"});
