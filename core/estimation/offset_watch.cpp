#include "offset_watch.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "innovation.hpp"
#include "rhec/core/base/angle.hpp"

namespace rhec {

namespace {

// An onset begins where an innovation is larger than so many standard deviations, or none is younger than so many
// samples. Where there are many, one of at least so many samples gives way; the oldest say nothing new.
constexpr double strange = 2.0;
constexpr int most_onsets = 8, young = 20, unproven = 10, oldest = 150;
// What says that an output has always been off is a sum over about so many samples.
constexpr double memory = 100.0;
// One innovation counts as no more than so many standard deviations: slip that jumps makes large ones, but few.
constexpr double most_counted = 3.0;
// An offset that differs from none by less than so many standard deviations is none.
constexpr double negligible = 2.0;
// By no more than so many is one known that innovations have said: slip makes some that look like one, too, and later
// ones have to be able to say so.
constexpr double most_certain = 4.0;

/// P + v v' scale, without a temporary.
void add_square(const Eigen::Ref<const Eigen::VectorXd>& v, double scale, Eigen::MatrixXd& P) noexcept {
  for (Eigen::Index c = 0; c < v.size(); ++c) P.col(c) += v * (scale * v[c]);
}

}  // namespace

OffsetWatch::OffsetWatch(const Model& model, std::vector<int> outputs, const KalmanFilter::Noise& noise, double gate)
    : outputs_(std::move(outputs)),
      variances_(noise.output_variances),
      parameter_lower_(noise.parameter_lower),
      parameter_upper_(noise.parameter_upper),
      limit_(gate * gate) {
  const Eigen::Index n = model.state_count() + model.parameter_count();
  for (const Variable& each : model.description().outputs) is_angle_.push_back(each.is_angle);
  if (!outputs_.empty()) onsets_.resize(outputs_.size() + most_onsets);
  known_.resize(is_angle_.size());
  sensitivities_ = Eigen::MatrixXd::Zero(n, std::ssize(onsets_) + std::ssize(outputs_));
  covariance_ = Eigen::MatrixXd::Zero(n, n);
  gradient_ = image_ = correction_ = Eigen::VectorXd::Zero(n);
  reset();
}

void OffsetWatch::reset() noexcept {
  sensitivities_.setZero();
  forget_onsets();
  known_.assign(known_.size(), {});
}

void OffsetWatch::forget_onsets() noexcept {
  onsets_.assign(onsets_.size(), {});
  for (std::size_t k = 0; k < outputs_.size(); ++k) onsets_[k].output = outputs_[k];
  // An offset that has always been there goes on as before.
  sensitivities_.rightCols(sensitivities_.cols() - std::ssize(outputs_)).setZero();
  suspect_ = refuted_ = -1;
}

void OffsetWatch::correct(double* outputs) const noexcept {
  for (const int j : outputs_) outputs[j] -= known_[j].value;
}

bool OffsetWatch::has_any() const noexcept {
  return std::ranges::any_of(known_, [](const Known& each) { return each.is_off; });
}

bool OffsetWatch::Known::is_recent() const noexcept { return is_off && age <= oldest; }

bool OffsetWatch::Known::is_significant() const noexcept {
  const double total = value + error.value();
  return total * total * error.information > negligible * negligible;
}

bool OffsetWatch::has_recent() const noexcept {
  return std::ranges::any_of(known_, [](const Known& each) { return each.is_recent(); });
}

void OffsetWatch::clip(Eigen::VectorXd::SegmentReturnType parameters) const noexcept {
  for (Eigen::Index j = 0; j < parameters.size(); ++j)
    parameters[j] = std::min(std::max(parameters[j], parameter_lower_[j]), parameter_upper_[j]);
}

/// Where there is no room, the onset gives way that explains the least.
void OffsetWatch::begin(int output) noexcept {
  std::size_t least = onsets_.size();
  const auto worth = [](const Onset& each) {
    return each.output < 0 || each.age > oldest ? -1.0 : each.offset.explained();
  };
  for (std::size_t m = outputs_.size(); m < onsets_.size(); ++m) {
    const bool may_go = onsets_[m].output < 0 || onsets_[m].age >= unproven;
    if (may_go && (least == onsets_.size() || worth(onsets_[m]) < worth(onsets_[least]))) least = m;
  }
  if (least == onsets_.size()) return;
  onsets_[least] = {.output = output, .age = 0, .offset = {}};
  sensitivities_.col(static_cast<Eigen::Index>(least)).setZero();
}

/// What the output that is being taken says of a constant by which one is off.
void OffsetWatch::note(int output, Constant& constant, Eigen::Index column, int off) noexcept {
  auto sensitivity = sensitivities_.col(column);
  const double most = most_counted * std::sqrt(variance_), counted = std::min(std::max(innovation_, -most), most);
  const double g = (output == off ? 1.0 : 0.0) - gradient_.dot(sensitivity);
  constant.information += g * g / variance_;
  constant.score += g * counted / variance_;
  constant.squares += counted * counted / variance_;
  constant.count += 1.0;
  sensitivity += image_ * (g / variance_);
}

void OffsetWatch::widen(const WalkingFilter& filter, const Sensor& sensor, const double* outputs,
                        Innovation& innovation) noexcept {
  bool is_wider = false;
  for (std::size_t k = 0; k < outputs_.size(); ++k) {
    const Known& known = known_[outputs_[k]];
    if (!known.is_off) continue;
    is_wider = true;
    const auto sensitivity = sensitivities_.col(std::ssize(onsets_) + static_cast<Eigen::Index>(k));
    Innovation::OfSensor<1> by_offset(innovation.value.size());
    Eigen::Index a = 0;
    for (const int j : sensor.outputs) {
      if (std::isnan(outputs[j])) continue;
      double g = j == outputs_[k] ? 1.0 : 0.0;
      for (int c = 0; c < filter.model().state_count(); ++c) g -= filter.derivative(j, c) * sensitivity[c];
      by_offset[a++] = g;
    }
    innovation.value -= by_offset * known.error.value();
    innovation.covariance += by_offset * by_offset.transpose() / known.error.information;
  }
  if (is_wider) innovation.nis = squared_size(innovation.value, innovation.covariance);
}

/// One output after the other, as the filter does it: innovations of a sample are then independent.
void OffsetWatch::take(const WalkingFilter& filter, Measured outputs, double excess) noexcept {
  if (outputs_.empty()) return;
  const int nx = filter.model().state_count(), ny = filter.model().output_count();
  covariance_ = filter.covariance();
  correction_.setZero();
  gradient_.setZero();
  for (std::size_t k = 0; k < outputs_.size(); ++k) onsets_[k].offset.fade(1.0 - 1.0 / memory);
  for (int j = 0; j < ny; ++j) {
    if (std::isnan(outputs[j])) continue;
    image_.setZero();
    for (int c = 0; c < nx; ++c) {
      gradient_[c] = filter.derivative(j, c);
      if (gradient_[c] != 0.0) image_ += covariance_.col(c) * gradient_[c];
    }
    variance_ = variances_[j] / outputs.weight(j) + gradient_.dot(image_);
    const double error =
        is_angle_[j] ? angle_difference(outputs[j], filter.expected(j)) : outputs[j] - filter.expected(j);
    innovation_ = error - gradient_.dot(correction_);
    if (!(variance_ > 0.0) || !std::isfinite(innovation_)) continue;
    if (std::ranges::find(outputs_, j) != outputs_.end()) {
      const bool is_any_young = std::any_of(onsets_.begin() + std::ssize(outputs_), onsets_.end(),
                                            [j](const Onset& each) { return each.output == j && each.age < young; });
      if (!is_any_young || innovation_ * innovation_ > strange * strange * variance_) begin(j);
    }
    for (std::size_t m = 0; m < onsets_.size(); ++m)
      if (onsets_[m].output >= 0) note(j, onsets_[m].offset, static_cast<Eigen::Index>(m), onsets_[m].output);
    for (std::size_t k = 0; k < outputs_.size(); ++k)
      if (Known& known = known_[outputs_[k]]; known.is_off)
        note(j, known.error, std::ssize(onsets_) + static_cast<Eigen::Index>(k), outputs_[k]);
    correction_ += image_ * (innovation_ / variance_);
    add_square(image_, -1.0 / variance_, covariance_);
  }
  suspect_ = refuted_ = -1;
  double most = excess * limit_;
  for (std::size_t k = 0; k < outputs_.size(); ++k) {
    Known& known = known_[outputs_[k]];
    ++known.age;
    if (known.is_off && !known.is_significant()) refuted_ = static_cast<int>(k);
  }
  for (std::size_t m = 0; m < onsets_.size(); ++m) {
    Onset& each = onsets_[m];
    if (each.output < 0) continue;
    ++each.age;
    if (std::isnan(outputs[each.output]) || !(each.offset.significance() > most)) continue;
    most = each.offset.significance();
    suspect_ = static_cast<int>(m);
  }
}

void OffsetWatch::adopt_suspected(WalkingFilter& filter) noexcept {
  if (refuted_ >= 0) return withdraw(refuted_, filter);
  const Onset found = onsets_[suspect_];
  const auto sensitivity = sensitivities_.col(suspect_);
  filter.mean() -= sensitivity * found.offset.value();
  clip(filter.mean().tail(std::ssize(parameter_lower_)));
  add_square(sensitivity, 1.0 / found.offset.information, filter.covariance());
  const double least = found.offset.value() / most_certain;
  adopt(found.output, found.offset.value(), std::max(1.0 / found.offset.information, least * least));
}

void OffsetWatch::adopt(int output, double change, double variance) noexcept {
  Known& known = known_[output];
  known.value += change;
  known.age = 0;
  known.error = {.information = 1.0 / variance, .score = 0.0, .squares = 0.0, .count = 0.0};
  known.is_off = known.value * known.value > negligible * negligible * variance;
  if (!known.is_off) known = {};
  forget_onsets();
}

/// An offset that was adopted is none.
void OffsetWatch::withdraw(int watched, WalkingFilter& filter) noexcept {
  Known& known = known_[outputs_[watched]];
  const auto sensitivity = sensitivities_.col(watched);
  filter.mean() += sensitivity * known.value;
  clip(filter.mean().tail(std::ssize(parameter_lower_)));
  add_square(sensitivity, known.value * known.value, filter.covariance());
  known = {};
  forget_onsets();
}

void OffsetWatch::withdraw_recent(WalkingFilter& filter) noexcept {
  for (std::size_t k = 0; k < outputs_.size(); ++k)
    if (known_[outputs_[k]].is_recent()) withdraw(static_cast<int>(k), filter);
}

void OffsetWatch::refine(Estimate& estimate) const noexcept {
  const Eigen::Index nx = estimate.state.size(), np = estimate.parameters.size();
  if (estimate.covariance.rows() != nx + np) return;
  for (std::size_t k = 0; k < outputs_.size(); ++k) {
    const Known& known = known_[outputs_[k]];
    if (!known.is_off) continue;
    const auto sensitivity = sensitivities_.col(std::ssize(onsets_) + static_cast<Eigen::Index>(k));
    estimate.state -= sensitivity.head(nx) * known.error.value();
    estimate.parameters -= sensitivity.tail(np) * known.error.value();
    clip(estimate.parameters.head(np));
    add_square(sensitivity, 1.0 / known.error.information, estimate.covariance);
  }
}

}  // namespace rhec
