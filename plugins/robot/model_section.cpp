#include "rhec/plugins/robot/model_section.hpp"

namespace rhec {
namespace {

constexpr PluginOption<Model> vehicle{.otherwise = "bicycle_slip"};

}  // namespace

ModelSection::ModelSection(const Host& host, const Settings& section)
    : section_(section), model_(vehicle.make(host, section)) {}

OptionSection ModelSection::documentation() {
  // The host selects the outputs, for any model.
  return {"model",
          "The vehicle.",
          {vehicle.row(),
           {"equations", "text or map", "", "a file, *.yaml, or what it has",
            "in the place of a name: the vehicle's equations, which need no compiler (docs/equations.md); its options "
            "stand beside it"},
           {"outputs", "list of texts", "the usual ones", "all, or outputs of the model", "what is measured"}}};
}

PluginChoice ModelSection::choice() const { return vehicle.choice(section_); }

}  // namespace rhec
