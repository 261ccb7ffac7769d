#include "rhec/core/model/step_requirement.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>

#include <Eigen/Eigenvalues>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/model/implicit_model.hpp"

namespace rhec {
namespace {

using Complex = std::complex<double>;

/// By what a step multiplies a mode: the classical method a polynomial, Radau IIA with three stages a quotient (Hairer
/// and Wanner II, section IV.5, table 5.6).
Complex growth(Complex z, bool is_implicit) {
  if (!is_implicit) return 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)));
  return (1.0 + z * (0.4 + z / 20.0)) / (1.0 - z * (0.6 - z * (0.15 - z / 60.0)));
}

/// Whether a step of length z / lambda does to a mode what the exact motion does. L-stable steps may leave a twentieth
/// or so of a mode that is over by the end of the interval.
bool follows(Complex part, int steps, Complex z, bool is_implicit) {
  const Complex exact = std::exp(z), found = std::pow(part, steps);
  if (is_implicit && std::abs(exact) < StepRequirement::mode_over) return std::abs(found) <= StepRequirement::mode_left;
  return std::abs(found - exact) <= StepRequirement::mode_tolerance;
}

/// Jacobian df/dx at a point; empty if it is not finite there.
Eigen::MatrixXd rate_jacobian(const Model& model, const OperatingPoint& point) {
  const int nx = model.state_count(), nz = nx + model.input_count() + model.parameter_count();
  std::vector<double> jacobian(static_cast<std::size_t>(nx) * nz), data(model.data_count(), 0.0);
  double duration = 1e-6;
  Eigen::MatrixXd rates;
  // dF/dx = I + h A + h^2 A^2 / 2 + ...: the second time with an h that makes the third term small against the second.
  for (int pass = 0; pass < 2; ++pass) {
    model.integrate({.count = 1,
                     .states = point.state.data(),
                     .inputs = point.inputs.data(),
                     .parameters = point.parameters.data(),
                     .durations = &duration,
                     .data = data.data(),
                     .jacobians = jacobian.data()});
    rates = Eigen::Map<const Eigen::MatrixXd>(jacobian.data(), nx, nx);
    rates = (rates - Eigen::MatrixXd::Identity(nx, nx)) / duration;
    if (!rates.allFinite()) return {};
    const double size = rates.cwiseAbs().rowwise().sum().maxCoeff();
    duration = 1e-7 / std::max(size, 1e-3);
  }
  return rates;
}

/// The fewest steps, at least `from`, that `is_enough`; 0 if `most_substeps` are not.
template <class Condition>
int fewest(int from, Condition is_enough) {
  for (int m = std::max(1, from); m <= StepRequirement::most_substeps; ++m)
    if (is_enough(m)) return m;
  return 0;
}

/// a is a stronger requirement than b; 0 stands for more than `most_substeps`.
bool is_more(int a, int b) { return b != 0 && (a == 0 || a > b); }

/// The state whose participation factor |left eigenvector x right eigenvector| in a mode is the largest (Perez-Arriaga,
/// Verghese and Schweppe 1982); without left eigenvectors the largest entry of the right one in typical magnitudes.
int leading_state(const Eigen::EigenSolver<Eigen::MatrixXd>& solver, Eigen::Index mode, const ModelDescription& about) {
  // Right eigenvectors of a pair are columns a + i b and a - i b, left ones half the rows of their inverse, a - i b and
  // a + i b.
  const Eigen::MatrixXd& right = solver.pseudoEigenvectors();
  const Eigen::MatrixXd left = Eigen::PartialPivLU<Eigen::MatrixXd>(right).inverse();
  const double turning = solver.eigenvalues()[mode].imag();
  const Eigen::Index first = turning < 0.0 ? mode - 1 : mode, count = turning == 0.0 ? 1 : 2;
  const Eigen::VectorXd size = right.middleCols(first, count).rowwise().norm();
  Eigen::VectorXd part = left.middleRows(first, count).colwise().norm().transpose().cwiseProduct(size);
  if (!part.allFinite())
    for (Eigen::Index j = 0; j < part.size(); ++j) part[j] = size[j] / about.states[j].scale;
  Eigen::Index leading = 0;
  part.maxCoeff(&leading);
  return static_cast<int>(leading);
}

