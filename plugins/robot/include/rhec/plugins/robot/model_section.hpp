#pragma once

#include <memory>

#include "rhec/core/model/model.hpp"
#include "rhec/plugins/robot/option_section.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"

namespace rhec {

/// The section `model`: the vehicle.
class RHEC_EXPORT ModelSection {
 public:
  ModelSection(const Host& host, const Settings& section);
  static OptionSection documentation();

  const std::shared_ptr<const Model>& model() const noexcept { return model_; }
  PluginChoice choice() const;

 private:
  Settings section_;
  std::shared_ptr<const Model> model_;
};

}  // namespace rhec
