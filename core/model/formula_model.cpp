#include "rhec/core/model/formula_model.hpp"

#include <fmt/format.h>

#include <bit>
#include <cstdint>

#include "rhec/core/base/error.hpp"

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

namespace {
constexpr std::uint64_t unwritten = 0x7ff8'dead'0bad'f00d;  // a NaN that no operation returns
}

void check_kernels(const ModelDescription& description, const ModelKernelSets& kernels) {
  if (!kernels.generic || !kernels.generic->integrate || !kernels.generic->observe)
    throw Error(
        fmt::format("model '{}': the generic kernels are missing; give FormulaModel what rhec_add_model defines, or no "
                    "kernels",
                    description.name));
}

double unwritten_result() noexcept { return std::bit_cast<double>(unwritten); }

void check_results(const ModelDescription& description, const char* function, const std::vector<Variable>& variables,
                   const std::vector<double>& results) {
  const auto is_unwritten = [&](std::size_t j) { return std::bit_cast<std::uint64_t>(results[j]) == unwritten; };
  for (std::size_t j = 0; j < variables.size(); ++j)
    if (is_unwritten(j))
      throw Error(fmt::format("model '{}': the formula's {} leaves out number {}, '{}'; let it write all {}, from 0 on",
                              description.name, function, j, variables[j].name, variables.size()));
  for (std::size_t j = variables.size(); j < results.size(); ++j)
    if (!is_unwritten(j))
      throw Error(
          fmt::format("model '{}': the formula's {} writes number {}, and it has but {}, counted from 0; mend its "
                      "counts and the description",
                      description.name, function, j, variables.size()));
}

}  // namespace rhec