/// What the modes of one point require.
StepRequirement mode_requirement(const Model& model, const OperatingPoint& point, double duration) {
  StepRequirement needed;
  const Eigen::MatrixXd rates = rate_jacobian(model, point);
  if (rates.size() == 0) return needed;
  const Eigen::EigenSolver<Eigen::MatrixXd> solver(rates);
  if (solver.info() != Eigen::Success) return needed;
  const double size = rates.cwiseAbs().rowwise().sum().maxCoeff();
  const bool implicit = is_implicit(model);
  for (Eigen::Index mode = 0; mode < rates.rows(); ++mode) {
    const Complex lambda = solver.eigenvalues()[mode], z = lambda * duration;
    // A mode that grows must be followed, not damped; eigenvalues of integrators are zero up to rounding.
    if (std::abs(lambda) <= 1e-6 * size || lambda.real() > 1e-6 * size) continue;
    constexpr double rounding = 1e-9;
    const int stable = fewest(1, [&](int m) { return std::abs(growth(z / double(m), implicit)) <= 1.0 + rounding; });
    const int exact = stable == 0 ? 0 : fewest(stable, [&](int m) {
      const Complex part = growth(z / double(m), implicit);
      return std::abs(part) <= 1.0 + rounding && follows(part, m, z, implicit);
    });
    if (is_more(stable, needed.stable_substeps)) needed.stable_substeps = stable;
    if (needed.state >= 0 && !is_more(exact, needed.mode_substeps)) continue;
    needed.mode_substeps = needed.substeps = exact;
    needed.time_constant = 1.0 / std::abs(lambda);
    needed.state = leading_state(solver, mode, model.description());
  }
  return needed;
}

double clamped(const Variable& variable, double value) { return std::clamp(value, variable.lower, variable.upper); }

}  // namespace

StepError::StepError(const Model& model)
    : model_(&model), coarse_(model.state_count()), fine_(model.state_count()), data_(model.data_count(), 0.0) {
  if (!is_implicit(model)) return;
  const int nx = model.state_count();
  jacobian_.resize(static_cast<std::size_t>(nx) * (nx + model.input_count() + model.parameter_count()));
  errors_.resize(static_cast<std::size_t>(nx));
}

double StepError::operator()(const double* state, const double* inputs, const double* parameters, double duration,
                             int substeps, int* worst_state) noexcept {
  Model::Intervals request{.count = 1,
                           .states = state,
                           .inputs = inputs,
                           .parameters = parameters,
                           .durations = &duration,
                           .data = data_.data(),
                           .substeps = substeps,
                           .next_states = coarse_.data()};
  model_->integrate(request);
  request.substeps = 2 * substeps;
  request.next_states = fine_.data();
  request.jacobians = jacobian_.empty() ? nullptr : jacobian_.data();
  model_->integrate(request);
  for (std::size_t j = 0; j < coarse_.size(); ++j) coarse_[j] -= fine_[j];
  if (!jacobian_.empty()) {
    const auto nx = static_cast<Eigen::Index>(coarse_.size());
    Eigen::Map<Eigen::VectorXd> left(errors_.data(), nx);
    left.noalias() = Eigen::Map<const Eigen::MatrixXd>(jacobian_.data(), nx, nx) *
                     Eigen::Map<const Eigen::VectorXd>(coarse_.data(), nx);
    coarse_.swap(errors_);
  }
  double worst = 0.0;
  for (std::size_t j = 0; j < coarse_.size(); ++j) {
    double error = std::abs(coarse_[j]) / model_->description().states[j].scale;
    if (!std::isfinite(error)) error = std::numeric_limits<double>::infinity();
    if (error <= worst) continue;
    worst = error;
    if (worst_state) *worst_state = static_cast<int>(j);
  }
  return worst;
}

