#include "rhec/sim/logs/variants.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "rhec/plugins/robot/scenario_file.hpp"

namespace rhec::sim {
namespace {

void check_chosen(const Settings& scenario, const Settings& variants, const std::vector<std::string>& chosen) {
  if (variants.is_null() && !chosen.empty())
    throw scenario.error(fmt::format("the scenario has no variants, so none is called '{}'", chosen.front()));
  std::vector<std::string> names;
  for (const auto& [name, keys] : variants.members()) names.push_back(name);
  for (const std::string& name : chosen)
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw variants.error(fmt::format("there is no variant '{}'; expected one of {}", name, fmt::join(names, ", ")));
}

}  // namespace

std::vector<std::pair<std::string, Settings>> variant_settings(const std::string& name, const Settings& scenario,
                                                               const std::vector<std::string>& chosen,
                                                               const std::vector<std::string>& shared) {
  const Settings* given = scenario.find("variants");
  const Settings variants = given ? *given : Settings();
  if (!variants.is_null() && variants.kind() != Settings::Kind::map)
    throw variants.mismatch("a map: by a name, keys that differ");
  check_chosen(scenario, variants, chosen);
  if (variants.is_null()) return {{name, scenario}};
  std::vector<std::pair<std::string, Settings>> result;
  for (const auto& [variant, keys] : variants.members()) {
    if (!chosen.empty() && std::find(chosen.begin(), chosen.end(), variant) == chosen.end()) continue;
    if (!keys.is_null() && keys.kind() != Settings::Kind::map) throw keys.mismatch("a map of keys of the scenario");
    for (const std::string& one : shared)
      if (const Settings* key = keys.find(one)) throw key->error("is shared by all variants; write it at the top");
    Settings merged = scenario;
    put_over(merged, keys);
    result.emplace_back(variant, std::move(merged));
  }
  if (result.empty()) throw variants.mismatch("at least one variant");
  return result;
}

}  // namespace rhec::sim
