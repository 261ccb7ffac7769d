#include "information_loss.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "log_volume.hpp"
#include "numbers.hpp"

namespace rhec {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double gap = 1.5;              // an interval that is longer than so many usual ones is one
constexpr double to_new_interval = 0.1;  // of the usual interval
constexpr double jitter = 0.05;          // of an interval
constexpr double as_good_as_equal = 0.05;  // of the logarithm of a volume

/// Takes an interval between two times of a sequence into the usual one.
void note_interval(double interval, double& usual) noexcept {
  if (!(interval > 0.0)) return;
  if (std::isnan(usual))
    usual = interval;
  else if (interval < gap * usual)
    usual += to_new_interval * (interval - usual);
}

}  // namespace

InformationLoss::InformationLoss(const std::shared_ptr<const Model>& model, const WalkingFilter::Setup& setup)
    : actual_(model, setup), complete_(model, setup) {
  const auto ny = static_cast<std::size_t>(model->output_count());
  rhythms_.assign(ny, {});
  expected_.assign(ny, none);
  weights_.assign(ny, 1.0);
  factor_ = actual_.covariance();
  reset();
}

void InformationLoss::reset() noexcept {
  std::ranges::fill(rhythms_, Rhythm{none, none});
  interval_ = last_ = none;
  since_last_ = 0.0;
  missed_ = 0;
  end();
}

void InformationLoss::end() noexcept {
  is_active_ = false;
  excess_ = 0.0;
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
  if (more_sigmas || since_last_ + duration > gap * interval_) begin(judge);
  if (is_active_) {
    copy_numbers(judge.mean(), actual_.mean());
    copy_numbers(judge.mean(), complete_.mean());
    if (since_last_ > (missed_ + 1.0 - jitter) * interval_) {
      ++missed_;
      complete_.expect();
      for (std::size_t j = 0; j < expected_.size(); ++j)
        expected_[j] = std::isnan(rhythms_[j].interval) ? none : complete_.expected(static_cast<int>(j));
      complete_.update_as_expected(expected_.data());
    }
    actual_.predict(inputs, duration, more_sigmas);
    complete_.predict(inputs, duration);
  }
  since_last_ += duration;
}

/// What counts of a sample; whether some of it was not used.
bool InformationLoss::expect_outputs(double time, const double* measured, Measured used) noexcept {
  bool is_lacking = false;
  for (std::size_t j = 0; j < rhythms_.size(); ++j) {
    const auto output = static_cast<std::ptrdiff_t>(j);
    auto& [interval, counted] = rhythms_[j];
    const bool has_come = !std::isnan(measured[j]);
    const bool was_due = time - counted > (1.0 - jitter) * interval;
    if (has_come) {
      note_interval(time - counted, interval);
      counted = time;
    } else if (was_due) {
      counted = time - counted > 2.0 * interval ? time : counted + interval;
    }
    expected_[j] = has_come || was_due ? 0.0 : none;
    weights_[j] = has_come ? used.weight(output) : 1.0;
    is_lacking = is_lacking || (!std::isnan(expected_[j]) && std::isnan(used[output]));
  }
  return is_lacking;
}

void InformationLoss::update(const WalkingFilter& judge, double time, const double* measured, Measured used) noexcept {
  note_interval(time - last_, interval_);
  last_ = time;
  since_last_ = 0.0;
  missed_ = 0;
  if (expect_outputs(time, measured, used))
    begin(judge);
  else
    ++samples_since_;
  if (!is_active_) return;
  copy_numbers(judge.mean(), complete_.mean());
  complete_.expect();
  for (std::size_t j = 0; j < expected_.size(); ++j)
    if (!std::isnan(expected_[j])) expected_[j] = complete_.expected(static_cast<int>(j));
  complete_.update_as_expected({expected_.data(), weights_.data()});
  copy_numbers(judge.mean(), actual_.mean());
  actual_.expect();
  for (std::size_t j = 0; j < expected_.size(); ++j)
    expected_[j] = std::isnan(used[static_cast<std::ptrdiff_t>(j)]) ? none : actual_.expected(static_cast<int>(j));
  actual_.update_as_expected({expected_.data(), used.weights});
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
  if (samples_since_ > 0 && excess_ < as_good_as_equal) end();
}

}  // namespace rhec