StepRequirement step_requirement(const Model& model, std::span<const OperatingPoint> points, double duration) {
  RHEC_ASSERT(duration > 0.0, "an interval has a length");
  StepRequirement needed;
  StepError error(model);
  for (const OperatingPoint& point : points) {
    StepRequirement here = mode_requirement(model, point, duration);
    if (here.substeps > 0) {
      // The error falls with the fourth or fifth power of the number of steps, so that few of them have to be tried.
      int worst = here.state, m = here.substeps;
      const auto difference = [&] {
        return error(point.state.data(), point.inputs.data(), point.parameters.data(), duration, m, &worst);
      };
      double found = difference();
      while (found > StepRequirement::state_tolerance) {
        const double factor = std::min(std::pow(found / StepRequirement::state_tolerance, 0.25), 4.0);
        const int next = std::max(m + 1, static_cast<int>(0.9 * factor * m));
        if (next > StepRequirement::most_substeps) break;
        m = next;
        found = difference();
      }
      if (!std::isfinite(found)) continue;  // the model does not hold there
      if (std::isinf(here.time_constant)) here.state = worst;
      here.substeps = found > StepRequirement::state_tolerance ? 0 : m;
    }
    if (is_more(here.stable_substeps, needed.stable_substeps)) needed.stable_substeps = here.stable_substeps;
    if (is_more(here.mode_substeps, needed.mode_substeps)) needed.mode_substeps = here.mode_substeps;
    if (needed.state >= 0 && !is_more(here.substeps, needed.substeps)) continue;
    needed.substeps = here.substeps;
    needed.time_constant = here.time_constant;
    needed.state = here.state;
  }
  return needed;
}

std::vector<OperatingPoint> operating_points(const Model& model, const ModelDescription& about,
                                             std::span<const double> parameters, std::optional<double> ground_speed) {
  const Roles& roles = about.roles;
  double typical = ground_speed.value_or(1.0);
  if (!ground_speed) {
    // The ground speed at which the input or state that is the speed has its typical magnitude; a model that has none
    // of these has a motion that is straight at 1 m/s.
    if (roles.speed >= 0)
      typical = about.inputs[roles.speed].scale;
    else if (roles.speed_state >= 0)
      typical = about.states[roles.speed_state].scale;
  }
  const std::vector<double> without_slip = nominal_values(about.parameters);
  std::vector<OperatingPoint> points;
  for (const double share : {1.0, 0.2, 2.0, 0.0}) {
    for (const std::span<const double> slip : {std::span<const double>(without_slip), parameters}) {
      OperatingPoint straight;
      straight.parameters.assign(slip.begin(), slip.end());
      for (const Variable& state : about.states) straight.state.push_back(clamped(state, 0.0));
      straight.inputs.assign(about.inputs.size(), 0.0);
      model.straight_motion(share * typical, straight.parameters.data(), straight.state.data(), straight.inputs.data());
      points.push_back(straight);
      const auto moved = [&](std::vector<double> OperatingPoint::*values, std::size_t j, const Variable& variable) {
        for (const double sign : {-1.0, 1.0}) {
          OperatingPoint point = straight;
          double& value = (point.*values)[j];
          value = clamped(variable, value + sign * variable.scale);
          points.push_back(std::move(point));
        }
      };
      for (std::size_t j = 0; j < about.inputs.size(); ++j)
        if (static_cast<int>(j) != roles.speed) moved(&OperatingPoint::inputs, j, about.inputs[j]);
      for (std::size_t j = 0; j < about.states.size(); ++j)
        if (std::isfinite(about.states[j].lower) || std::isfinite(about.states[j].upper))
          moved(&OperatingPoint::state, j, about.states[j]);
    }
  }
  return points;
}

}  // namespace rhec
