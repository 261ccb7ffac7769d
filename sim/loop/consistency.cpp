#include "consistency.hpp"

#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

#include "rhec/core/base/angle.hpp"

namespace rhec::sim {
namespace {

/// The share of a variance that the other errors do not explain; below it a covariance is singular as far as its own
/// rounding errors, and those of integration, allow to tell.
constexpr double least_unexplained = 1e-9;

}  // namespace

Consistency::Consistency(const ModelDescription& about)
    : about_(about),
      error_(static_cast<Eigen::Index>(about.states.size() + about.parameters.size())),
      factor_(error_.size(), error_.size()),
      solved_(error_.size()) {}

void Consistency::write(const Eigen::MatrixXd& given, Sample& sample) {
  sample.nees = std::numeric_limits<double>::quiet_NaN();
  sample.sigma.resize(0);
  if (given.size() == 0) return;
  // Without the states behind those that are results.
  const auto states = std::ssize(about_.states), parameters = std::ssize(about_.parameters);
  const bool has_more = given.rows() > states + parameters;
  if (has_more) {
    results_.resize(states + parameters, states + parameters);
    results_ << given.topLeftCorner(states, states), given.topRightCorner(states, parameters),
        given.bottomLeftCorner(parameters, states), given.bottomRightCorner(parameters, parameters);
  }
  const Eigen::MatrixXd& covariance = has_more ? results_ : given;
  sample.sigma = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  error_ << sample.state - sample.true_state, sample.parameters - sample.true_parameters;
  for (std::size_t j = 0; j < about_.states.size(); ++j)
    if (about_.states[j].is_angle) {
      const auto k = static_cast<Eigen::Index>(j);
      error_[k] = angle_difference(sample.state[k], sample.true_state[k]);
    }
  sample.nees = nees_with(covariance);
}

/// error' covariance^-1 error
double Consistency::nees_with(const Eigen::MatrixXd& covariance) {
  // Factorises L D L' row by row along with z = L^-1 error; the result is the sum of z_i^2 / d_i.
  double sum = 0.0;
  for (Eigen::Index i = 0; i < error_.size(); ++i) {
    double pivot = covariance(i, i), z = error_[i];
    for (Eigen::Index j = 0; j < i; ++j) {
      double value = covariance(i, j);  // of L D
      for (Eigen::Index k = 0; k < j; ++k) value -= factor_(k, i) * factor_(j, k);
      factor_(j, i) = value;
      const double entry = value / factor_(j, j);  // of L
      factor_(i, j) = entry;
      pivot -= entry * value;
      z -= entry * solved_[j];
    }
    if (!(pivot > least_unexplained * covariance(i, i))) return nees_with_singular(covariance);
    factor_(i, i) = pivot;
    solved_[i] = z;
    sum += z * z / pivot;
  }
  return sum;
}

double Consistency::nees_with_singular(const Eigen::MatrixXd& covariance) const {
  if (!covariance.allFinite() || !error_.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  const Eigen::VectorXd scale =
      covariance.diagonal().unaryExpr([](double variance) { return variance > 0.0 ? 1.0 / std::sqrt(variance) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(scale.asDiagonal() * covariance * scale.asDiagonal());
  const Eigen::VectorXd along = modes.eigenvectors().transpose() * scale.cwiseProduct(error_);
  double sum = 0.0;
  for (Eigen::Index j = 0; j < along.size(); ++j) {
    const double variance = modes.eigenvalues()[j];
    sum += variance > least_unexplained ? along[j] * along[j] / variance : 1.0;
  }
  return sum;
}

}  // namespace rhec::sim
