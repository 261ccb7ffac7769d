#pragma once

#include <memory>
#include <string>
#include <vector>

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
  /// Outputs of the model that `model.outputs` leaves out; none where that is not given.
  const std::vector<std::string>& left_out() const noexcept { return left_out_; }

 private:
  Settings section_;
  std::shared_ptr<const Model> model_;
  std::vector<std::string> left_out_;
};

}  // namespace rhec
