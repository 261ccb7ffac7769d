#include "rhec/core/horizon/horizon_structure.hpp"

#include <algorithm>

#include "rhec/core/base/error.hpp"

namespace rhec {

HorizonStructure::HorizonStructure(const Model& model, const Setup& setup)
    : nx_(model.state_count()),
      nu_(model.input_count()),
      np_(model.parameter_count()),
      lifted_(np_ + static_cast<int>(setup.blocked_inputs.size())) {
  if (setup.max_intervals < 1) throw Error("horizon: expected at least 1 interval; set it to 1 or more");
  capacity_ = {setup.max_intervals, nx_ + lifted_, nu_, setup.limits};
  for (int j = 0; setup.parameters_are_decided && j < np_; ++j)
    capacity_.controls += std::ranges::count(setup.one_block, j) == 0;
  const auto nodes = static_cast<std::size_t>(setup.max_intervals) + 1;
  lifted_of_input_.assign(nu_, -1);
  for (std::size_t j = 0; j < setup.blocked_inputs.size(); ++j)
    lifted_of_input_[setup.blocked_inputs[j]] = np_ + static_cast<int>(j);
  for (int j = 0; j < nu_; ++j)
    if (lifted_of_input_[j] < 0) free_inputs_.push_back(j);
  starts_.assign(nodes * lifted_, 0);
  ramp_.assign(lifted_, 0);
  control_index_.assign(nodes * lifted_, -1);
  control_counts_.assign(nodes, 0);
  stride_ = capacity_.row();
}

void HorizonStructure::set_intervals(int intervals) noexcept {
  is_finished_ &= intervals_ == intervals;
  intervals_ = intervals;
}

void HorizonStructure::set_block_start(int interval, int lifted, bool starts) noexcept {
  std::uint8_t& before = starts_[at(interval) + lifted];
  is_finished_ &= (before != 0) == starts;
  before = starts;
}

void HorizonStructure::set_ramp(int lifted, bool is_ramp) noexcept {
  ramp_[lifted] = is_ramp;
  any_ramp_ = std::any_of(ramp_.begin(), ramp_.end(), [](std::uint8_t flag) { return flag != 0; });
}

bool HorizonStructure::finish() noexcept {
  if (is_finished_) return false;
  is_finished_ = true;
  any_start_ = false;
  for (int i = 0; i < intervals_; ++i) {
    int next = free_input_count();
    for (int c = 0; c < lifted_; ++c) control_index_[at(i) + c] = starts_block(i, c) ? next++ : -1;
    control_counts_[i] = next;
    any_start_ |= next > free_input_count();
  }
  return true;
}

int HorizonStructure::control_of_input(int interval, int input) const noexcept {
  if (lifted_of_input_[input] >= 0) return control_of_lifted(interval, lifted_of_input_[input]);
  return static_cast<int>(std::lower_bound(free_inputs_.begin(), free_inputs_.end(), input) - free_inputs_.begin());
}

int HorizonStructure::column_of_input(int interval, int input) const noexcept {
  const int control = control_of_input(interval, input);
  return control >= 0 ? capacity_.states + control : nx_ + lifted_of_input_[input];
}

void HorizonStructure::inputs_on(const Iterate& iterate, int interval, double* u) const noexcept {
  const double* w = iterate.control(interval);
  for (int j = 0; j < nu_; ++j) {
    const int control = control_of_input(interval, j);
    u[j] = control >= 0 ? w[control] : iterate.state(interval)[nx_ + lifted_of_input_[j]];
  }
}

void HorizonStructure::parameters_on(const Iterate& iterate, int interval, double* p) const noexcept {
  for (int j = 0; j < np_; ++j) {
    const int control = control_of_lifted(interval, j);
    p[j] = control >= 0 ? iterate.control(interval)[control] : iterate.state(interval)[nx_ + j];
  }
}

void HorizonStructure::set_decisions(Iterate& iterate, const double* inputs, const double* parameters) const noexcept {
  for (int i = 0; i < intervals_; ++i) {
    const auto value_of = [&](int lifted, int interval) {
      if (lifted < np_) return parameters[interval * np_ + lifted];
      const auto input = std::find(lifted_of_input_.begin(), lifted_of_input_.end(), lifted) - lifted_of_input_.begin();
      return inputs[interval * nu_ + input];
    };
    for (int c = 0; i == 0 && c < lifted_; ++c) iterate.state(0)[nx_ + c] = value_of(c, 0);
    for (int f = 0; f < free_input_count(); ++f) iterate.control(i)[f] = inputs[i * nu_ + free_inputs_[f]];
    for (int c = 0; c < lifted_; ++c) {
      const int control = control_of_lifted(i, c);
      if (control >= 0) iterate.control(i)[control] = value_of(c, i);
    }
    carry_lifted(i, iterate);
  }
}

void HorizonStructure::carry_lifted(int interval, Iterate& iterate) const noexcept {
  for (int c = 0; c < lifted_; ++c) {
    const int control = control_of_lifted(interval, c);
    iterate.state(interval + 1)[nx_ + c] =
        control >= 0 ? iterate.control(interval)[control] : iterate.state(interval)[nx_ + c];
  }
}

}  // namespace rhec
