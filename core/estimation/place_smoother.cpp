#include "rhec/core/estimation/place_smoother.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/measurement.hpp"

namespace rhec {
namespace {

std::vector<int> process_counts(const Model& model, const PriorBank& bank) {
  std::vector<int> counts(model.parameter_count());
  for (int j = 0; j < model.parameter_count(); ++j) counts[j] = bank.process_states(j);
  return counts;
}

/// Ground after which another law may hold, as in a bank that is not told otherwise [m].
const double law_memory = PriorBank::Setup{}.memory;

int most_probable(const std::vector<double>& weights, int members) {
  return static_cast<int>(std::max_element(weights.begin(), weights.begin() + members) - weights.begin());
}

/// The members' probabilities at a node, given all that came later (Kim 1994): from `smoothed`, those at the next node,
/// and `filtered`. With the probability `change` another law has come to hold on the interval between the two.
void look_back(double* smoothed, const double* filtered, int members, double change) {
  const double each = change / members;
  double ratios = 0.0, sum = 0.0;
  for (int m = 0; m < members; ++m) {
    smoothed[m] /= (1.0 - change) * filtered[m] + each;
    ratios += smoothed[m];
  }
  for (int m = 0; m < members; ++m) {
    smoothed[m] = filtered[m] * ((1.0 - change) * smoothed[m] + each * ratios);
    sum += smoothed[m];
  }
  for (int m = 0; m < members; ++m) smoothed[m] = sum > 0.0 ? smoothed[m] / sum : filtered[m];
}

}  // namespace

PlaceSmoother::PlaceSmoother(const std::shared_ptr<const Model>& model, const PriorBank& bank, Setup setup)
    : setup_(std::move(setup)),
      vehicle_(model),
      model_(std::make_shared<ProcessModel>(model, process_counts(*model, bank))),
      nx_(model->state_count()),
      nu_(model->input_count()),
      np_(model->parameter_count()),
      n_(model_->state_count()),
      inputs_(model_->input_count()) {
  if (setup_.lag < 2) throw Error("place: expected a lag of 2 nodes or more");
  setup_.nodes_at_once = std::max(setup_.nodes_at_once, 3);
  weights_.assign(2 * static_cast<std::size_t>(bank.member_count()), 0.0);  // with hindsight, and without
  data_.assign(model_->data_count(), 0.0);
  input_.assign(inputs_, 0.0);
  scratch_means_.assign(np_, 0.0);
  scratch_variances_.assign(np_, 0.0);
  for (Eigen::VectorXd* v : {&mean_, &next_mean_, &filtered_, &predicted_mean_, &scale_}) v->setZero(n_);
  for (Eigen::MatrixXd* M :
       {&covariance_, &next_covariance_, &filtered_covariance_, &predicted_, &transition_, &across_, &gain_, &scaled_})
    M->setZero(n_, n_);
  jacobian_.setZero(n_, n_ + inputs_);
  factor_.compute(Eigen::MatrixXd::Identity(n_, n_));  // which has room then
}

void PlaceSmoother::reset() noexcept {
  written_ = -1;
  is_busy_ = false;
}

void PlaceSmoother::begin(BankHistory& history, std::int64_t write_until) noexcept {
  const std::int64_t oldest = history.newest() - history.count() + 1;
  written_ = std::max(written_, oldest);
  at_ = history.newest();
  std::fill(weights_.begin(), weights_.end(), 0.0);
  history.bank().add_saved_weights(history.node(at_).filtered, weights_.data());
  law_ = most_probable(weights_, history.bank().member_count());
  write_until_ = write_until;
  history.bank().saved_moments(history.node(at_).filtered, law_, mean_, covariance_);
  is_busy_ = at_ > written_;
}

/// From x_s(k + 1) to x_s(k) = x(k) + G (x_s(k + 1) - f(x(k))), with G = P A' P_predicted^-1.
void PlaceSmoother::step_back(BankHistory& history, SlipMap& map) noexcept {
  const std::int64_t number = at_ - 1;
  // Late measurements come at most so far back that their nodes are remembered longer than this takes.
  if (number <= history.newest() - history.count()) {
    is_busy_ = false;
    return;
  }
  PriorBank& bank = history.bank();
  const BankHistory::Node node = history.node(number), after = history.node(at_);
  // The law of an interval is the most probable one at its end. One law for the whole way would blur the edge of a
  // patch over metres, and be certain of it.
  const int members = bank.member_count(), law = most_probable(weights_, members);
  const bool is_other_law = law != law_;
  law_ = law;
  std::fill(weights_.begin() + members, weights_.end(), 0.0);
  bank.add_saved_weights(node.filtered, weights_.data() + members);
  look_back(weights_.data(), weights_.data() + members, members, -std::expm1(-after.way.distance / law_memory));
  bank.saved_moments(node.filtered, law_, filtered_, filtered_covariance_);
  for (int j = 0; j < np_; ++j) bank.write_process(law_, j, after.way, model_->process_data(j, data_.data()));
  std::fill(input_.begin(), input_.end(), 0.0);
  for (int j = 0; j < nu_; ++j)
    if (!std::isnan(after.inputs[j])) input_[j] = after.inputs[j];
  model_->integrate({.count = 1,
                     .states = filtered_.data(),
                     .inputs = input_.data(),
                     .durations = &after.way.duration,
                     .data = data_.data(),
                     .substeps = setup_.substeps,
                     .next_states = predicted_mean_.data(),
                     .jacobians = jacobian_.data()});
  transition_ = jacobian_.leftCols(n_);
  across_.noalias() = transition_ * filtered_covariance_;  // of x(k + 1) and x(k)
  predicted_.noalias() = across_ * transition_.transpose();
  for (int j = 0; j < inputs_; ++j) {
    double variance = 1.0;  // of a process's noise
    if (j < nu_) {
      const double wide = unknown_sigma(vehicle_->description().inputs[j]);
      variance = std::isnan(after.inputs[j]) ? wide * wide : setup_.input_variances[j];
    }
    for (int c = 0; c < n_; ++c)
      for (int r = 0; r < n_; ++r) predicted_(r, c) += variance * jacobian_(r, n_ + j) * jacobian_(c, n_ + j);
  }
  // Nothing is known of a state that the law of the next interval does not have: PriorBank::saved_moments.
  for (int j = nx_; is_other_law && j < n_; ++j) {
    if (covariance_(j, j) != 1.0 || mean_[j] != 0.0) continue;
    across_.row(j).setZero();
    predicted_.row(j).setZero();
    predicted_.col(j).setZero();
  }
  for (int j = 0; j < n_; ++j) {
    // States that the law does not have are 0, and nothing depends on them.
    if (!(predicted_(j, j) > 0.0)) predicted_(j, j) = 1.0;
    scale_[j] = std::sqrt(predicted_(j, j));
  }
  for (const double added : {0.0, 1e-12, 1e-9, 1e-6}) {
    for (int c = 0; c < n_; ++c)
      for (int r = 0; r < n_; ++r) scaled_(r, c) = predicted_(r, c) / (scale_[r] * scale_[c]) + (r == c ? added : 0.0);
    factor_.compute(scaled_);
    if (factor_.info() == Eigen::Success) break;
  }
  if (factor_.info() != Eigen::Success) {
    is_busy_ = false;
    return;
  }
  // G' = P_predicted^-1 A P
  gain_ = scale_.cwiseInverse().asDiagonal() * across_;
  factor_.solveInPlace(gain_);
  gain_ = scale_.cwiseInverse().asDiagonal() * gain_;
  next_mean_ = mean_;
  next_covariance_ = covariance_;
  predicted_mean_ = next_mean_ - predicted_mean_;
  mean_ = filtered_;
  mean_.noalias() += gain_.transpose() * predicted_mean_;
  predicted_ = next_covariance_ - predicted_;
  across_.noalias() = predicted_ * gain_;
  covariance_ = filtered_covariance_;
  covariance_.noalias() += gain_.transpose() * across_;
  if (!mean_.allFinite() || !covariance_.allFinite()) {
    is_busy_ = false;
    return;
  }
  if (at_ <= write_until_) write_stroke(map);
  at_ = number;
  if (at_ > written_) return;
  is_busy_ = false;
  written_ = write_until_;
}

/// The way between two nodes; parameters run in straight lines.
void PlaceSmoother::write_stroke(SlipMap& map) noexcept {
  const Roles& roles = vehicle_->description().roles;
  const double x = mean_[roles.position_x], y = mean_[roles.position_y];
  const double along_x = next_mean_[roles.position_x] - x, along_y = next_mean_[roles.position_y] - y;
  const double length = std::hypot(along_x, along_y);
  constexpr int most_points = 200;
  const int points = static_cast<int>(std::min(std::ceil(2.0 * length / map.setup().cell), double{most_points}));
  for (int i = 0; i < points; ++i) {
    const double share = (i + 0.5) / points;
    for (int j = 0; j < np_; ++j) {
      const int z = model_->first_state(j);
      scratch_means_[j] = mean_[z] + share * (next_mean_[z] - mean_[z]);
      scratch_variances_[j] = covariance_(z, z) + share * (next_covariance_(z, z) - covariance_(z, z));
    }
    map.add(x + share * along_x, y + share * along_y, scratch_means_.data(), scratch_variances_.data());
  }
}

void PlaceSmoother::work(BankHistory& history, SlipMap& map) noexcept {
  if (!is_busy_) {
    written_ = std::max(written_, history.newest() - history.count() + 1);
    if (history.newest() - written_ < setup_.lag) return;
    begin(history, history.newest() - setup_.lag / 2);
  }
  for (int i = 0; i < setup_.nodes_at_once && is_busy_; ++i) step_back(history, map);
}

void PlaceSmoother::finish(BankHistory& history, SlipMap& map) noexcept {
  if (history.count() == 0) return;
  while (is_busy_) step_back(history, map);
  begin(history, history.newest());
  while (is_busy_) step_back(history, map);
}

}  // namespace rhec
