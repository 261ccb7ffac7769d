#include "rhec/plugins/robot/blocking_section.hpp"

#include <cstddef>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "rhec/plugins/robot/spans.hpp"

namespace rhec {
namespace {

constexpr PluginOption<Blocking> of_parameter{.otherwise = "full_horizon"};

std::string noise_name(const Variable& state) { return state.name + "_noise"; }

}  // namespace

BlockingSection::BlockingSection(std::shared_ptr<const RobotContext> context, const Settings& section)
    : context_(std::move(context)), section_(all_spans_in_intervals(section, context_->step)) {
  std::vector<std::string> names = names_of(context_->about.parameters);
  for (std::size_t j = 0; j < context_->about.states.size(); ++j) {
    const Variable& state = context_->about.states[j];
    const Settings* asked = section_.find(noise_name(state));
    if (asked && !asked->is_null() && !(context_->noise.state_sigmas[j] > 0.0))
      throw asked->error(
          fmt::format("state '{0}' has no process noise that could be blocked; set noise.states.{0}, or take this out",
                      state.name));
    if (asked || context_->noise.state_sigmas[j] > 0.0) names.push_back(noise_name(state));
  }
  check_keys(section_, names, "blocking");
  make();  // reports mistakes now
  for (std::size_t j = 0; j < context_->about.states.size(); ++j)
    if (const Settings* noise = section_of_noise(j)) of_parameter.make(context_->host, *noise);
}

OptionSection BlockingSection::documentation() {
  return {"blocking",
          "Which intervals of the estimator share one value of a parameter. Without this section, a window's "
          "parameters follow `estimator.priors`.",
          {row(), noise_row()}};
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

OptionRow BlockingSection::noise_row() {
  OptionRow row = of_parameter.row(
      "for a state with process noise in `noise.states`: which intervals share one value of it; its options stand "
      "beside the name. Without it, each interval has its own");
  row.name = "STATE_noise." + row.name;
  row.default_value = "none";
  return row;
}

const Settings* BlockingSection::section_of_noise(std::size_t state) const {
  const Settings* section = section_.find(noise_name(context_->about.states[state]));
  return section && !section->is_null() ? section : nullptr;
}

bool BlockingSection::blocks_noise() const {
  for (std::size_t j = 0; j < context_->about.states.size(); ++j)
    if (section_of_noise(j)) return true;
  return false;
}

std::vector<RecedingHorizonEstimation::Setup::BlockedNoise> BlockingSection::make_noises_for(
    int horizon, const std::string& key) const {
  std::vector<RecedingHorizonEstimation::Setup::BlockedNoise> noises;
  for (std::size_t j = 0; j < context_->about.states.size(); ++j) {
    const Settings* section = section_of_noise(j);
    if (!section) continue;
    noises.push_back({static_cast<int>(j), of_parameter.make(context_->host, *section)});
    if (const std::string reason = RecedingHorizonEstimation::why_not_noise(*noises.back().blocking, horizon);
        !reason.empty())
      throw section->error(fmt::format("{}; change it or {}", reason, key));
  }
  return noises;
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
