#include "rhec/plugins/robot/blocking_section.hpp"

#include <cstddef>
#include <utility>

#include <fmt/format.h>

namespace rhec {
namespace {

constexpr PluginOption<Blocking> of_parameter{.otherwise = "full_horizon"};

}  // namespace

BlockingSection::BlockingSection(std::shared_ptr<const RobotContext> context, const Settings& section)
    : context_(std::move(context)), section_(section) {
  check_keys(section_, names_of(context_->about.parameters), "blocking");
  make();  // reports mistakes now
}

OptionSection BlockingSection::documentation() {
  return {"blocking",
          "Which intervals of the estimator share one value of a parameter. Without this section, a window's "
          "parameters follow `estimator.priors`.",
          {row()}};
}

OptionRow BlockingSection::row(const std::string& otherwise) {
  OptionRow row = of_parameter.row();
  row.name = "PARAMETER." + row.name;
  if (!otherwise.empty()) row.default_value = otherwise;
  return row;
}

const Settings& BlockingSection::section_of(std::size_t parameter) const {
  static const Settings nothing;
  const Settings* section = section_.find(context_->about.parameters[parameter].name);
  return section ? *section : nothing;
}

std::vector<std::shared_ptr<const Blocking>> BlockingSection::make() const {
  std::vector<std::shared_ptr<const Blocking>> blockings;
  for (std::size_t j = 0; j < context_->about.parameters.size(); ++j)
    blockings.push_back(of_parameter.make(context_->host, section_of(j)));
  return blockings;
}

std::vector<std::shared_ptr<const Blocking>> BlockingSection::make_for(int horizon, const std::string& key) const {
  auto blockings = make();
  for (std::size_t j = 0; j < blockings.size(); ++j)
    if (const std::string reason = blockings[j]->why_not(horizon); !reason.empty())
      throw section_of(j).error(fmt::format("{}; change it or {}", reason, key));
  return blockings;
}

PluginChoice BlockingSection::choice(int parameter) const {
  return of_parameter.choice(section_of(static_cast<std::size_t>(parameter)));
}

}  // namespace rhec
