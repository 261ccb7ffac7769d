#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/sim/check/model_check.hpp"

// A model that is right, for tests of the checks of models: each test gives it one fault.
namespace rhec::sim {

/// A unicycle with slip. What it has beside that is the fault of a derived formula.
struct Unicycle {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 2, output_count = 2;
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::sin, std::cos;
    dxdt[0] = p[0] * u[0] * cos(x[2]);
    dxdt[1] = p[0] * u[0] * sin(x[2]);
    dxdt[2] = p[1] * x[3];
    dxdt[3] = 5.0 * (u[1] - x[3]);  // the yaw rate follows its command
  }
  template <class Scalar>
  constexpr void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1];
  }
};

inline ModelDescription unicycle_description() {
  ModelDescription about;
  about.name = "unicycle";
  about.source = "this test";
  about.states = {{.name = "x", .unit = "m", .meaning = "x", .scale = 2.0},
                  {.name = "y", .unit = "m", .meaning = "y", .scale = 2.0},
                  {.name = "psi", .unit = "rad", .meaning = "heading", .is_angle = true},
                  {.name = "rate", .unit = "rad/s", .meaning = "yaw rate", .lower = -0.8, .upper = 0.8, .scale = 0.5}};
  about.inputs = {{.name = "v", .unit = "m/s", .meaning = "speed", .scale = 2.0},
                  {.name = "w", .unit = "rad/s", .meaning = "yaw rate", .lower = -0.8, .upper = 0.8, .scale = 0.5}};
  about.parameters = {
      {.name = "kappa", .unit = "1", .meaning = "speed factor", .lower = 0.2, .upper = 1.0, .scale = 0.5},
      {.name = "mu", .unit = "1", .meaning = "yaw factor", .lower = 0.2, .upper = 1.0, .scale = 0.5}};
  about.outputs = {{.name = "x_gps", .unit = "m", .meaning = "x", .scale = 2.0},
                   {.name = "y_gps", .unit = "m", .meaning = "y", .scale = 2.0}};
  about.roles = {.position_x = 0, .position_y = 1, .heading = 2, .speed = 0, .speed_factor = 0};
  return about;
}

/// A model that is described by somebody else: a formula's own would be refused where roles point nowhere.
template <class Formula>
class Described : public FormulaModel<Formula> {
 public:
  explicit Described(ModelDescription about)
      : FormulaModel<Formula>({}, unicycle_description()), about_(std::move(about)) {}
  const ModelDescription& description() const noexcept override { return about_; }

 private:
  ModelDescription about_;
};

/// Passes on all that it is asked to another model, then spoils some of it.
class Spoilt : public FormulaModel<Unicycle> {
 public:
  Spoilt() : FormulaModel({}, unicycle_description()) {}
  std::function<void(const Intervals&, int)> spoil_step = [](const Intervals&, int) {};
  std::function<void(const Nodes&)> spoil_node = [](const Nodes&) {};
  bool second = true;

  void integrate(const Intervals& request) const noexcept override {
    FormulaModel::integrate(request);
    spoil_step(request, 6 + (request.parameters_end ? 4 : 2));
  }
  void observe(const Nodes& request) const noexcept override {
    FormulaModel::observe(request);
    spoil_node(request);
  }
  bool has_second_derivatives() const noexcept override { return second; }
};

template <class Formula = Unicycle>
ModelCheck check(const std::function<void(ModelDescription&)>& spoil = {}, const ModelCheckOptions& options = {}) {
  ModelDescription about = unicycle_description();
  if (spoil) spoil(about);
  Described<Formula> model(std::move(about));
  return check_model(model, options);
}

/// "check: where" of the findings that are neither passed nor skipped.
inline std::vector<std::string> faults(const ModelCheck& check) {
  std::vector<std::string> all;
  for (const Finding& finding : check.findings)
    if (finding.verdict == Verdict::fail || finding.verdict == Verdict::warn)
      all.push_back(std::string(word_of(finding.verdict)) + " " + finding.check + ": " + finding.where);
  return all;
}

inline const Finding& finding_of(const ModelCheck& check, const std::string& name) {
  for (const Finding& finding : check.findings)
    if (finding.check == name) return finding;
  throw Error("no finding of " + name);
}

inline const DriveInformation& drive_of(const ModelCheck& check, const std::string& name) {
  for (const DriveInformation& drive : check.drives)
    if (drive.name == name) return drive;
  throw Error("no drive " + name);
}

}  // namespace rhec::sim
