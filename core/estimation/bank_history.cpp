#include "rhec/core/estimation/bank_history.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rhec/core/base/assertion.hpp"

namespace rhec {

BankHistory::BankHistory(PriorBank bank, int nodes, int filtered)
    : bank_(std::move(bank)),
      late_nodes_(std::max(nodes, 1)),
      keeps_filtered_(filtered > 0),
      nu_(static_cast<std::size_t>(bank_.model().input_count())),
      ny_(static_cast<std::size_t>(bank_.model().output_count())),
      np_(static_cast<std::size_t>(bank_.model().state_count() + bank_.model().parameter_count())),
      intervals_(static_cast<std::size_t>(std::max(late_nodes_, filtered))),
      between_(intervals_.size(), BetweenNodes(bank_.model().output_count(), bank_.most_between())),
      inputs_(intervals_.size() * nu_),
      outputs_(intervals_.size(), MeasuredOutputs(bank_.model().output_count())),
      given_weights_(intervals_.size() * ny_),
      used_weights_(given_weights_.size()),
      predicted_(intervals_.size() * bank_.state_size()),
      rehearsed_(bank_.state_size()) {
  if (keeps_filtered_ || bank_.looks_ahead()) filtered_.assign(predicted_.size(), 0.0);
  if (!keeps_filtered_) return;
  means_.assign(intervals_.size() * np_, 0.0);
  covariances_.assign(intervals_.size() * np_ * np_, 0.0);
  bank_.moments(mean_, covariance_);  // takes on their sizes
}

/// With the bank as it is expected at the newest node.
void BankHistory::begin_node() noexcept {
  const std::size_t at = place(newest_);
  std::fill_n(given_weights_.data() + at * ny_, ny_, std::numeric_limits<double>::quiet_NaN());
  bank_.save(predicted_.data() + at * bank_.state_size());
  update(at);
  count_ = std::min(count_ + 1, static_cast<int>(intervals_.size()));
}

void BankHistory::update(std::size_t place) noexcept {
  bank_.update(outputs_[place].measured(), given_weights_.data() + place * ny_);
  for (std::size_t j = 0; j < ny_; ++j) used_weights_[place * ny_ + j] = bank_.robust_weight(static_cast<int>(j));
  intervals_[place].log_likelihood = bank_.log_likelihood() + intervals_[place].between_log_likelihood;
  if (!filtered_.empty()) bank_.save(filtered_.data() + place * bank_.state_size());
  if (!keeps_filtered_) return;
  bank_.moments(mean_, covariance_);
  std::copy_n(mean_.data(), np_, means_.data() + place * np_);
  std::copy_n(covariance_.data(), np_ * np_, covariances_.data() + place * np_ * np_);
}

void BankHistory::start(Measured outputs, std::int64_t number) noexcept {
  newest_ = number;
  count_ = 0;
  intervals_[place(number)] = {};
  between_[place(number)].clear();
  outputs_[place(number)].assign(outputs);
  begin_node();
}

void BankHistory::add(const MeasuredInterval& interval, Measured outputs) noexcept {
  RHEC_ASSERT(newest_ >= 0, "`start` comes first");
  const std::size_t at = place(++newest_);
  intervals_[at] = {.way = {.duration = interval.duration, .ends_with_jump = interval.ends_with_jump}};
  between_[at].assign(interval);
  std::copy_n(interval.inputs, nu_, inputs_.data() + at * nu_);
  outputs_[at].assign(outputs);
  predict(at);
  begin_node();
}

/// Over the interval before a node.
void BankHistory::predict(std::size_t place) noexcept {
  bank_.predict(interval(place), outputs_[place].measured());
  intervals_[place].way.distance = bank_.distance();
  intervals_[place].between_log_likelihood = bank_.between_log_likelihood();
}

void BankHistory::rehearse() noexcept {
  if (count_ < 2) return;  // there is no interval yet
  const std::size_t at = place(newest_);
  bank_.save(rehearsed_.data());
  bank_.predict(interval(at), outputs_[at].measured());
  bank_.update(outputs_[at].measured(), given_weights_.data() + at * ny_);
  bank_.restore(rehearsed_.data());
}

bool BankHistory::rewind(int nodes) noexcept {
  if (nodes < 0 || nodes >= count_) return false;
  if (nodes == 0) return true;
  newest_ -= nodes;
  count_ -= nodes;
  begin_again(newest_);
  return true;
}

bool BankHistory::amend(int back, Measured outputs) noexcept {
  if (back < 0 || back >= std::min(count_, late_nodes_)) return false;
  const std::int64_t amended = newest_ - back;
  outputs_[place(amended)].add(outputs);
  filter_from(amended);
  return true;
}

/// A node's measurements, and where these decide where the interval before is linearised, that interval, too.
void BankHistory::begin_again(std::int64_t number) noexcept {
  const std::size_t at = place(number);
  if (bank_.looks_ahead() && number > newest_ - count_ + 1) {
    bank_.restore(filtered_.data() + place(number - 1) * bank_.state_size());
    return go_on(at);
  }
  bank_.restore(predicted_.data() + at * bank_.state_size());
  update(at);
}

/// Over the interval before a node, and by its measurements.
void BankHistory::go_on(std::size_t place) noexcept {
  predict(place);
  bank_.save(predicted_.data() + place * bank_.state_size());
  update(place);
}

void BankHistory::filter_from(std::int64_t number) noexcept {
  begin_again(number);
  for (++number; number <= newest_; ++number) go_on(place(number));
}

bool BankHistory::reweigh(std::int64_t number, const double* robust_weights) noexcept {
  constexpr double much = 1.25;
  if (number > newest_ || number <= newest_ - count_) return false;
  const std::size_t first = place(number) * ny_;
  const Measured outputs = outputs_[place(number)].measured();
  bool differs = false;
  for (std::size_t j = 0; j < ny_; ++j) {
    const double ratio = robust_weights[j] / used_weights_[first + j];
    if (std::isnan(outputs[static_cast<std::ptrdiff_t>(j)]) || !std::isfinite(ratio)) continue;
    differs = differs || ratio > much || ratio < 1.0 / much;
  }
  if (!differs) return false;
  std::copy_n(robust_weights, ny_, given_weights_.data() + first);
  filter_from(number);
  return true;
}

BankHistory::Node BankHistory::node(std::int64_t number) const noexcept {
  RHEC_ASSERT(number <= newest_ && number > newest_ - count_, "a node that is remembered");
  const std::size_t at = place(number);
  return {.way = intervals_[at].way,
          .inputs = inputs_.data() + at * nu_,
          .outputs = outputs_[at].measured(),
          .between = &between_[at],
          .predicted = predicted_.data() + at * bank_.state_size(),
          .robust_weights = used_weights_.data() + at * ny_,
          .log_likelihood = intervals_[at].log_likelihood,
          .filtered = keeps_filtered_ ? filtered_.data() + at * bank_.state_size() : nullptr,
          .mean = keeps_filtered_ ? means_.data() + at * np_ : nullptr,
          .covariance = keeps_filtered_ ? covariances_.data() + at * np_ * np_ : nullptr};
}

}  // namespace rhec
