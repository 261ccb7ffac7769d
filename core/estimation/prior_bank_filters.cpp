#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include <Eigen/Cholesky>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/estimation/measurement.hpp"
#include "rhec/core/kernels/bank_kernels.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/model/motion_outputs.hpp"

#include "prior_bank_views.hpp"

namespace rhec {
namespace {

constexpr int lanes_at_once = 8;
constexpr int outputs_at_once = 8;
/// Below this probability a member's weight does not fall, so that it can come back.
constexpr double least_weight = 1e-10;
/// So many times the range of its bounds a state, or a parameter, of a member may be beyond them. What spinning wheels
/// ask for lies farther than slip can be, but not much.
constexpr double state_room = 3.0, parameter_room = 0.5;
/// The least share of the ground that a vehicle would cover without slip which it counts as covering.
constexpr double least_grip = 0.5;

/// Fills up the states of one prior to those of all priors of its parameter, so that a state has one meaning for all
/// members that are mixed. Where a prior has no mean, its mean is the parameter; where it has no derivatives, these are
/// unknown: independent, with the variance that they have elsewhere.
struct Filling {
  const Prior& prior;
  const std::array<int, process_state_kinds>& place;
  const std::array<double, process_state_kinds>& filler;
  int count;

  /// The prior's own state of a kind, or -1.
  int own(std::size_t kind) const noexcept {
    const auto states = prior.states();
    for (std::size_t k = 0; k < states.size(); ++k)
      if (static_cast<std::size_t>(states[k]) == kind) return static_cast<int>(k);
    return -1;
  }
  /// The own state that stands at a place: its own kind, or the value for a mean that is missing; -1 for none.
  int source(std::size_t kind) const noexcept {
    const int found = own(kind);
    return found < 0 && kind == static_cast<std::size_t>(ProcessState::mean) ? 0 : found;
  }
  void vector(const double* from, double* to) const noexcept {
    for (std::size_t kind = 0; kind < place.size(); ++kind)
      if (place[kind] >= 0) to[place[kind]] = source(kind) >= 0 ? from[source(kind)] : 0.0;
  }
  void transition(const double* from, double* to) const noexcept {
    const int n = prior.state_count();
    std::fill_n(to, count * count, 0.0);
    for (std::size_t row = 0; row < place.size(); ++row)
      for (std::size_t column = 0; column < place.size(); ++column)
        if (place[row] >= 0 && place[column] >= 0 && source(row) >= 0 && own(column) >= 0)
          to[place[column] * count + place[row]] = from[own(column) * n + source(row)];
  }
  void covariance(const double* from, double* to) const noexcept {
    const int n = prior.state_count();
    std::fill_n(to, count * count, 0.0);
    for (std::size_t row = 0; row < place.size(); ++row) {
      if (place[row] < 0) continue;
      for (std::size_t column = 0; column < place.size(); ++column)
        if (place[column] >= 0 && source(row) >= 0 && source(column) >= 0)
          to[place[column] * count + place[row]] = from[source(column) * n + source(row)];
      if (own(row) < 0) to[place[row] * count + place[row]] += filler[row];
    }
  }
};

/// See `Process::off_course`. The value halfway has the variance Q - Q F' (F Q F' + Q)^-1 F Q given the states
/// at both ends, with F and Q of half the way: of a walk that is a Brownian bridge, with its s (1 - s) everywhere.
double variance_off_course(const Prior& prior, double duration, double distance) noexcept {
  if (prior.course() != Course::ramp) return 0.0;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, Prior::max_states, Prior::max_states>;
  const double way = prior.along() == Along::time ? duration : distance;
  const int n = prior.state_count();
  Matrix F(n, n), Q(n, n);
  prior.advance(0.5 * way, F.data(), Q.data());
  const Matrix image = F * Q, end = image * F.transpose() + Q, gain = end.ldlt().solve(image);
  const double halfway = Q(0, 0) - image.col(0).dot(gain.col(0));
  return std::isfinite(halfway) ? 4.0 * std::max(halfway, 0.0) : 0.0;
}

/// F and Q of a process over an interval. Where that ends with a jump, the value has the variance of its start there
/// besides; its level and its derivatives stay.
void advance(const Prior& prior, const ProcessInterval& way, double* F, double* Q) noexcept {
  prior.advance(prior.along() == Along::time ? way.duration : way.distance, F, Q);
  if (!way.ends_with_jump) return;
  std::array<double, Prior::max_states> mean;
  std::array<double, std::size_t{Prior::max_states} * Prior::max_states> covariance;
  prior.start(mean.data(), covariance.data());
  Q[0] += covariance[0];
}

/// Up to a jump a parameter is held.
bool is_ramp(const Prior& prior, const ProcessInterval& way) noexcept {
  return prior.course() == Course::ramp && !way.ends_with_jump;
}

}  // namespace

int PriorBank::Filters::first_state(int parameter) const noexcept { return processes_[parameter].first; }
int PriorBank::Filters::process_states(int parameter) const noexcept { return processes_[parameter].count; }

PriorBank::Filters::~Filters() = default;

PriorBank::Filters::Filters(std::shared_ptr<const Model> model, Setup setup)
    : model_(std::move(model)),
      setup_(std::move(setup)),
      members_(static_cast<int>(setup_.members.size())),
      lanes_((members_ + lanes_at_once - 1) / lanes_at_once * lanes_at_once),
      nx_(model_->state_count()),
      nu_(model_->input_count()),
      np_(model_->parameter_count()),
      ny_(model_->output_count()) {
  refuse_outputs_of_motion(*model_, "bank");
  if (members_ < 1) throw Error("bank: expected at least 1 member");
  for (const PriorCombination& member : setup_.members)
    if (static_cast<int>(member.size()) != np_)
      throw Error(fmt::format("bank: a member has {} priors; expected {}, one a parameter", member.size(), np_));
  if (static_cast<int>(setup_.output_variances.size()) != ny_ || static_cast<int>(setup_.input_variances.size()) != nu_)
    throw Error("bank: expected one variance for every output and every input");
  if (!setup_.initial_parameters.empty() && static_cast<int>(setup_.initial_parameters.size()) != np_)
    throw Error("bank: expected initial knowledge of every parameter, or of none");
  if (setup_.map) check_map();
  n_ = nx_;
  for (int j = 0; j < np_; ++j) {
    Process process;
    process.first = n_;
    for (const PriorCombination& member : setup_.members) {
      const Prior* prior = member[j].get();
      auto found = std::find(process.kinds.begin(), process.kinds.end(), prior);
      if (found == process.kinds.end()) found = process.kinds.insert(found, prior);
      process.kind_of.push_back(static_cast<int>(found - process.kinds.begin()));
    }
    find_places(process);
    const auto size = static_cast<std::size_t>(process.count) * process.count;
    process.F.assign(size * lanes_, 0.0);
    process.Q.assign(size * lanes_, 0.0);
    process.ramp.assign(lanes_, 0.0);
    process.offset.assign(setup_.map ? lanes_ : 0, 0.0);
    process.off_course.assign(looks_ahead() ? lanes_ : 0, 0.0);
    n_ += process.count;
    processes_.push_back(std::move(process));
  }
  const auto limit = [this](int entry, const Variable& about, double share) {
    const double room = share * (about.upper - about.lower);
    if (!std::isfinite(room)) return;
    limited_.push_back(entry);
    limits_.insert(limits_.end(), {about.lower - room, about.upper + room});
  };
  for (int j = 0; j < nx_; ++j) limit(j, model_->description().states[j], state_room);
  for (int j = 0; j < np_; ++j) limit(processes_[j].first, model_->description().parameters[j], parameter_room);
  const auto n = static_cast<std::size_t>(n_), M = static_cast<std::size_t>(lanes_), nx = static_cast<std::size_t>(nx_);
  const std::size_t columns = nx + nu_ + 2 * np_;
  mean_.assign(n * M, 0.0);
  covariance_.assign(n * n * M, 0.0);
  work_.assign((2 * n * n + 3 * n) * M, 0.0);
  for (auto* v : {&weights_, &log_likelihoods_, &keep_, &take_, &squares_}) v->assign(M, 0.0);
  innovation_variances_.assign(ny_ * M, 0.0);
  output_variances_.assign(ny_ * M, 0.0);
  stated_weights_.reserve(ny_);
  learnt_.assign(2 * static_cast<std::size_t>(ny_), 0.0);
  const std::vector<Variable>& outputs = model_->description().outputs;
  for (int j = 0; j < ny_; ++j) {
    int first = 0;
    while (outputs[first].unit != outputs[j].unit || setup_.output_variances[first] != setup_.output_variances[j])
      ++first;
    sensor_.push_back(first);
  }
  surprises_.assign(setup_.robust.empty() ? 0 : ny_ * M, 0.0);
  find_loss_scales();
  if (looks_ahead()) {
    constexpr double unbounded = std::numeric_limits<double>::infinity();
    const std::vector<double> lower(np_, -unbounded), upper(np_, unbounded);
    std::vector<int> single;  // a robust loss is one of each measurement
    for (const RobustLoss& loss : setup_.robust) single.insert(single.end(), loss.outputs.begin(), loss.outputs.end());
    ahead_ = std::make_unique<LookAhead>(LookAhead{
        .mixture = {model_,
                    {setup_.output_variances, setup_.input_variances, lower, upper, setup_.motion_outputs, single,
                     setup_.scaled_outputs},
                    setup_.substeps,
                    setup_.most_between},
        .excitation = {model_, setup_.motion_outputs, setup_.substeps,
                       ReadingSummary(setup_.motion_outputs, ny_, setup_.most_between, setup_.substeps).most()},
        .curved_outputs = curved_outputs(*model_, setup_.motion_outputs)});
    ahead_->output_curvature = Curvature(static_cast<int>(ahead_->curved_outputs.size()), nx_, ny_);
    ahead_->ramp_variances.assign(np_, 0.0);
    ahead_->part.assign(ny_, 0.0);
    ahead_->shares.assign(static_cast<std::size_t>(ahead_->mixture.summary().most()), 0.0);
    ahead_->surprises.assign(ny_ * M, 0.0);
    ahead_->kept_rows.assign(setup_.scaled_outputs.size() * (1 + nx) * M, 0.0);
    learnt_.resize(learnt_.size() + ahead_->excitation.history_size(), 0.0);
    const auto a = static_cast<std::size_t>(wide_count());
    for (auto* v : {&ahead_->next_point, &ahead_->trial_mean}) v->assign(a * M, 0.0);
    ahead_->trial_covariance.assign(a * a * M, 0.0);
    ahead_->moved.assign(M, 0.0);
  }
  {
    const std::size_t a = static_cast<std::size_t>(wide_count()),
                      times = std::size_t{1} + (ahead_ ? ahead_->mixture.summary().most() : setup_.most_between);
    for (auto* v : {&wide_mean_, &wide_before_, &point_}) v->assign(a * M, 0.0);
    wide_covariance_.assign(a * a * M, 0.0);
    wide_work_.assign((2 * a * a + 3 * a) * M, 0.0);
    wide_predicted_.assign(times * ny_ * M, 0.0);
    wide_gradient_.assign(times * ny_ * a * M, 0.0);
    transition_.assign(n * a * M, 0.0);
  }
  next_.assign(nx * M, 0.0);
  jacobian_.assign(nx * columns * M, 0.0);
  predicted_.assign(ny_ * M, 0.0);
  gradient_.assign(ny_ * nx * M, 0.0);
  states_.assign(M * nx, 0.0);
  inputs_.assign(M * nu_, 0.0);
  parameters_.assign(M * np_, 0.0);
  ends_ = parameters_;
  durations_.assign(M, 0.0);
  next_rows_.assign(M * nx, 0.0);
  jacobian_rows_.assign(M * nx * columns, 0.0);
  output_rows_.assign(M * ny_, 0.0);
  gradient_rows_.assign(M * ny_ * nx, 0.0);
  map_means_.assign(2 * static_cast<std::size_t>(np_), 0.0);
  map_variances_ = map_means_;
  input_.assign(nu_, 0.0);
  added_.assign(ny_, 0.0);
  counted_.assign(ny_, 0.0);
  variances_.assign(nu_, 0.0);
  for (auto* v : {&start_, &own_, &own_covariance_, &filled_, &filled_covariance_})
    v->assign(std::size_t{Prior::max_states} * Prior::max_states, 0.0);
  is_own_.assign(n_, 0);
  full_mean_ = Eigen::VectorXd::Zero(n_);
  full_covariance_ = Eigen::MatrixXd::Zero(n_, n_);
  guesses_.assign(M, InputGuess(model_->description().inputs, n_));
  factors_ = std::make_unique<InputFactors>(*model_);
  views_ = std::make_unique<Views>();
  for (const Process& process : processes_)
    views_->processes.push_back(
        {process.first, process.count, process.F.data(), process.Q.data(), process.ramp.data()});
  views_->outputs.resize(ny_);
  reset(Eigen::VectorXd::Zero(nx_), Eigen::MatrixXd::Identity(nx_, nx_));
}

/// Which states any of a parameter's priors has, and how far they spread.
void PriorBank::Filters::find_places(Process& process) const {
  std::array<int, process_state_kinds> having{};
  std::array<double, process_state_kinds> sum{};
  std::vector<double> mean(Prior::max_states), covariance(std::size_t{Prior::max_states} * Prior::max_states);
  for (const Prior* prior : process.kinds) {
    const auto states = prior->states();
    if (states.empty() || states[0] != ProcessState::value)
      throw Error("bank: a prior whose first state is not the parameter itself");
    prior->start(mean.data(), covariance.data());
    const std::size_t count = states.size();
    for (std::size_t k = 0; k < count; ++k) {
      const auto kind = static_cast<std::size_t>(states[k]);
      ++having[kind];
      // Of the mean, what counts is how far the parameter is from it.
      sum[kind] += states[k] == ProcessState::mean ? covariance[0] - 2.0 * covariance[k] + covariance[k * count + k]
                                                   : covariance[k * count + k];
    }
  }
  for (std::size_t kind = 0; kind < having.size(); ++kind) {
    process.place[kind] = having[kind] > 0 ? process.count++ : -1;
    process.filler[kind] = having[kind] > 0 ? sum[kind] / having[kind] : 0.0;
  }
}

void PriorBank::Filters::write_start(int parameter, const Prior& prior, int lane) noexcept {
  const Process& process = processes_[parameter];
  prior.start(own_.data(), own_covariance_.data());
  if (!setup_.initial_parameters.empty()) {
    const Setup::Knowledge& known = setup_.initial_parameters[parameter];
    const int n = prior.state_count();
    double* const P = own_covariance_.data();
    std::copy_n(P, n, start_.data());  // the column of the value
    const double total = P[0] + known.variance, innovation = known.mean - own_[0];
    for (int c = 0; c < n && total > 0.0; ++c) {
      own_[c] += start_[c] / total * innovation;
      for (int r = 0; r < n; ++r) P[c * n + r] -= start_[r] * start_[c] / total;
    }
  }
  const Filling filling{prior, process.place, process.filler, process.count};
  filling.vector(own_.data(), start_.data());
  filling.covariance(own_covariance_.data(), filled_covariance_.data());
  for (int c = 0; c < process.count; ++c) {
    mean_[(process.first + c) * lanes_ + lane] = start_[c];
    for (int r = 0; r < process.count; ++r)
      covariance_[((process.first + c) * n_ + process.first + r) * lanes_ + lane] =
          filled_covariance_[c * process.count + r];
  }
}

void PriorBank::Filters::replace_vehicle(const Eigen::Ref<const Eigen::VectorXd>& state,
                                         const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept {
  for (int c = 0; c < n_; ++c) {
    for (int r = 0; r < n_; ++r) {
      if (c >= nx_ && r >= nx_) continue;
      const double value = c < nx_ && r < nx_ ? covariance(r, c) : 0.0;
      std::fill_n(covariance_.begin() + static_cast<std::ptrdiff_t>(c * n_ + r) * lanes_, lanes_, value);
    }
  }
  for (int r = 0; r < nx_; ++r) std::fill_n(mean_.begin() + static_cast<std::ptrdiff_t>(r) * lanes_, lanes_, state[r]);
}

void PriorBank::Filters::reset(const Eigen::Ref<const Eigen::VectorXd>& state,
                               const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept {
  std::fill(mean_.begin(), mean_.end(), 0.0);
  std::fill(covariance_.begin(), covariance_.end(), 0.0);
  std::fill(weights_.begin(), weights_.end(), 0.0);
  for (int m = 0; m < lanes_; ++m) {
    // Lanes without a member compute what the last one does, with weight 0: no lane has undefined values.
    const int member = std::min(m, members_ - 1);
    for (int r = 0; r < nx_; ++r) mean_[r * lanes_ + m] = state[r];
    for (int c = 0; c < nx_; ++c)
      for (int r = 0; r < nx_; ++r) covariance_[(c * n_ + r) * lanes_ + m] = covariance(r, c);
    for (int j = 0; j < np_; ++j) write_start(j, *setup_.members[member][j], m);
  }
  std::fill(log_likelihoods_.begin(), log_likelihoods_.end(), 0.0);
  for (int m = 0; m < members_; ++m) weights_[m] = 1.0 / members_;
  reset_noise();
  for (InputGuess& guess : guesses_) guess.forget();
  distance_ = 0.0;
}

/// Outputs at states (lanes x n_x), with their gradients: `predicted_` in lanes, `gradient_rows_` in rows.
void PriorBank::Filters::observe_members(const double* states) noexcept {
  model_->observe(
      {.count = lanes_, .states = states, .outputs = output_rows_.data(), .jacobians = gradient_rows_.data()});
  for (int m = 0; m < lanes_; ++m)
    for (int j = 0; j < ny_; ++j) predicted_[j * lanes_ + m] = output_rows_[m * ny_ + j];
}

void PriorBank::Filters::update(Measured y, const double* robust_weights) noexcept {
  for (int m = 0; m < lanes_; ++m)
    for (int r = 0; r < nx_; ++r) states_[m * nx_ + r] = mean_[r * lanes_ + m];
  linearise_nodes();
  const BankView view{lanes_, nx_, n_, mean_.data(), covariance_.data(), work_.data()};
  Frame frame{.view = view,
              .gradient = gradient_.data(),
              .before = states_.data(),
              .before_entry = 1,
              .before_lane = nx_,
              .is_between = false,
              .weights = y.weights};
  std::ranges::fill(added_, 0.0);
  stated_weights_.assign(y.weights, y.weights ? y.weights + ny_ : nullptr);
  if (ahead_ || y.weights) spread_variances(y.weights);
  if (ahead_ && std::ranges::any_of(ahead_->curved_outputs, [y](int j) { return !std::isnan(y[j]); })) {
    linearise_given(y.values);
    wide_before_ = wide_mean_;
    frame.before = wide_before_.data();
    frame.before_entry = lanes_;
    frame.before_lane = 1;
  }
  log_likelihood_ = take_outputs(frame, y.values, robust_weights);
  if (y.weights && setup_.robust.empty()) spread_variances();
  update_guesses();
  keep_near_bounds();
}

/// A member that has followed a measurement which was wrong by far, as they may be while the vehicle is lost, is
/// nowhere near where it was linearised; what it makes of the next one would lead still farther away.
void PriorBank::Filters::keep_near_bounds() noexcept {
  for (std::size_t k = 0; k < limited_.size(); ++k) {
    double* const values = mean_.data() + static_cast<std::ptrdiff_t>(limited_[k]) * lanes_;
    const double lower = limits_[2 * k], upper = limits_[2 * k + 1];
    for (int m = 0; m < lanes_; ++m) values[m] = std::min(std::max(values[m], lower), upper);
  }
}

/// Outputs and gradients at `states_`.
void PriorBank::Filters::linearise_nodes() noexcept {
  observe_members(states_.data());
  for (int m = 0; m < lanes_; ++m)
    for (int j = 0; j < ny_; ++j)
      for (int c = 0; c < nx_; ++c) gradient_[(j * nx_ + c) * lanes_ + m] = gradient_rows_[(m * nx_ + c) * ny_ + j];
}

/// The outputs that y has, as `predicted_`, for the kernels: how many.
int PriorBank::Filters::view_outputs(const double* gradients, std::ptrdiff_t entries, const double* y) noexcept {
  views_->taken = 0;
  for (std::ptrdiff_t j = 0; j < ny_; ++j)
    if (!std::isnan(y[j]))
      views_->add(model_->description().outputs[j], predicted_.data() + j * lanes_, gradients + j * entries,
                  output_variances_.data() + j * lanes_, y[j]);
  return views_->taken;
}

/// Takes in outputs whose predictions and gradients are known, and weighs the members by them. Returns the logarithm of
/// their likelihood.
double PriorBank::Filters::take_outputs(const Frame& frame, const double* y, const double* robust_weights) noexcept {
  const BankView& view = frame.view;
  const std::ptrdiff_t entries = static_cast<std::ptrdiff_t>(view.vehicle_states) * lanes_;
  std::fill(squares_.begin(), squares_.end(), 0.0);
  const int taken = view_outputs(frame.gradient, entries, y);
  if (taken == 0) return 0.0;
  find_scale_slopes(frame, y);
  if (!setup_.robust.empty()) weigh_outputs(frame, y, taken, robust_weights);
  if (ahead_ && members_ > 1)
    ahead_->bound_surprises(view, *views_, y, setup_.motion_outputs, output_variances_.data());
  bank_kernels().update(view, views_->outputs.data(), taken, setup_.gate, squares_.data(),
                        innovation_variances_.data());
  if (!frame.tells_laws) {
    if (setup_.adapts_noise) adapt_noise(frame, y);
    return 0.0;
  }
  double best = -std::numeric_limits<double>::infinity();
  for (int m = 0; m < members_; ++m) {
    // One logarithm for several outputs; the product of many would leave the range of a double.
    double logarithms = 0.0;
    for (int first = 0; first < taken; first += outputs_at_once) {
      double product = 1.0;
      for (int j = first; j < std::min(first + outputs_at_once, taken); ++j)
        product *= innovation_variances_[j * lanes_ + m];
      logarithms += std::log(product);
    }
    squares_[m] = -0.5 * (squares_[m] + logarithms);
    log_likelihoods_[m] += squares_[m];
    if (squares_[m] > best) best = squares_[m];
  }
  double sum = 0.0, evidence = 0.0;
  for (int m = 0; m < members_; ++m) {
    const double likelihood = std::exp(squares_[m] - best), finite = std::isfinite(likelihood) ? likelihood : 0.0;
    evidence += weights_[m] * finite;
    // A sensor of motion shows a wrong law so finely that innovations are not independent: see docs/method.md.
    weights_[m] *= ahead_ ? std::sqrt(finite) : finite;
    sum += weights_[m];
  }
  const double log_likelihood = best + std::log(ahead_ ? evidence : sum);
  for (int m = 0; m < members_; ++m)
    weights_[m] = sum > 0.0 ? std::max(weights_[m] / sum, least_weight) : 1.0 / members_;
  sum = std::accumulate(weights_.begin(), weights_.begin() + members_, 0.0);
  for (int m = 0; m < members_; ++m) weights_[m] /= sum;
  if (setup_.adapts_noise) adapt_noise(frame, y);
  return log_likelihood;
}

/// Ground covered on an interval, from the vehicle's motion at the mixture's mean: at least a share of what it would be
/// without slip. Wheels that spin on the spot cover none, and yet may grip at once: by no law along the ground would
/// slip vary meanwhile, and all of them would have it for known when they grip.
void PriorBank::Filters::find_distance(const double* input, double duration) noexcept {
  const Roles& roles = model_->description().roles;
  double *const nominal_state = states_.data() + nx_, *const nominal = parameters_.data() + np_;
  std::fill_n(states_.data(), nx_, 0.0);
  std::fill_n(parameters_.data(), np_, 0.0);
  for (int m = 0; m < members_; ++m) {
    for (int r = 0; r < nx_; ++r) states_[r] += weights_[m] * mean_[r * lanes_ + m];
    for (int j = 0; j < np_; ++j) parameters_[j] += weights_[m] * mean_[processes_[j].first * lanes_ + m];
  }
  distance_ = setup_.least_speed * duration;
  if (roles.position_x < 0 || roles.position_y < 0) return;
  std::copy_n(states_.data(), nx_, nominal_state);
  for (int j = 0; j < np_; ++j) nominal[j] = model_->description().parameters[j].nominal;
  for (int row = 0; row < 2; ++row) std::copy_n(input, nu_, inputs_.data() + static_cast<std::ptrdiff_t>(row) * nu_);
  std::fill_n(durations_.data(), 2, duration);
  model_->integrate({.count = 2,
                     .states = states_.data(),
                     .inputs = inputs_.data(),
                     .parameters = parameters_.data(),
                     .durations = durations_.data(),
                     .substeps = setup_.substeps,
                     .next_states = next_rows_.data()});
  const auto covered = [&](int row) {
    const double *const from = states_.data() + static_cast<std::ptrdiff_t>(row) * nx_, *const to =
                                                                                            next_rows_.data() +
                                                                                            static_cast<std::ptrdiff_t>(
                                                                                                row) *
                                                                                                nx_;
    const double way =
        std::hypot(to[roles.position_x] - from[roles.position_x], to[roles.position_y] - from[roles.position_y]);
    return std::isfinite(way) ? way : 0.0;
  };
  distance_ = std::max({distance_, covered(0), least_grip * covered(1)});
}

/// F and Q of every process over the interval.
void PriorBank::Filters::advance_processes(const ProcessInterval& way) noexcept {
  for (Process& process : processes_) {
    for (std::size_t kind = 0; kind < process.kinds.size(); ++kind) {
      const Prior& prior = *process.kinds[kind];
      advance(prior, way, own_.data(), own_covariance_.data());
      const Filling filling{prior, process.place, process.filler, process.count};
      filling.transition(own_.data(), filled_.data());
      filling.covariance(own_covariance_.data(), filled_covariance_.data());
      const double off_course = ahead_ && members_ > 1 ? variance_off_course(prior, way.duration, way.distance) : 0.0;
      for (int m = 0; m < lanes_; ++m) {
        if (process.kind_of[std::min(m, members_ - 1)] != static_cast<int>(kind)) continue;
        process.ramp[m] = is_ramp(prior, way) ? 1.0 : 0.0;
        if (ahead_) process.off_course[m] = off_course;
        for (int e = 0; e < process.count * process.count; ++e) {
          process.F[e * lanes_ + m] = filled_[e];
          process.Q[e * lanes_ + m] = filled_covariance_[e];
        }
      }
    }
  }
}

/// Over the ground covered, another law may have come to hold.
void PriorBank::Filters::mix_members() noexcept {
  const double change = -std::expm1(-distance_ / setup_.memory), each = change / members_;
  if (!(change > 0.0)) return;
  for (int m = 0; m < lanes_; ++m) {
    const double next = (1.0 - change) * weights_[m] + each;
    take_[m] = each / next;
    keep_[m] = 1.0 - take_[m];
  }
  const BankView view{lanes_, nx_, n_, mean_.data(), covariance_.data(), work_.data()};
  bank_kernels().mix(view, weights_.data(), keep_.data(), take_.data());
  for (int m = 0; m < members_; ++m) weights_[m] = (1.0 - change) * weights_[m] + each;
}

/// All that an interval asks for before the members move: inputs, ground, processes, and another law.
void PriorBank::Filters::begin_step(const MeasuredInterval& interval) noexcept {
  begin_inputs(interval);
  between_log_likelihood_ = 0.0;
  find_distance(input_.data(), interval.duration);
  advance_processes({interval.duration, distance_, interval.ends_with_jump});
  if (setup_.map) follow_map();
  if (members_ > 1) mix_members();
}

/// Integrates all members from a mean, [x; z] or the wider one, over a share of the interval: next state and Jacobian.
void PriorBank::Filters::integrate_members(const double* mean, bool is_wide, double seconds, double share) noexcept {
  const int columns = nx_ + nu_ + 2 * np_;
  for (int m = 0; m < lanes_; ++m) {
    for (int r = 0; r < nx_; ++r) states_[m * nx_ + r] = mean[r * lanes_ + m];
    for (int j = 0; j < nu_; ++j) inputs_[m * nu_ + j] = is_wide ? mean[(n_ + j) * lanes_ + m] : input_[j];
    durations_[m] = seconds;
    for (int j = 0; j < np_; ++j) {
      const Process& process = processes_[j];
      const double start = mean[process.first * lanes_ + m];
      double end = start;
      if (process.ramp[m] != 0.0) {
        end = 0.0;
        for (int k = 0; k < process.count; ++k)
          end += process.F[k * process.count * lanes_ + m] * mean[(process.first + k) * lanes_ + m];
        if (is_wide) end += mean[(n_ + nu_ + process.first - nx_) * lanes_ + m];
        if (setup_.map) end += process.offset[m];
      }
      parameters_[m * np_ + j] = start;
      ends_[m * np_ + j] = share == 1.0 ? end : start + share * (end - start);
    }
  }
  model_->integrate({.count = lanes_,
                     .states = states_.data(),
                     .inputs = inputs_.data(),
                     .parameters = parameters_.data(),
                     .parameters_end = ends_.data(),
                     .durations = durations_.data(),
                     .substeps = setup_.substeps,
                     .next_states = next_rows_.data(),
                     .jacobians = jacobian_rows_.data()});
  if (guesses_.front().is_any_missing()) hold_factors();
  for (int m = 0; m < lanes_; ++m) {
    for (int r = 0; r < nx_; ++r) next_[r * lanes_ + m] = next_rows_[m * nx_ + r];
    for (int e = 0; e < nx_ * columns; ++e) jacobian_[e * lanes_ + m] = jacobian_rows_[m * nx_ * columns + e];
  }
}

/// The moments at the interval's end, by the next states and the Jacobian of `integrate_members`.
void PriorBank::Filters::take_linearised_step() noexcept {
  const BankView view{lanes_, nx_, n_, mean_.data(), covariance_.data(), work_.data()};
  bank_kernels().predict(view, {.inputs = nu_,
                                .processes = np_,
                                .process = views_->processes.data(),
                                .next_states = next_.data(),
                                .jacobian = jacobian_.data(),
                                .input_variances = variances_.data()});
  if (setup_.map) add_offsets();
}

void PriorBank::Filters::moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept {
  const BankView view{lanes_, nx_, n_, mean_.data(), covariance_.data(), work_.data()};
  bank_kernels().moments(view, weights_.data(), full_mean_.data(), full_covariance_.data());
  const auto at = [&](int k) { return k < nx_ ? k : processes_[k - nx_].first; };
  mean.resize(nx_ + np_);
  covariance.resize(nx_ + np_, nx_ + np_);
  for (int c = 0; c < nx_ + np_; ++c) {
    mean[c] = full_mean_[at(c)];
    for (int r = 0; r < nx_ + np_; ++r) covariance(r, c) = full_covariance_(at(r), at(c));
  }
}

std::size_t PriorBank::Filters::state_size() const noexcept {
  return mean_.size() + covariance_.size() + weights_.size() + learnt_.size() +
         guesses_.size() * guesses_.front().state_size();
}

void PriorBank::Filters::save(double* state) const noexcept {
  state = std::copy(mean_.begin(), mean_.end(), state);
  state = std::copy(covariance_.begin(), covariance_.end(), state);
  state = std::copy(weights_.begin(), weights_.end(), state);
  state = std::copy(learnt_.begin(), learnt_.end(), state);
  for (const InputGuess& guess : guesses_) {
    guess.save(state);
    state += guess.state_size();
  }
}

void PriorBank::Filters::restore(const double* state) noexcept {
  const auto take = [&](AlignedDoubles& to) {
    std::copy_n(state, to.size(), to.begin());
    state += to.size();
  };
  take(mean_);
  take(covariance_);
  take(weights_);
  take(learnt_);
  for (int m = 0; m < lanes_; ++m) {
    InputGuess& guess = guesses_[static_cast<std::size_t>(m)];
    guess.restore(state);
    state += guess.state_size();
    if (!guess.knows_missing()) continue;
    view_member(m);
    guess.resume(full_mean_, full_covariance_);
  }
  spread_variances();
}

/// Where the states of a member's own prior are among those of its process.
int PriorBank::Filters::own_places(int member, int parameter, int* places) const noexcept {
  const auto states = setup_.members[member][parameter]->states();
  for (std::size_t k = 0; k < states.size(); ++k)
    places[k] = processes_[parameter].place[static_cast<std::size_t>(states[k])];
  return static_cast<int>(states.size());
}

void PriorBank::Filters::saved_moments(const double* state, int member, Eigen::VectorXd& mean,
                                       Eigen::MatrixXd& covariance) noexcept {
  const double* const P = state + mean_.size();
  mean.setZero();
  covariance.setIdentity();
  std::fill(is_own_.begin(), is_own_.end(), std::uint8_t{0});
  std::fill_n(is_own_.begin(), nx_, std::uint8_t{1});
  std::array<int, Prior::max_states> places{};
  for (int j = 0; j < np_; ++j) {
    const int count = own_places(member, j, places.data());
    for (int k = 0; k < count; ++k) is_own_[processes_[j].first + places[k]] = 1;
  }
  for (int c = 0; c < n_; ++c) {
    if (!is_own_[c]) continue;
    mean[c] = state[static_cast<std::ptrdiff_t>(c) * lanes_ + member];
    for (int r = 0; r < n_; ++r)
      if (is_own_[r]) covariance(r, c) = P[(static_cast<std::ptrdiff_t>(c) * n_ + r) * lanes_ + member];
  }
}

void PriorBank::Filters::write_process(int member, int parameter, const ProcessInterval& way, double* data) noexcept {
  const Prior& prior = *setup_.members[member][parameter];
  const int count = processes_[parameter].count;
  std::array<int, Prior::max_states> places{};
  const int own = own_places(member, parameter, places.data());
  advance(prior, way, own_.data(), own_covariance_.data());
  double *F = data + 1, *L = F + count * count;
  std::fill_n(data, 1 + 2 * count * count, 0.0);
  data[0] = is_ramp(prior, way) ? 1.0 : 0.0;
  // The Cholesky factor of a covariance that may be singular: what no pivot is left for is determined by those before.
  for (int c = 0; c < own; ++c) {
    const auto at = [&](int r, int k) -> double& { return L[places[k] * count + places[r]]; };
    double pivot = own_covariance_[c * own + c];
    for (int k = 0; k < c; ++k) pivot -= at(c, k) * at(c, k);
    const bool has_pivot = pivot > std::numeric_limits<double>::epsilon() * own_covariance_[c * own + c];
    const double root = has_pivot ? std::sqrt(pivot) : 0.0;
    for (int r = c; r < own && has_pivot; ++r) {
      double entry = own_covariance_[c * own + r];
      for (int k = 0; k < c; ++k) entry -= at(r, k) * at(c, k);
      at(r, c) = entry / root;
    }
    for (int r = 0; r < own; ++r) F[places[c] * count + places[r]] = own_[c * own + r];
  }
}

void PriorBank::Filters::moments_of(int member, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const noexcept {
  const auto at = [&](int k) { return k < nx_ ? k : processes_[k - nx_].first; };
  mean.resize(nx_ + np_);
  covariance.resize(nx_ + np_, nx_ + np_);
  for (int c = 0; c < nx_ + np_; ++c) {
    mean[c] = mean_[at(c) * lanes_ + member];
    for (int r = 0; r < nx_ + np_; ++r) covariance(r, c) = covariance_[(at(c) * n_ + at(r)) * lanes_ + member];
  }
}

}  // namespace rhec
