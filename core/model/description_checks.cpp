#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/graph_model.hpp"

namespace rhec {

void check_description(const ModelDescription& description, const FormulaCounts& counts) {
  const auto check_count = [&](const char* kind, const std::vector<Variable>& described, int count) {
    if (static_cast<int>(described.size()) != count)
      throw Error(
          fmt::format("model '{}': its formula has {} {} and its description {}; describe each of them, in the "
                      "formula's order",
                      description.name, count, kind, described.size()));
  };
  check_count("states", description.states, counts.states);
  check_count("inputs", description.inputs, counts.inputs);
  check_count("parameters", description.parameters, counts.parameters);
  check_count("outputs", description.outputs, counts.outputs);

  const auto check_role = [&](const char* role, int index, const char* kind, int count) {
    if (index < -1 || index >= count)
      throw Error(
          fmt::format("model '{}': the role {} names number {} of its {} {}; expected an index from 0, or -1 for "
                      "none",
                      description.name, role, index, count, kind));
  };
  check_role("position_x", description.roles.position_x, "states", counts.states);
  check_role("position_y", description.roles.position_y, "states", counts.states);
  check_role("heading", description.roles.heading, "states", counts.states);
  for (const int body : description.roles.other_headings) check_role("other_headings", body, "states", counts.states);
  check_role("speed", description.roles.speed, "inputs", counts.inputs);
  check_role("speed_state", description.roles.speed_state, "states", counts.states);
  check_role("speed_factor", description.roles.speed_factor, "parameters", counts.parameters);
}

}  // namespace rhec
