#include "rhec/plugins/robot/priors_section.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

constexpr PluginOption<Prior> of_parameter{.otherwise = "auto"};

std::shared_ptr<const Prior> make(const RobotContext& context, const Settings& section, const Variable& parameter) {
  std::shared_ptr<Prior> prior = of_parameter.make(context.host, section);
  prior->set_up(parameter);
  return prior;
}

bool is_open(const Settings& section) {
  return section.is_null() || (section.kind() == Settings::Kind::scalar && section.text() == of_parameter.otherwise);
}

/// The priors that a section gives; none if it leaves that open.
PriorCombination choices(const RobotContext& context, const Settings& section, const Variable& parameter) {
  if (is_open(section)) return {};
  if (section.kind() != Settings::Kind::list) return {make(context, section, parameter)};
  if (section.items().empty()) throw section.mismatch("at least one prior, or 'auto'");
  PriorCombination all;
  for (const Settings& item : section.items()) all.push_back(make(context, item, parameter));
  return all;
}

}  // namespace

PriorsSection::PriorsSection(std::shared_ptr<const RobotContext> context, const Settings& section)
    : context_(std::move(context)), section_(section) {
  check_keys(section_, names_of(context_->about.parameters), "estimator: priors");
  combinations();  // reports mistakes now
}

std::vector<OptionRow> PriorsSection::rows() {
  OptionRow row = of_parameter.row(
      "of bank and of rhe: how the parameter varies along the way, and its start. A prior with its options beside the "
      "name, a "
      "list of priors that are weighed against each other, or auto: a set that serves for slip of any kind");
  row.name = "PARAMETER";
  row.type = "prior, or list of priors";
  return {row};
}

bool PriorsSection::is_given() const {
  const auto& all = section_.members();
  return std::any_of(all.begin(), all.end(), [](const auto& member) { return !is_open(member.second); });
}

std::string PriorsSection::text(int parameter) const {
  const Settings* section = section_.find(context_->about.parameters[parameter].name);
  if (!section || section->is_null()) return of_parameter.otherwise;
  if (section->kind() != Settings::Kind::list) return of_parameter.choice(*section).name;
  std::vector<std::string> names;
  for (const Settings& item : section->items()) names.push_back(of_parameter.choice(item).name);
  return fmt::format("{}", fmt::join(names, ", "));
}

std::vector<PriorCombination> PriorsSection::given() const {
  std::vector<PriorCombination> given;
  for (const Variable& parameter : context_->about.parameters) {
    const Settings* section = section_.find(parameter.name);
    given.push_back(section ? choices(*context_, *section, parameter) : PriorCombination{});
  }
  return given;
}

std::vector<PriorCombination> PriorsSection::combinations() const {
  const std::vector<PriorCombination> priors = given();  // whose mistakes have their own places
  try {
    return standard_bank(context_->about, priors);
  } catch (const Error& mistake) {
    throw section_.error(mistake.what());
  }
}

}  // namespace rhec
