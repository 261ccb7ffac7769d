#include "input_walks.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace rhec {

InputWalks::InputWalks(std::shared_ptr<const Model> vehicle, const RheProblem::Setup& setup, const NodeLog& log)
    : vehicle_(std::move(vehicle)), model_(vehicle_), log_(log), factors_(*vehicle_) {
  std::vector<int> walking;
  for (int j = 0; j < vehicle_->input_count(); ++j) {
    const Variable& about = vehicle_->description().inputs[static_cast<std::size_t>(j)];
    const double weight = setup.input_weights[static_cast<std::size_t>(j)];
    if (!(weight > 0.0)) continue;
    Input input{j, InputWalk(about), about.lower, about.upper, {}};
    bool is_any_missing = false;
    for (int i = 0; i < log.intervals(); ++i) {
      const double duration = log.durations[static_cast<std::size_t>(i)];
      input.walk.see(log.interval(i, vehicle_->input_count()).inputs[j], duration);
      input.sigmas.push_back(std::sqrt(weight * input.walk.growth(duration)));
      if (is_missing(i, j)) {
        is_any_missing = true;
        continue;
      }
      const double value = log.interval(i, vehicle_->input_count()).inputs[j];
      input.lower = std::min(input.lower, value);
      input.upper = std::max(input.upper, value);
    }
    if (!is_any_missing) continue;
    walking.push_back(j);
    inputs_.push_back(std::move(input));
  }
  if (inputs_.empty()) return;
  const auto made = std::make_shared<InputWalkModel>(vehicle_, std::move(walking));
  walking_ = made.get();
  model_ = made;
}

bool InputWalks::is_missing(int interval, int input) const noexcept {
  return std::isnan(log_.interval(interval, vehicle_->input_count()).inputs[input]);
}

RheProblem::Setup InputWalks::setup(RheProblem::Setup of_vehicle) const {
  if (is_empty()) return of_vehicle;
  if (of_vehicle.state_lower.empty())
    for (const Variable& state : vehicle_->description().states) of_vehicle.state_lower.push_back(state.lower);
  if (of_vehicle.state_upper.empty())
    for (const Variable& state : vehicle_->description().states) of_vehicle.state_upper.push_back(state.upper);
  const auto free = [](std::vector<double>& bounds, int input, double without_bound, double bound_of_v) {
    return bounds.empty() ? bound_of_v : std::exchange(bounds[static_cast<std::size_t>(input)], without_bound);
  };
  for (const Input& each : inputs_) {
    of_vehicle.state_lower.push_back(free(of_vehicle.input_lower, each.input, -infinity, each.lower));
    of_vehicle.state_upper.push_back(free(of_vehicle.input_upper, each.input, infinity, each.upper));
  }
  return of_vehicle;
}

void InputWalks::add_start(Eigen::VectorXd& mean, Eigen::MatrixXd& information) const {
  const Eigen::Index nx = vehicle_->state_count(), K = count(), rest = mean.size() - nx;
  Eigen::VectorXd wide_mean(mean.size() + K);
  Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(wide_mean.size(), wide_mean.size());
  wide_mean << mean.head(nx), Eigen::VectorXd::Zero(K), mean.tail(rest);
  for (Eigen::Index k = 0; k < K; ++k) {
    const InputWalk& walk = inputs_[static_cast<std::size_t>(k)].walk;
    wide_mean[nx + k] = walk.start;
    wide(nx + k, nx + k) = 1.0 / (walk.widest * walk.widest);
  }
  wide.topLeftCorner(nx, nx) = information.topLeftCorner(nx, nx);
  wide.topRightCorner(nx, rest) = information.topRightCorner(nx, rest);
  wide.bottomLeftCorner(rest, nx) = information.bottomLeftCorner(rest, nx);
  wide.bottomRightCorner(rest, rest) = information.bottomRightCorner(rest, rest);
  mean = std::move(wide_mean);
  information = std::move(wide);
}

void InputWalks::write(int interval, const double* parameters, double* data, double* measured) {
  if (is_empty()) return;
  std::fill_n(data, walking_->data_count(), 0.0);
  factors_.begin(log_.interval(interval, vehicle_->input_count()).inputs);
  for (int j = 0; j < vehicle_->parameter_count(); ++j)
    if (factors_.is_held(j)) walking_->hold(j, parameters[j], data);
  for (std::size_t k = 0; k < inputs_.size(); ++k) {
    const Input& each = inputs_[k];
    if (!is_missing(interval, each.input)) {
      InputWalkModel::set_measured(static_cast<int>(k), data);
      continue;
    }
    InputWalkModel::set_walking(static_cast<int>(k), each.sigmas[static_cast<std::size_t>(interval)], data);
    measured[each.input] = 0.0;
  }
}

void InputWalks::write_kept(const std::vector<double>& acting, int node, double* v) const noexcept {
  for (std::size_t k = 0; k < inputs_.size(); ++k) {
    const int at = std::max(node - 1, 0) * vehicle_->input_count() + inputs_[k].input;
    v[k] = acting[static_cast<std::size_t>(at)];
  }
}

void InputWalks::to_own(int interval, const double* v, double* inputs) const noexcept {
  for (std::size_t k = 0; k < inputs_.size(); ++k) {
    const Input& each = inputs_[k];
    if (is_missing(interval, each.input))
      inputs[each.input] = (inputs[each.input] - v[k]) / each.sigmas[static_cast<std::size_t>(interval)];
  }
}

void InputWalks::to_acting(const double* v, double* inputs) const noexcept {
  for (std::size_t k = 0; k < inputs_.size(); ++k) inputs[inputs_[k].input] = v[k];
}

}  // namespace rhec
