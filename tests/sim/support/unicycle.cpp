#include "sim/support/unicycle.hpp"

#include <cmath>

#include "rhec/core/model/formula_model.hpp"

namespace rhec::sim {
namespace {

template <class Scalar>
struct Unicycle {
  static constexpr int state_count = 4, input_count = 2, parameter_count = 2, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::sin, std::cos;
    dxdt[0] = p[0] * u[0] * cos(x[2]);
    dxdt[1] = p[0] * u[0] * sin(x[2]);
    dxdt[2] = p[1] * x[3];
    dxdt[3] = 5.0 * (u[1] - x[3]);  // the yaw rate follows its command
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1];
  }
};

template <class Scalar>
struct FaultyUnicycle : Unicycle<Scalar> {
  int fault = static_cast<int>(Fault::none);

  template <class Visitor>
  void options(Visitor&& option) {
    option("fault", fault, "what is wrong with it");
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::tanh, std::sqrt, std::tan;
    Unicycle<Scalar>::dynamics(x, u, p, dxdt);
    switch (static_cast<Fault>(fault)) {
      case Fault::none:
      case Fault::log_of_an_output:
        break;
      case Fault::knows_its_heading:
        dxdt[3] = dxdt[3] + 0.1 * cos(x[2]);
        break;
      case Fault::knows_its_place:
        dxdt[3] = dxdt[3] + 0.1 * tanh(x[1]);
        break;
      case Fault::pulls_aside:
        dxdt[2] = dxdt[2] + 0.1;
        break;
      case Fault::unseen_parameter:
        dxdt[2] = x[3] + 0.0 * p[1];
        break;
      case Fault::product_of_parameters: {
        const Scalar both[2] = {p[0] * p[1], p[0]};
        Unicycle<Scalar>::dynamics(x, u, both, dxdt);
        dxdt[2] = x[3];
        break;
      }
      case Fault::root_of_a_state:
        dxdt[3] = 0.1 * (u[1] - x[3]) - 0.01 * sqrt(x[3] + 0.5);
        break;
      case Fault::pole_of_a_state:
        dxdt[2] = p[1] * tan(x[3]);
        break;
      case Fault::rate_is_commanded:
        dxdt[3] = u[1];
        break;
    }
  }
  void outputs(const Scalar* x, Scalar* y) const {
    using std::log;
    Unicycle<Scalar>::outputs(x, y);
    if (static_cast<Fault>(fault) == Fault::log_of_an_output) y[1] = x[1] + 0.01 * log(0.9 - x[3]);
  }
};

}  // namespace

ModelDescription unicycle_description() {
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

std::unique_ptr<Model> unicycle(Fault fault) {
  if (fault == Fault::none) return std::make_unique<FormulaModel<Unicycle>>(Unicycle<double>(), unicycle_description());
  FaultyUnicycle<double> formula;
  formula.fault = static_cast<int>(fault);
  return std::make_unique<FormulaModel<FaultyUnicycle>>(formula, unicycle_description());
}

ModelCheck check(Fault fault, const std::function<void(ModelDescription&)>& spoil, const ModelCheckOptions& options) {
  ModelDescription about = unicycle_description();
  if (spoil) spoil(about);
  Described model(std::move(about), fault);
  return check_model(model, options);
}

std::vector<std::string> faults(const ModelCheck& check) {
  std::vector<std::string> all;
  for (const Finding& finding : check.findings)
    if (finding.verdict == Verdict::fail || finding.verdict == Verdict::warn)
      all.push_back(std::string(word_of(finding.verdict)) + " " + finding.check + ": " + finding.where);
  return all;
}

const Finding& finding_of(const ModelCheck& check, const std::string& name) {
  for (const Finding& finding : check.findings)
    if (finding.check == name) return finding;
  throw Error("no finding of " + name);
}

const DriveInformation& drive_of(const ModelCheck& check, const std::string& name) {
  for (const DriveInformation& drive : check.drives)
    if (drive.name == name) return drive;
  throw Error("no drive " + name);
}

}  // namespace rhec::sim
