#include "excitation.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/angle.hpp"

namespace rhec {
namespace {

/// Share of an interval in what is kept of the last ones: of about eight. A vehicle that turns for a few seconds is not
/// forgotten on the way, and a straight leg is noticed as soon.
constexpr double share_of_one = 0.125;
/// Squares of G / sqrt(V): from here on one interval shows by itself that G is not 0; that it counts with at most; and
/// that nothing is done from.
constexpr double significant = 9.0, most_counted = 10.0, beyond_doubt = 16.0;
/// An outlier decides nothing: its innovation counts as so many variances.
constexpr double most_surprise = 16.0;

}  // namespace

Excitation::Excitation(std::shared_ptr<const Model> model, std::vector<int> outputs, int substeps, int most_between)
    : model_(std::move(model)),
      outputs_(std::move(outputs)),
      substeps_(substeps),
      nx_(model_->state_count()),
      nu_(model_->input_count()),
      np_(model_->parameter_count()),
      ny_(model_->output_count()) {
  if (!model_->has_second_derivatives()) outputs_.clear();
  const int z = nx_ + nu_;
  for (Eigen::VectorXd* v : {&start_, &mean_, &target_, &gradient_, &image_}) *v = Eigen::VectorXd::Zero(z);
  covariance_ = Eigen::MatrixXd::Zero(z, z);
  joint_ = Eigen::MatrixXd::Zero(nx_ + np_, nx_ + np_);
  const std::size_t rows = std::max(static_cast<std::size_t>(most_between) + 1, outputs_.size()),
                    nx = static_cast<std::size_t>(nx_), nu = static_cast<std::size_t>(nu_),
                    np = static_cast<std::size_t>(np_), ny = static_cast<std::size_t>(ny_), nz = nx + nu + 2 * np;
  times_.assign(rows, 0.0);
  states_.assign(rows * nx, 0.0);
  inputs_.assign(rows * nu, 0.0);
  parameters_.assign(rows * np, 0.0);
  durations_.assign(rows, 0.0);
  next_states_.assign(rows * nx, 0.0);
  jacobians_.assign(rows * nx * nz, 0.0);
  predicted_.assign(rows * ny, 0.0);
  output_jacobians_.assign(rows * ny * nx, 0.0);
  multipliers_.assign(outputs_.size() * nx, 0.0);
  hessians_.assign(outputs_.size() * nz * nz, 0.0);
}

bool Excitation::find(const MeasuredInterval& interval, const double* weights, Measured end_outputs,
                      const Knowledge& knowledge, double* history) noexcept {
  if (outputs_.empty()) return false;
  begin(knowledge);
  std::copy_n(interval.times, interval.between, times_.begin());
  times_[interval.between] = interval.duration;
  integrate(interval.between + 1, times_.data(), false);
  for (int k = 0; k <= interval.between; ++k) {
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(k) * ny_;
    const Measured y = k == interval.between ? end_outputs : Measured{interval.outputs + row, weights + row};
    for (std::size_t j = 0; y && j < outputs_.size(); ++j) {
      const int output = outputs_[j];
      if (std::isnan(y[output])) continue;
      take(k, output, y[output], knowledge.output_variances[output] / y.weight(output));
    }
  }
  if (!mean_.allFinite() || !covariance_.allFinite()) return false;
  start_ = mean_;
  std::fill_n(times_.begin(), outputs_.size(), interval.duration);
  integrate(static_cast<int>(outputs_.size()), times_.data(), true);
  target_ = mean_;
  bool has_moved = false;
  for (std::size_t j = 0; j < outputs_.size(); ++j)
    if (is_measured(interval, end_outputs, outputs_[j]))
      has_moved = move(static_cast<int>(j), history + j * static_cast<std::size_t>(np_)) || has_moved;
  return has_moved && target_.allFinite();
}

/// [x; u] with the parameters at their means: those are what is asked for.
void Excitation::begin(const Knowledge& knowledge) noexcept {
  joint_ = knowledge.covariance;
  for (int j = nx_; j < nx_ + np_; ++j) {
    const double variance = joint_(j, j);
    if (!(variance > 0.0)) continue;
    for (int c = 0; c < nx_ + np_; ++c) {
      if (c == j) continue;
      const double share = joint_(j, c) / variance;
      for (int r = 0; r < nx_ + np_; ++r)
        if (r != j) joint_(r, c) -= joint_(r, j) * share;
    }
    joint_.row(j).setZero();
    joint_.col(j).setZero();
  }
  covariance_.setZero();
  for (int c = 0; c < nx_; ++c)
    for (int r = 0; r < nx_; ++r) covariance_(r, c) = joint_(r, c);
  for (int r = 0; r < nx_; ++r) start_[r] = knowledge.mean[r];
  for (int j = 0; j < nu_; ++j) {
    start_[nx_ + j] = knowledge.inputs[j];
    covariance_(nx_ + j, nx_ + j) = knowledge.input_variances[j];
  }
  mean_ = start_;
  for (std::size_t row = 0; row < durations_.size(); ++row)
    std::copy_n(knowledge.mean.data() + nx_, np_, parameters_.data() + row * static_cast<std::size_t>(np_));
}

/// From `start_`, all in one call of the model: next states, outputs and their Jacobians at several times, or of one
/// time with the second derivatives of one output of motion in each row.
void Excitation::integrate(int count, const double* seconds, bool is_curved) noexcept {
  for (int k = 0; k < count; ++k) {
    std::copy_n(start_.data(), nx_, states_.data() + static_cast<std::ptrdiff_t>(k) * nx_);
    std::copy_n(start_.data() + nx_, nu_, inputs_.data() + static_cast<std::ptrdiff_t>(k) * nu_);
    durations_[k] = seconds[k];
  }
  if (is_curved) {
    // Outputs are linear in the state, or nearly so.
    for (std::size_t j = 0; j < outputs_.size(); ++j)
      for (int r = 0; r < nx_; ++r)
        multipliers_[j * static_cast<std::size_t>(nx_) + r] = output_jacobians_[r * ny_ + outputs_[j]];
  }
  model_->integrate({.count = count,
                     .states = states_.data(),
                     .inputs = inputs_.data(),
                     .parameters = parameters_.data(),
                     .parameters_end = parameters_.data(),
                     .durations = durations_.data(),
                     .substeps = substeps_,
                     .next_states = next_states_.data(),
                     .jacobians = jacobians_.data(),
                     .multipliers = is_curved ? multipliers_.data() : nullptr,
                     .hessians = is_curved ? hessians_.data() : nullptr});
  if (is_curved) return;
  model_->observe({.count = count,
                   .states = next_states_.data(),
                   .outputs = predicted_.data(),
                   .jacobians = output_jacobians_.data()});
}

/// One measurement, with the gradient by [x; u].
void Excitation::take(int row, int output, double measured, double variance) noexcept {
  const std::ptrdiff_t nz = nx_ + nu_ + 2 * np_;
  const double *const J = jacobians_.data() + row * nx_ * nz, *const C = output_jacobians_.data() +
                                                                         static_cast<std::ptrdiff_t>(row) * ny_ * nx_;
  for (int c = 0; c < nx_ + nu_; ++c) {
    gradient_[c] = 0.0;
    for (int r = 0; r < nx_; ++r) gradient_[c] += C[r * ny_ + output] * J[static_cast<std::ptrdiff_t>(c) * nx_ + r];
  }
  const double expected = predicted_[static_cast<std::ptrdiff_t>(row) * ny_ + output];
  double innovation =
      model_->description().outputs[output].is_angle ? angle_difference(measured, expected) : measured - expected;
  double total = variance;
  for (int r = 0; r < nx_ + nu_; ++r) {
    innovation -= gradient_[r] * (mean_[r] - start_[r]);
    image_[r] = 0.0;
    for (int c = 0; c < nx_ + nu_; ++c) image_[r] += covariance_(r, c) * gradient_[c];
  }
  for (int r = 0; r < nx_ + nu_; ++r) total += gradient_[r] * image_[r];
  total = std::max(total, innovation * innovation / most_surprise);
  if (!(total > 0.0)) return;
  for (int c = 0; c < nx_ + nu_; ++c) {
    mean_[c] += image_[c] * (innovation / total);
    for (int r = 0; r < nx_ + nu_; ++r) covariance_(r, c) -= image_[r] * image_[c] / total;
  }
}

bool Excitation::is_measured(const MeasuredInterval& interval, Measured end_outputs, int output) const noexcept {
  if (end_outputs && !std::isnan(end_outputs[output])) return true;
  for (int k = 0; k < interval.between; ++k)
    if (!std::isnan(interval.outputs[static_cast<std::ptrdiff_t>(k) * ny_ + output])) return true;
  return false;
}

/// Of one output: moves the target, in the metric of the covariance, to where its gradients by the parameters have
/// the shares of them that may be believed.
bool Excitation::move(int row, double* history) noexcept {
  const int nz = nx_ + nu_ + 2 * np_;
  const double *const J = jacobians_.data() + static_cast<std::ptrdiff_t>(row) * nx_ * nz,
                      *const second = hessians_.data() + static_cast<std::ptrdiff_t>(row) * nz * nz,
                      *const by_state = multipliers_.data() + static_cast<std::ptrdiff_t>(row) * nx_;
  bool has_moved = false;
  for (int p = 0; p < np_; ++p) {
    const std::ptrdiff_t start = nx_ + nu_ + p, end = start + np_;
    double G = 0.0, V = 0.0, change = 0.0;
    for (int r = 0; r < nx_; ++r) G += by_state[r] * (J[start * nx_ + r] + J[end * nx_ + r]);
    for (int c = 0; c < nx_ + nu_; ++c) gradient_[c] = second[start * nz + c] + second[end * nz + c];
    for (int r = 0; r < nx_ + nu_; ++r) {
      image_[r] = 0.0;
      for (int c = 0; c < nx_ + nu_; ++c) image_[r] += covariance_(r, c) * gradient_[c];
    }
    for (int r = 0; r < nx_ + nu_; ++r) {
      V += gradient_[r] * image_[r];
      change += gradient_[r] * (target_[r] - mean_[r]);
    }
    const double square = G * G / V;
    if (!(V > 0.0) || !std::isfinite(square)) continue;
    const double before = std::max(history[p], 0.0);
    history[p] += share_of_one * (std::min(square, most_counted) - 1.0 - history[p]);
    if (square >= beyond_doubt || G == 0.0) continue;
    double share = before / (1.0 + before);
    if (square >= significant) share = std::max(share, 1.0 - 1.0 / square);
    const double surplus = 1.0 + change / G - share;
    if (!(surplus > 0.0)) continue;
    target_ -= image_ * (surplus * G / V);
    has_moved = true;
  }
  return has_moved;
}

}  // namespace rhec
