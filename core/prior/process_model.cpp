#include "rhec/core/prior/process_model.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/dense_rows.hpp"
#include "rhec/core/prior/prior.hpp"

namespace rhec {
namespace {

Variable process_variable(const Variable& parameter, int k) {
  Variable variable;
  variable.scale = parameter.scale;
  if (k == 0) {
    variable = parameter;
  } else {
    variable.name = fmt::format("{}_process{}", parameter.name, k);
    variable.unit = "1";
    variable.meaning = fmt::format("state {} of the process of {}", k, parameter.name);
  }
  return variable;
}

Variable noise_variable(const Variable& parameter, int k) {
  Variable variable;
  variable.name = fmt::format("{}_noise{}", parameter.name, k);
  variable.unit = "1";
  variable.meaning = fmt::format("noise {} of the process of {}", k, parameter.name);
  return variable;
}

}  // namespace

ProcessModel::ProcessModel(std::shared_ptr<const Model> vehicle, std::vector<int> counts)
    : vehicle_(std::move(vehicle)),
      counts_(std::move(counts)),
      nx_(vehicle_->state_count()),
      nu_(vehicle_->input_count()),
      np_(vehicle_->parameter_count()),
      vehicle_data_(vehicle_->data_count()),
      description_(vehicle_->description()),
      memory_(DenseRows::size(*vehicle_)) {
  if (static_cast<int>(counts_.size()) != np_)
    throw Error(fmt::format("model '{}': {} processes given; expected {}, one a parameter", description_.name,
                            counts_.size(), np_));
  if (dynamic_cast<const PartsOfIntervals*>(vehicle_.get()))
    throw Error(
        fmt::format("model '{}' depends on where an interval ends; priors of its parameters need one that does "
                    "not",
                    description_.name));
  n_ = nx_;
  for (int j = 0; j < np_; ++j) {
    if (counts_[j] < 1 || counts_[j] > Prior::max_states)
      throw Error(fmt::format("model '{}': a process of {} states; expected 1 to {}", description_.name, counts_[j],
                              Prior::max_states));
    const Variable& parameter = vehicle_->description().parameters[j];
    first_.push_back(n_);
    data_first_.push_back(data_count_);
    description_.parameter_states.push_back(n_);
    for (int k = 0; k < counts_[j]; ++k) {
      description_.states.push_back(process_variable(parameter, k));
      description_.inputs.push_back(noise_variable(parameter, k));
    }
    n_ += counts_[j];
    noises_ += counts_[j];
    data_count_ += process_data_count(counts_[j]);
  }
  data_count_ += static_cast<int>(vehicle_data_);
  description_.parameters.clear();
  description_.roles.speed_factor = -1;
}

void ProcessModel::data_of_part(const double* data, double share, double* part) const noexcept {
  for (int j = 0; j < np_; ++j) {
    const int n = counts_[j];
    const double* const from = process_data(j, data);
    double* const to = process_data(j, part);
    to[0] = from[0];
    for (int e = 0; e < n * n; ++e) {
      const double identity = e % (n + 1) == 0 ? 1.0 : 0.0;
      to[1 + e] = identity + share * (from[1 + e] - identity);  // F
      to[1 + n * n + e] = share * from[1 + n * n + e];          // L
    }
  }
  std::copy_n(vehicle_data(data), vehicle_data_, vehicle_data(part));
}

void ProcessModel::integrate(const Intervals& request) const noexcept {
  RHEC_ASSERT(request.count == 0 || (request.states && request.inputs && request.durations &&
                                     (request.data || data_count_ == 0)),  // a vehicle without parameters has none
              "where to integrate");
  memory_.lend([&](double* memory) { integrate(request, memory); });
}

void ProcessModel::integrate(const Intervals& request, double* memory) const noexcept {
  const int at_once = memory_.rows();
  const int inputs = nu_ + noises_, variables = n_ + inputs;
  const std::ptrdiff_t vehicle_z = nx_ + nu_ + 2 * std::ptrdiff_t{np_};
  for (int first = 0; first < request.count; first += at_once) {
    const int count = std::min(at_once, request.count - first);
    const DenseRows rows(memory, count, *vehicle_);
    for (int i = 0; i < count; ++i) {
      const double *s = request.states + static_cast<std::ptrdiff_t>(first + i) * n_,
                   *v = request.inputs + static_cast<std::ptrdiff_t>(first + i) * inputs,
                   *data = request.data + static_cast<std::ptrdiff_t>(first + i) * data_count_;
      double* next = request.next_states ? request.next_states + static_cast<std::ptrdiff_t>(first + i) * n_ : nullptr;
      std::copy_n(s, nx_, rows.x + static_cast<std::ptrdiff_t>(i) * nx_);
      std::copy_n(v, nu_, rows.u + static_cast<std::ptrdiff_t>(i) * nu_);
      std::copy_n(vehicle_data(data), vehicle_data_, rows.data + i * vehicle_data_);
      const double* w = v + nu_;
      for (int j = 0; j < np_; ++j) {
        const int n = counts_[j];
        const double *z = s + first_[j], *F = data + data_first_[j] + 1, *L = F + n * n;
        const bool ramp = F[-1] != 0.0;
        for (int r = 0; r < n; ++r) {
          double sum = 0.0;
          for (int k = 0; k < n; ++k) sum += F[k * n + r] * z[k] + L[k * n + r] * w[k];
          if (next) next[first_[j] + r] = sum;
          if (r == 0) rows.p_end[static_cast<std::ptrdiff_t>(i) * np_ + j] = ramp ? sum : z[0];
        }
        rows.p[static_cast<std::ptrdiff_t>(i) * np_ + j] = z[0];
        w += n;
      }
      if (request.hessians)
        std::copy_n(request.multipliers + static_cast<std::ptrdiff_t>(first + i) * n_, nx_,
                    rows.multipliers + static_cast<std::ptrdiff_t>(i) * nx_);
    }
    vehicle_->integrate({.count = count,
                         .states = rows.x,
                         .inputs = rows.u,
                         .parameters = rows.p,
                         .parameters_end = rows.p_end,
                         .durations = request.durations + first,
                         .data = vehicle_data_ > 0 ? rows.data : nullptr,
                         .substeps = request.substeps,
                         .next_states = request.next_states ? rows.next : nullptr,
                         .jacobians = request.jacobians ? rows.jacobians : nullptr,
                         .multipliers = request.hessians ? rows.multipliers : nullptr,
                         .hessians = request.hessians ? rows.hessians : nullptr});
    for (int i = 0; i < count; ++i) {
      const std::ptrdiff_t at = first + i;
      const double* data = request.data + at * data_count_;
      if (request.next_states)
        std::copy_n(rows.next + static_cast<std::ptrdiff_t>(i) * nx_, nx_, request.next_states + at * n_);
      if (request.jacobians)
        write_jacobian(rows.jacobians + i * nx_ * vehicle_z, data, request.jacobians + at * n_ * variables);
      if (request.hessians)
        write_hessian(rows.hessians + i * vehicle_z * vehicle_z, data, request.hessians + at * variables * variables);
    }
  }
}

/// From d[x]/d[x; u; p; p_end] to d[x; z]/d[x; z; u; w].
void ProcessModel::write_jacobian(const double* vehicle, const double* data, double* jacobian) const noexcept {
  const auto column = [&](int c) { return jacobian + static_cast<std::ptrdiff_t>(c) * n_; };
  const auto by = [&](int c) { return vehicle + static_cast<std::ptrdiff_t>(c) * nx_; };
  std::fill_n(jacobian, static_cast<std::ptrdiff_t>(n_) * (n_ + nu_ + noises_), 0.0);
  for (int c = 0; c < nx_; ++c) std::copy_n(by(c), nx_, column(c));
  for (int c = 0; c < nu_; ++c) std::copy_n(by(nx_ + c), nx_, column(n_ + c));
  int noise = n_ + nu_;
  for (int j = 0; j < np_; ++j) {
    const int n = counts_[j], z = first_[j];
    const double *F = data + data_first_[j] + 1, *L = F + n * n, ramp = F[-1];
    const double *by_start = by(nx_ + nu_ + j), *by_end = by(nx_ + nu_ + np_ + j);
    for (int k = 0; k < n; ++k) {
      double *of_state = column(z + k), *of_noise = column(noise + k);
      const double first = k == 0 ? 1.0 : 0.0;
      const double end = ramp != 0.0 ? F[k * n] : first, end_noise = ramp != 0.0 ? L[k * n] : 0.0;
      for (int r = 0; r < nx_; ++r) {
        of_state[r] = first * by_start[r] + end * by_end[r];
        of_noise[r] = end_noise * by_end[r];
      }
      std::copy_n(F + k * n, n, of_state + z);
      std::copy_n(L + k * n, n, of_noise + z);
    }
    noise += n;
  }
}

/// T' H T, where T leads from [x; z; u; w] to the vehicle's [x; u; p; p_end]: every variable of ours moves at most two
/// of these.
void ProcessModel::write_hessian(const double* vehicle, const double* data, double* hessian) const noexcept {
  struct Image {
    int first, second;  ///< entries of the vehicle's; second: -1 for none
    double by_first, by_second;
  };
  const std::ptrdiff_t size = nx_ + nu_ + 2 * std::ptrdiff_t{np_}, variables = n_ + nu_ + noises_;
  // Found anew for every variable: there is no room of a fixed size for all of them.
  const auto image_of = [&](int variable) -> Image {
    if (variable < nx_) return {variable, -1, 1.0, 0.0};
    if (variable >= n_ && variable < n_ + nu_) return {nx_ + variable - n_, -1, 1.0, 0.0};
    const bool is_noise = variable >= n_;
    int k = is_noise ? variable - n_ - nu_ : variable - nx_, j = 0;
    for (; k >= counts_[j]; ++j) k -= counts_[j];
    const int n = counts_[j], end = nx_ + nu_ + np_ + j;
    const double *F = data + data_first_[j] + 1, *L = F + n * n;
    const bool ramp = F[-1] != 0.0;
    if (is_noise) return {end, -1, ramp ? L[k * n] : 0.0, 0.0};
    const double first = k == 0 ? 1.0 : 0.0;
    return {end, nx_ + nu_ + j, ramp ? F[k * n] : first, first};
  };
  for (int c = 0; c < variables; ++c) {
    const Image of_c = image_of(c);
    for (int r = c; r < variables; ++r) {
      const Image of_r = image_of(r);
      const auto entry = [&](int a, int b) { return a < 0 || b < 0 ? 0.0 : vehicle[b * size + a]; };
      const double value =
          of_r.by_first *
              (of_c.by_first * entry(of_r.first, of_c.first) + of_c.by_second * entry(of_r.first, of_c.second)) +
          of_r.by_second *
              (of_c.by_first * entry(of_r.second, of_c.first) + of_c.by_second * entry(of_r.second, of_c.second));
      hessian[c * variables + r] = hessian[r * variables + c] = value;
    }
  }
}

void ProcessModel::observe(const Nodes& request) const noexcept {
  memory_.lend([&](double* memory) { observe_first_states(*vehicle_, n_ - nx_, request, memory); });
}

void ProcessModel::rates(const double* x, const double* u, const double*, double* dxdt) const noexcept {
  memory_.lend([&](double* p) {
    for (int j = 0; j < np_; ++j) p[j] = x[first_[j]];
    vehicle_->rates(x, u, p, dxdt);
  });
  std::fill(dxdt + nx_, dxdt + n_, 0.0);
}

}  // namespace rhec
