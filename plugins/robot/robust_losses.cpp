#include "rhec/plugins/robot/robust_losses.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "rhec/core/config/options.hpp"

namespace rhec {
namespace {

struct RobustOptions {
  Settings outputs;
  double delta = RobustLoss{}.delta;

  static OptionTable<RobustOptions> table(const std::string& otherwise) {
    return OptionTable<RobustOptions>()
        .map("outputs", &RobustOptions::outputs,
             {{"", "list of texts", otherwise, "outputs", "these share one pseudo-Huber loss"}})
        .number("delta", &RobustOptions::delta,
                "where that loss turns from quadratic to linear, in standard deviations", greater_than(0.0));
  }
};

}  // namespace

std::vector<RobustLoss> robust_losses(const Settings& section, const ModelDescription& about,
                                      const std::string& owner) {
  if (section.is_null()) return {};
  const RobustOptions options = RobustOptions::table({}).parse(section, owner + ": robust");
  const Settings* outputs = section.find("outputs");
  if (!outputs) throw section.error("expected the key 'outputs', a list of outputs that share the loss");
  RobustLoss loss{.outputs = {}, .delta = options.delta};
  const auto known = names_of(about.outputs);
  for (const Settings& item : outputs->items()) {
    const auto found = std::find(known.begin(), known.end(), item.as_text());
    if (found == known.end()) throw item.mismatch(one_of(known));
    loss.outputs.push_back(static_cast<int>(found - known.begin()));
  }
  if (loss.outputs.empty()) throw outputs->mismatch("a list of at least one output");
  return {loss};
}

std::vector<OptionRow> robust_rows(const std::string& otherwise) { return RobustOptions::table(otherwise).schema(); }

}  // namespace rhec
