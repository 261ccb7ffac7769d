#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/sim/check/model_check.hpp"
#include "support/other_model.hpp"

// A model that is right, for tests of the checks of models: each test gives it one fault.
namespace rhec::sim {

/// What the formula of a unicycle with slip has beside what is right.
enum class Fault {
  none,
  knows_its_heading,      ///< a slope that pulls to one side of the world
  knows_its_place,        ///< the yaw rate depends on y
  pulls_aside,            ///< turns with all wheels straight
  unseen_parameter,       ///< the second parameter has no effect
  product_of_parameters,  ///< of two parameters only the product matters
  root_of_a_state,        ///< the rates are not a number where the yaw rate is below -0.5
  pole_of_a_state,        ///< the tangent of the yaw rate
  log_of_an_output,       ///< an output is not a number where the yaw rate is above 0.9
  rate_is_commanded,      ///< the input is the yaw rate's derivative, as of a steering angle; no fault
};

ModelDescription unicycle_description();
std::unique_ptr<Model> unicycle(Fault fault = Fault::none);

/// Passes on all that it is asked to a unicycle.
class PassedOn : public OtherModel {
 public:
  explicit PassedOn(Fault fault = Fault::none) : PassedOn(std::shared_ptr<Model>(unicycle(fault))) {}
  std::vector<std::string> instruction_sets() const override { return inner_->instruction_sets(); }
  bool use_instruction_set(const std::string& name) override { return inner_->use_instruction_set(name); }

 private:
  explicit PassedOn(std::shared_ptr<Model> inner) : OtherModel(inner), inner_(std::move(inner)) {}
  std::shared_ptr<Model> inner_;
};

/// A model that is described by somebody else: a formula's own would be refused where roles point nowhere.
class Described : public PassedOn {
 public:
  Described(ModelDescription about, Fault fault) : PassedOn(fault), about_(std::move(about)) {}
  const ModelDescription& description() const noexcept override { return about_; }

 private:
  ModelDescription about_;
};

/// Spoils some of what the unicycle answers.
class Spoilt : public PassedOn {
 public:
  std::function<void(const Intervals&, int)> spoil_step = [](const Intervals&, int) {};
  std::function<void(const Nodes&)> spoil_node = [](const Nodes&) {};
  bool second = true;

  void integrate(const Intervals& request) const noexcept override {
    PassedOn::integrate(request);
    spoil_step(request, 6 + (request.parameters_end ? 4 : 2));
  }
  void observe(const Nodes& request) const noexcept override {
    PassedOn::observe(request);
    spoil_node(request);
  }
  bool has_second_derivatives() const noexcept override { return second; }
};

/// The check of a unicycle with a fault, its description spoilt.
ModelCheck check(Fault fault, const std::function<void(ModelDescription&)>& spoil = {},
                 const ModelCheckOptions& options = {});
inline ModelCheck check(const std::function<void(ModelDescription&)>& spoil = {},
                        const ModelCheckOptions& options = {}) {
  return check(Fault::none, spoil, options);
}

/// "check: where" of the findings that are neither passed nor skipped.
std::vector<std::string> faults(const ModelCheck& check);
const Finding& finding_of(const ModelCheck& check, const std::string& name);
const DriveInformation& drive_of(const ModelCheck& check, const std::string& name);

}  // namespace rhec::sim
