#include "integration_note.hpp"

#include <fmt/format.h>

namespace rhec::apps {

void print_integration(const Estimator::Counts& counts, const Model& model, std::string_view prefix) {
  if (counts.coarse == 0) return;
  const std::vector<Variable>& states = model.description().states;
  fmt::print(
      "{}in {} of {} intervals looked at, the integration was too coarse, most in the state '{}': give "
      "estimator.substeps and controller.substeps a larger number\n",
      prefix, counts.coarse, counts.integrated, counts.coarse_state < 0 ? "" : states[counts.coarse_state].name);
}

}  // namespace rhec::apps
