#include "rhec/plugins/robot/model_section.hpp"

#include <algorithm>

#include "rhec/core/model/chosen_outputs.hpp"

namespace rhec {
namespace {

constexpr PluginOption<Model> vehicle{.otherwise = "bicycle_slip"};

std::vector<std::string> outputs_left_out(const Host& host, const Settings& section, const Model& model) {
  if (!section.find("outputs")) return {};
  Settings with_all = section;
  with_all.set("outputs", Settings::scalar("all"));
  const std::vector<std::string> chosen = names_of(model.description().outputs);
  std::vector<std::string> others = names_of(vehicle.make(host, with_all)->description().outputs);
  std::erase_if(others,
                [&](const std::string& name) { return std::find(chosen.begin(), chosen.end(), name) != chosen.end(); });
  return others;
}

}  // namespace

ModelSection::ModelSection(const Host& host, const Settings& section)
    : section_(section), model_(vehicle.make(host, section)), left_out_(outputs_left_out(host, section, *model_)) {}

OptionSection ModelSection::documentation() {
  // The host selects the outputs, for any model.
  return {"model",
          "The vehicle.",
          {vehicle.row(),
           {"equations", "text or map", "", "a file, *.yaml, or what it has",
            "in the place of a name: the vehicle's equations, which need no compiler (docs/equations.md); its options "
            "stand beside it"},
           outputs_row()}};
}

PluginChoice ModelSection::choice() const { return vehicle.choice(section_); }

}  // namespace rhec
