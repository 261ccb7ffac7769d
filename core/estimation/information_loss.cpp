#include "information_loss.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "log_volume.hpp"
#include "numbers.hpp"

namespace rhec {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double gap = 1.5;                // an interval that is longer than so many usual ones is one
constexpr double jitter = 0.05;            // of an interval between samples, at least
constexpr double early = 1e-3;             // of its interval: no output is missed before
constexpr double deviations = 4.0;         // by which a sample is later than usual that does not come
constexpr int most_missed = 16;            // samples that have not come of one prediction
constexpr double as_good_as_equal = 0.05;  // of the logarithm of a volume

}  // namespace

/// Whether a sample of the output was to come up to a time; it counts then.
bool InformationLoss::Expected::was_due(double time) noexcept {
  const double interval = rhythm.interval();
  if (!(time - counted > (1.0 - early) * interval + deviations * rhythm.deviation())) return false;
  counted = time - counted > 2.0 * interval ? time : counted + interval;
  return true;
}

InformationLoss::InformationLoss(const std::shared_ptr<const Model>& model, const WalkingFilter::Setup& setup)
    : actual_(model, setup), complete_(model, setup) {
  const auto ny = static_cast<std::size_t>(model->output_count());
  outputs_.assign(ny, {});
  expected_.assign(ny, false);
  has_come_late_.assign(ny, false);
  values_.assign(ny, none);
  weights_.assign(ny, 1.0);
  factor_ = actual_.covariance();
  reset();
}

void InformationLoss::reset() noexcept {
  std::ranges::fill(outputs_, Expected{{}, none, false});
  samples_.reset();
  since_last_ = 0.0;
  missed_ = 0;
  end();
}

void InformationLoss::end() noexcept {
  is_active_ = false;
  excess_ = 0.0;
  samples_above_ = 0;
}

void InformationLoss::begin(const WalkingFilter& judge) noexcept {
  samples_since_ = 0;
  if (is_active_) return;
  is_active_ = true;
  copy_numbers(judge.covariance(), actual_.covariance());
  copy_numbers(judge.covariance(), complete_.covariance());
}

void InformationLoss::predict(const WalkingFilter& judge, const double* inputs, double duration,
                              const double* more_sigmas) noexcept {
  if (more_sigmas || since_last_ + duration > gap * samples_.interval()) begin(judge);
  if (is_active_) {
    copy_numbers(judge.mean(), actual_.mean());
    copy_numbers(judge.mean(), complete_.mean());
    for (int i = 0; i < most_missed && since_last_ > (missed_ + 1.0 - jitter) * samples_.interval(); ++i) {
      ++missed_;
      complete_.expect();
      for (std::size_t j = 0; j < values_.size(); ++j)
        values_[j] =
            outputs_[j].was_due(samples_.last() + since_last_) ? complete_.expected(static_cast<int>(j)) : none;
      complete_.update_as_expected(values_.data());
    }
    actual_.predict(inputs, duration, more_sigmas);
    complete_.predict(inputs, duration);
  }
  since_last_ += duration;
}

void InformationLoss::note(double time, const double* measured) noexcept {
  samples_.hear(time);
  since_last_ = 0.0;
  missed_ = 0;
  for (std::size_t j = 0; j < outputs_.size(); ++j) {
    Expected& output = outputs_[j];
    const bool has_come = !std::isnan(measured[j]);
    expected_[j] = has_come || output.was_due(time);
    has_come_late_[j] = std::exchange(output.waits, false);
    if (!has_come) continue;
    output.rhythm.hear(time);
    output.counted = time;
  }
}

void InformationLoss::note_late(double time, const double* measured, bool counts) noexcept {
  samples_since_ += counts;
  for (std::size_t j = 0; j < outputs_.size(); ++j) {
    if (std::isnan(measured[j])) continue;
    Expected& output = outputs_[j];
    output.rhythm.hear(time);
    output.waits = true;
    // One that has never come in time is not missed: nobody knows when it was to come.
    if (output.counted < time) output.counted = time;
  }
}

void InformationLoss::update(const WalkingFilter& judge, Measured used, bool counts) noexcept {
  bool is_lacking = false;
  for (std::size_t j = 0; j < expected_.size(); ++j)
    is_lacking = is_lacking || (expected_[j] && std::isnan(used[static_cast<std::ptrdiff_t>(j)]));
  if (is_lacking)
    begin(judge);
  else
    samples_since_ += counts;
  if (!is_active_) return;
  samples_above_ += counts;
  for (std::size_t j = 0; j < weights_.size(); ++j) weights_[j] = used.weight(static_cast<std::ptrdiff_t>(j));
  const auto take = [&](WalkingFilter& filter, auto&& has) {
    copy_numbers(judge.mean(), filter.mean());
    filter.expect();
    for (std::size_t j = 0; j < values_.size(); ++j) values_[j] = has(j) ? filter.expected(static_cast<int>(j)) : none;
    filter.update_as_expected({values_.data(), weights_.data()});
  };
  take(complete_, [&](std::size_t j) { return expected_[j]; });
  take(actual_, [&](std::size_t j) { return !std::isnan(used[static_cast<std::ptrdiff_t>(j)]); });
  find_excess();
}

void InformationLoss::follow(const WalkingFilter& judge) noexcept {
  if (!is_active_) return;
  copy_numbers(judge.covariance(), actual_.covariance());
  find_excess();
}

void InformationLoss::find_excess() noexcept {
  excess_ = log_volume(actual_.covariance(), factor_) - log_volume(complete_.covariance(), factor_);
  if (std::isnan(excess_)) excess_ = 0.0;  // of a parameter that is known
  if (!(excess_ > std::log(most_volume))) samples_above_ = 0;
  if (samples_since_ > 0 && excess_ < as_good_as_equal) end();
}

}  // namespace rhec
