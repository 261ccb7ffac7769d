#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "innovation.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/input_factors.hpp"
#include "rhec/core/model/motion_outputs.hpp"
#include "sensor_judge_parts.hpp"

namespace rhec {

namespace {

constexpr std::size_t innovation_capacity = 256, held_capacity = 32;
// In typical magnitudes, what a measured input cannot be.
constexpr double impossible_input = 20.0;
// Standard deviations by which a sensor has to be off, in the sum of many samples. It is tested at every one of them,
// with all times since when it may be so.
constexpr double offset_gate = 7.0;
// Slip at its bound, of which measurements ask for more by this many of its standard deviations in all, beside so many
// a sample, does not explain how the vehicle moves. A sample of a quick sensor beside a slow one that says where the
// vehicle is may ask for as much as is usual at a bound: more than the mean of half a Gaussian variable, 0.4, times the
// standard deviation of how much it moves slip.
constexpr double impossibly_beyond = 4.0, usually_beyond = 0.75, at_its_bound = 0.5;

// Over which it is looked at what moves what [s].
constexpr double short_time = 0.1;

/// Derivatives of the state after a time [s] by [x; u; p], at a point where everything moves: of a vehicle that stands
/// much else stays as it is.
Eigen::MatrixXd jacobian_in_motion(const Model& model, double duration) {
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count();
  const ModelDescription& about = model.description();
  std::vector<double> state, inputs, parameters = nominal_values(about.parameters);
  for (const Variable& each : about.states) state.push_back(std::clamp(0.3 * each.scale, each.lower, each.upper));
  for (const Variable& each : about.inputs) inputs.push_back(std::clamp(each.scale, each.lower, each.upper));
  for (std::size_t k = 0; k < parameters.size(); ++k)
    if (parameters[k] == 0.0)
      parameters[k] = std::clamp(about.parameters[k].scale, about.parameters[k].lower, about.parameters[k].upper);
  const std::vector<double> data(model.data_count(), 0.0);
  Eigen::MatrixXd jacobian(nx, nx + nu + np);
  model.integrate({.count = 1,
                   .states = state.data(),
                   .inputs = inputs.data(),
                   .parameters = parameters.data(),
                   .durations = &duration,
                   .data = data.data(),
                   .jacobians = jacobian.data()});
  return jacobian;
}

/// The state that is an output's bias: it stays as it is, no other state moves with it, no other output has it, and the
/// output is larger by it. -1: none.
int bias_of(const WalkingFilter& filter, int output) {
  const Model& model = filter.model();
  const int nx = model.state_count();
  const Eigen::MatrixXd jacobian = jacobian_in_motion(model, short_time);
  for (int i = 0; i < nx; ++i) {
    if (filter.derivative(output, i) != 1.0) continue;
    bool is_bias = true;
    for (int j = 0; j < model.output_count(); ++j) is_bias = is_bias && (j == output || !filter.depends_on(j, i));
    for (int k = 0; k < nx; ++k) {
      const double kept = k == i ? 1.0 : 0.0;
      is_bias = is_bias && jacobian(i, k) == kept && jacobian(k, i) == kept;
    }
    if (is_bias) return i;
  }
  return -1;
}

/// The measured inputs of which offsets show: speeds, of which no slip is a factor that is not known. What slip makes
/// of an input is what its offset would be; and what works by a rate, as of steering, does what a drifting sensor seems
/// to do.
std::vector<int> watched_inputs(const Model& model, const KalmanFilter::Noise& noise) {
  const ModelDescription& about = model.description();
  const int nx = model.state_count(), measured = model.input_count() - static_cast<int>(about.noisy_states.size());
  std::vector<int> watched;
  if (about.roles.position_x < 0 || about.roles.position_y < 0) return watched;
  const InputFactors factors(model);
  const Eigen::MatrixXd first = jacobian_in_motion(model, short_time),
                        later = jacobian_in_motion(model, 2.0 * short_time);
  const auto way_by = [&](const Eigen::MatrixXd& jacobian, int input) {
    return std::hypot(jacobian(about.roles.position_x, nx + input), jacobian(about.roles.position_y, nx + input));
  };
  for (int j = 0; j < measured; ++j) {
    // Where a speed leads grows with the time, where a rate of something else leads with its square.
    const double way = way_by(first, j);
    bool is_told = way > 0.0 && way_by(later, j) <= 3.0 * way;
    for (int p = 0; p < model.parameter_count(); ++p) {
      const auto parameter = static_cast<std::size_t>(p);
      const bool is_open = noise.parameter_lower[parameter] < noise.parameter_upper[parameter];
      is_told = is_told && !(is_open && factors.is_factor(p, j));
    }
    if (is_told) watched.push_back(j);
  }
  return watched;
}

/// The outputs of which offsets show, by what a filter expects. Where the vehicle is, the offset of one output does
/// not; of several that measure the same, the differences to the best one do.
std::vector<OffsetWatch::Watched> watched_outputs(const WalkingFilter& filter, const std::vector<double>& variances) {
  std::vector<OffsetWatch::Watched> watched;
  const std::vector<Variable>& about = filter.model().description().outputs;
  const Roles& roles = filter.model().description().roles;
  const auto derivative = [&](int output, int state) { return state < 0 ? 0.0 : filter.derivative(output, state); };
  const auto by_x = [&](int output) { return derivative(output, roles.position_x); };
  const auto by_y = [&](int output) { return derivative(output, roles.position_y); };
  const int count = static_cast<int>(about.size());
  // How two receivers differ is told in the plane alone.
  const bool has_place = roles.position_x >= 0 && roles.position_y >= 0;
  const auto is_same = [&](int j, int k) {
    return has_place && about[j].device != about[k].device && by_x(j) == by_x(k) && by_y(j) == by_y(k);
  };
  for (int j = 0; j < count; ++j) {
    if (by_x(j) == 0.0 && by_y(j) == 0.0) {
      watched.push_back({.output = j, .bias = bias_of(filter, j)});
      continue;
    }
    int best = j;
    for (int k = 0; k < count; ++k) {
      const bool is_better = variances[k] < variances[best] || (variances[k] == variances[best] && k < best);
      if (is_same(j, k) && is_better) best = k;
    }
    if (best != j) {
      watched.push_back({.output = j, .rival = best});
      continue;
    }
    for (int k = 0; k < count && best == j; ++k)
      if (is_same(j, k)) best = k;
    // The best one may jump.
    if (best != j) watched.push_back({.output = j, .rival = best, .is_searched = false});
  }
  return watched;
}

/// The inputs that outputs see by themselves, whatever else the vehicle does, and of which nothing is left in what
/// these see later.
struct Seen {
  int input, output;
};
std::vector<Seen> seen_inputs(const WalkingFilter& filter) {
  const Model& model = filter.model();
  const int nx = model.state_count(),
            measured = model.input_count() - static_cast<int>(model.description().noisy_states.size());
  const Eigen::MatrixXd jacobian = jacobian_in_motion(model, short_time);
  std::vector<Seen> seen;
  for (int i = 0; i < nx; ++i) {
    for (int j = 0; j < measured; ++j) {
      Eigen::RowVectorXd others = jacobian.row(i);
      others[nx + j] = 0.0;
      others.segment(nx + measured, model.input_count() - measured).setZero();  // noise
      if (!jacobian.col(i).isZero(0.0) || !others.isZero(0.0) || jacobian(i, nx + j) == 0.0) continue;
      for (int k = 0; k < model.output_count(); ++k)
        if (filter.depends_on(k, i)) seen.push_back({j, k});
    }
  }
  return seen;
}

WalkingFilter::Setup filter_setup(const SensorJudge::Setup& setup) {
  return {.noise = setup.noise,
          .walk = setup.walk,
          .has_ramps = setup.has_ramps,
          .step = setup.step,
          .substeps = setup.substeps};
}

/// Inputs count as typical motion: what is measured of them says nothing.
WalkingFilter::Setup blind_setup(const SensorJudge::Setup& setup, const std::vector<double>& unknown_sigmas) {
  WalkingFilter::Setup blind = filter_setup(setup);
  for (std::size_t j = 0; j < unknown_sigmas.size(); ++j)
    blind.noise.input_variances[j] = std::max(blind.noise.input_variances[j], unknown_sigmas[j] * unknown_sigmas[j]);
  return blind;
}

}  // namespace

SensorJudge::SensorJudge(std::shared_ptr<const Model> model, const Setup& setup)
    : setup_(setup), sensors_(sensors_of(model->description(), setup.noise.output_variances)) {
  const auto np = static_cast<std::size_t>(model->parameter_count());
  if (setup_.walk.size() != np || setup_.parameter_sigmas.size() != np)
    throw Error(fmt::format("sensor watch: {} walks and {} standard deviations of parameters; expected {} of each",
                            setup_.walk.size(), setup_.parameter_sigmas.size(), np));
  const Eigen::Index size = model->state_count() + model->parameter_count();
  const Eigen::MatrixXd& initial = setup_.initial_covariance;
  if (initial.size() > 0 && (setup_.initial_mean.size() != size || initial.rows() != size || initial.cols() != size))
    throw Error(fmt::format("sensor watch: an initial mean of {} values, and a covariance of {} x {}; expected {}",
                            setup_.initial_mean.size(), initial.rows(), initial.cols(), size));
  for (const Variable& each : model->description().inputs)
    input_names_.push_back({.name = each.name, .outputs = {}, .unit = each.unit});
  for (int degrees = 0; degrees <= most_sensor_outputs; ++degrees) {
    limits_.push_back(degrees ? chi_square_limit(degrees, setup_.gate) : 0.0);
    close_limits_.push_back(degrees ? chi_square_limit(degrees, std::min(setup_.gate, close_gate)) : 0.0);
  }
  const auto make = [&](const WalkingFilter::Setup& filter) {
    auto result = std::make_unique<Hypothesis>(Hypothesis{WalkingFilter(model, filter)});
    result->before_mean = result->filter.mean();
    result->before_covariance = result->filter.covariance();
    return result;
  };
  own_ = make(filter_setup(setup_));
  slip_ = make(filter_setup(setup_));
  edge_ = make(filter_setup(setup_));
  moved_ = make(filter_setup(setup_));
  back_ = make(filter_setup(setup_));
  memory_ = std::make_unique<Memory>();
  const std::size_t measured = model->description().inputs.size() - model->description().noisy_states.size();
  memory_->unknown_sigmas.assign(model->description().inputs.size(), 0.0);
  memory_->more_sigmas = memory_->unknown_sigmas;
  for (std::size_t j = 0; j < measured; ++j) memory_->unknown_sigmas[j] = model->description().inputs[j].scale;
  blind_ = make(blind_setup(setup_, memory_->unknown_sigmas));
  memory_->double_fault = make(filter_setup(setup_));
  memory_->stuck = StuckValues(setup_.noise.output_variances, outputs_of_motion(*model));
  memory_->trial = std::make_unique<WalkingFilter>(model, filter_setup(setup_));
  memory_->ahead = std::make_unique<WalkingFilter>(model, filter_setup(setup_));
  memory_->unplaced = std::make_unique<WalkingFilter>(model, filter_setup(setup_));
  memory_->past = std::make_unique<PastMoments>(Memory::past_moments, own_->filter, model->input_count());
  memory_->loss = std::make_unique<InformationLoss>(model, filter_setup(setup_));
  own_->filter.expect();
  std::vector<OffsetWatch::Watched> watched;
  if (setup_.offsets) {
    watched = watched_outputs(own_->filter, setup_.noise.output_variances);
    for (const int input : watched_inputs(own_->filter.model(), setup_.noise)) watched.push_back({.input = input});
  }
  for (const Seen& each : seen_inputs(own_->filter))
    if (const int sensor = sensor_of(each.output, sensors_); sensor >= 0 && !sees_position(each.output))
      memory_->contradictions.push_back({each.input, each.output, static_cast<std::size_t>(sensor)});
  memory_->correlated = std::make_unique<CorrelatedErrors>(*model);
  memory_->offsets = std::make_unique<OffsetWatch>(*model, watched, setup_.noise, offset_gate);
  if (model->description().roles.heading >= 0)
    for (auto* each : {&memory_->search, &memory_->second_thought})
      *each = std::make_unique<HeadingSearch>(model, filter_setup(setup_), close_gate);
  const Eigen::Index n = own_->filter.mean().size();
  memory_->before_mean = Eigen::VectorXd::Zero(n);
  memory_->before_covariance = Eigen::MatrixXd::Zero(n, n);
  memory_->away = memory_->before_update = memory_->before_slip = memory_->before_mean;
  memory_->near_slip = Eigen::VectorXd::Zero(model->parameter_count());
  memory_->factor = memory_->before_covariance;
  memory_->recent = std::make_unique<RecentSamples>(own_->filter);
  memory_->replayed = memory_->contradicting = MeasuredOutputs(model->output_count());
  raw_.assign(model->output_count(), Memory::unknown);
  memory_->first_errors = memory_->retracted = memory_->expected = memory_->not_accused = raw_;
  input_.assign(model->input_count(), 0.0);
  believed_input_ = memory_->measured_inputs = memory_->inputs_without = input_;
  held_.assign(held_capacity, {0.0, MeasuredOutputs(model->output_count())});
  raw_weights_.reserve(raw_.size());
  innovations_.resize(innovation_capacity);
  reset();
}

SensorJudge::~SensorJudge() = default;

std::shared_ptr<const FilterMemo> SensorJudge::make_memo() { return own_->filter.make_memo(); }

const Eigen::VectorXd& SensorJudge::mean() const noexcept { return own_->filter.mean(); }
const Eigen::MatrixXd& SensorJudge::covariance() const noexcept { return own_->filter.covariance(); }

void SensorJudge::reset() noexcept {
  is_active_ = is_blind_ = false;
  end_dispute();
  states_.assign(sensors_.size(), {});
  findings_.assign(sensors_.size(), 0);
  quiet_.assign(sensors_.size(), 0);
  quiet_inputs_ = 0;
  records_.assign(sensors_.size(), {});
  excesses_.assign(sensors_.size(), 1.0);
  memory_->accused.assign(sensors_.size(), 0);
  heard_.assign(sensors_.size(), Memory::unknown);
  is_unobserved_ = false;
  usual_volume_ = Memory::unknown;
  memory_->loss->reset();
  if (memory_->search) memory_->search->cancel();
  inputs_ = {};
  off_input_ = doubted_input_ = -1;
  input_findings_ = 0;
  memory_->doubts.assign(input_.size(), {});
  std::ranges::fill(memory_->measured_inputs, Memory::unknown);
  calm_samples_ = setup_.calm;
  held_count_ = innovation_count_ = 0;
  memory_->recent->forget();
  memory_->past->forget();
  memory_->has_advanced = false;
  memory_->offsets->reset();
  memory_->was_minor.assign(sensors_.size(), 0);
  memory_->correlated->reset(setup_.whiteness ? std::span<const Sensor>(sensors_) : std::span<const Sensor>());
  if (setup_.initial_covariance.size() > 0) {
    own_->filter.mean() = setup_.initial_mean;
    own_->filter.covariance() = setup_.initial_covariance;
  }
  memory_->stuck.reset();
  memory_->beyond_bounds = 0.0;
  memory_->impossible_samples = 0;
  memory_->was_open = memory_->was_input_off = memory_->is_starting = false;
  memory_->places.clear();
  memory_->undisputed_samples = setup_.calm;
  std::fill(believed_input_.begin(), believed_input_.end(), 0.0);
}

void SensorJudge::restart(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  own_->filter.mean() = mean;
  own_->filter.covariance() = covariance;
  is_active_ = true;
  is_blind_ = memory_->is_starting = false;
  if (memory_->search) memory_->search->cancel();
  end_dispute();
  memory_->places.clear();
  memory_->recent->forget();
  memory_->past->forget();
  memory_->has_advanced = false;
  memory_->loss->end();
  memory_->offsets->forget_onsets();
}

void SensorJudge::clean_inputs(double* inputs) noexcept {
  const std::vector<Variable>& about = own_->filter.model().description().inputs;
  const std::size_t measured = about.size() - own_->filter.model().description().noisy_states.size();
  for (std::size_t j = 0; j < measured; ++j) {
    const double room = 0.5 * (about[j].upper - about[j].lower), far = impossible_input * about[j].scale;
    const double lower = std::isfinite(room) ? about[j].lower - room : -far,
                 upper = std::isfinite(room) ? about[j].upper + room : far;
    if (std::isnan(inputs[j]) || (inputs[j] >= lower && inputs[j] <= upper)) continue;
    inputs[j] = Memory::unknown;
    input_findings_ |= reason::implausible;
    ++inputs_.rejected;
  }
  memory_->offsets->correct_inputs(inputs);
  for (std::size_t j = 0; j < measured; ++j) {
    if (!std::isnan(inputs[j])) memory_->measured_inputs[j] = inputs[j];
    if (memory_->doubts[j].is_doubted) inputs[j] = Memory::unknown;
  }
}

void SensorJudge::advance(double duration, const double* inputs, const double* more_sigmas) noexcept {
  if (!is_active_) {
    own_->filter.predict(inputs, duration, more_sigmas);
    return;
  }
  if (!is_searching()) memory_->loss->predict(own_->filter, inputs, duration, more_sigmas);
  if (more_sigmas) {
    // Nobody knows how the vehicle has moved: what follows starts from here.
    if (!is_unobserved_) {
      memory_->before_mean = own_->filter.mean();
      memory_->before_covariance = own_->filter.covariance();
    }
    memory_->offsets->forget_onsets();
    own_->filter.predict(inputs, duration, more_sigmas);
    if (memory_->search) memory_->search->cancel();
    end_dispute();
    is_unobserved_ = true;
    return;
  }
  if (is_searching()) {
    memory_->search->predict(inputs, duration);
    return;
  }
  for (Hypothesis* each : {moved_.get(), memory_->double_fault.get(), back_.get()})
    if (each->is_active && !memory_->has_advanced) each->note_before();
  note_motion(duration, inputs);
  memory_->recent->note_inputs(input_);
  if (is_blind_) {
    memory_->offsets->forget_onsets();
    blind_->filter.mean() = own_->filter.mean();
    blind_->filter.covariance() = own_->filter.covariance();
    predict_blind(believed_input_.data(), duration);
    own_->filter.mean() = blind_->filter.mean();
    own_->filter.covariance() = blind_->filter.covariance();
  } else {
    own_->filter.predict(inputs, duration, nullptr, &memory_->offsets->sensitivities());
  }
  if (!is_disputed_) return;
  if (slip_->is_active) slip_->filter.predict(inputs, duration);
  if (edge_->is_active) edge_->filter.predict(inputs, duration);
  if (moved_->is_active || moved_->is_informed) moved_->filter.predict(inputs, duration);
  if (memory_->double_fault->is_active) memory_->double_fault->filter.predict(inputs, duration);
  if (back_->is_active) back_->filter.predict(inputs, duration);
  if (memory_->second_thought && memory_->second_thought->is_active())
    memory_->second_thought->predict(inputs, duration);
  if (blind_->is_active && !is_blind_) predict_blind(believed_input_.data(), duration);
}

/// Without knowing the inputs. They stay what they are for about as long as it takes from one position to the next:
/// over that they count as one, however many samples of quicker sensors come meanwhile.
void SensorJudge::predict_blind(const double* inputs, double duration) noexcept {
  const double times = position_interval() / std::min(duration, setup_.step);
  if (!(times > 1.0) || !std::isfinite(times)) {
    blind_->filter.predict(inputs, duration);
    return;
  }
  for (std::size_t j = 0; j < memory_->unknown_sigmas.size(); ++j)
    memory_->more_sigmas[j] = memory_->unknown_sigmas[j] * std::sqrt(times - 1.0);
  blind_->filter.predict(inputs, duration, memory_->more_sigmas.data());
}

/// From one position to the next, of the quickest receiver [s]; infinite: not known.
double SensorJudge::position_interval() const noexcept {
  double quickest = infinity;
  for (int j = 0; j < static_cast<int>(raw_.size()); ++j)
    if (sees_position(j)) quickest = std::fmin(quickest, memory_->loss->usual_interval(j));
  return quickest;
}

/// Keeps what was known after the last samples, and the mean input since then.
void SensorJudge::note_motion(double duration, const double* inputs) noexcept {
  Memory& memory = *memory_;
  if (!std::exchange(memory.has_advanced, true)) {
    copy_numbers(own_->filter.mean(), memory.before_mean);
    copy_numbers(own_->filter.covariance(), memory.before_covariance);
    memory.duration = 0.0;
    std::fill(input_.begin(), input_.end(), Memory::unknown);
  }
  PastMoments::add_to_mean(duration, inputs, memory.duration, input_);
  memory.past->advance(duration, inputs);
}

/// Values of the present sample, with their weights.
Measured SensorJudge::weighed(const double* outputs) const noexcept {
  return {outputs, raw_weights_.empty() ? nullptr : raw_weights_.data()};
}

bool SensorJudge::is_expected(std::size_t sensor) const noexcept {
  return std::ranges::any_of(sensors_[sensor].outputs, [&](int j) { return memory_->loss->is_expected(j); });
}

/// Whether a sensor has been measured lately, before the present sample or in it.
bool SensorJudge::is_heard(std::size_t sensor) const noexcept {
  const double usual = memory_->loss->usual_interval(sensors_[sensor].outputs.front());
  return !std::isnan(heard_[sensor]) && !Memory::is_gap(memory_->now - heard_[sensor], usual);
}

/// Which sensors have come, or were to come. What is counted in samples counts those of the position, if there is one:
/// a quick sensor beside it says little, however often.
void SensorJudge::note_sample(double time, const double* outputs) noexcept {
  memory_->now = time;
  memory_->loss->note(time, outputs);
  bool has_position = false, is_position = false;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (!sees_position(sensors_[s].outputs)) continue;
    has_position = true;
    is_position = is_position || is_expected(s);
  }
  memory_->is_counted = is_position || !has_position;
}

/// All sensors pass that were disputed. One of which nothing was said: either slip explains that better, or what was
/// held was wrong.
void SensorJudge::agree() noexcept {
  const bool is_slip = slip_->is_active && fits(slip_->filter, raw_.data()) &&
                       likelihood(slip_->filter, raw_.data()) > likelihood(own_->filter, raw_.data());
  for (std::size_t s = 0; memory_->was_open && !is_slip && s < sensors_.size(); ++s) {
    const auto was_held = [&](int j) { return held_count_ > 0 && !std::isnan(held_[0].outputs[j]); };
    if (std::ranges::none_of(sensors_[s].outputs, was_held)) continue;
    states_[s].reasons |= reason::rejected;
    quiet_[s] = calm_samples_ = 0;
  }
  end_dispute();
}

/// Slip that measurements want beyond its bounds again and again is not what is wrong: an offset that was taken out of
/// what is measured may be, or a measured input, or the heading. Whether the estimate goes on from elsewhere.
SensorJudge::Finding SensorJudge::doubt_bounds(bool is_disputed, bool is_placed) noexcept {
  WalkingFilter& filter = own_->filter;
  double& beyond = memory_->beyond_bounds;
  beyond += Memory::slip_beyond_bounds(filter, memory_->before_update, setup_.noise);
  if (beyond > 0.0)
    beyond -= memory_->is_counted ? usually_beyond : at_its_bound * std::min(1.0, Memory::usual_change_of_slip(filter));
  beyond = std::min(std::max(beyond, 0.0), 2.0 * impossibly_beyond);
  bool has_changed = false;
  if (beyond > impossibly_beyond) {
    if (is_placed && distrust_instead()) {
      beyond = 0.0;
      return slip_is_new;
    }
    input_findings_ |= reason::implausible;
    if (!is_disputed && memory_->offsets->has_recent()) {
      // What seemed to be off was right, and slip was not.
      memory_->offsets->withdraw_recent(filter);
      end_dispute();
      beyond = 0.0;
      has_changed = true;
    }
  }
  memory_->impossible_samples = beyond > impossibly_beyond ? memory_->impossible_samples + is_placed : 0;
  if (memory_->search && !is_disputed && memory_->impossible_samples > Memory::hopeless * setup_.proof) {
    // Of a vehicle that heads elsewhere measurements ask for slip that cannot be, again and again.
    memory_->impossible_samples = 0;
    beyond = 0.0;
    filter.restart_parameters(setup_.parameter_sigmas);
    search_from(filter, *memory_->search, raw_.data());
    memory_->offsets->forget_onsets();
    end_dispute();
    has_changed = true;
  }
  return {.rebase = has_changed};
}

/// Each sensor by what the estimate expects of it; what does not pass is not used, and disputed.
SensorJudge::Finding SensorJudge::judge_each(double time, double* outputs) noexcept {
  WalkingFilter& filter = own_->filter;
  const int counted = memory_->is_counted;
  Finding finding;
  bool is_disputed = false, is_any_measured = false, is_placed = false, is_back = true;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    const bool has_room = innovation_count_ < static_cast<int>(innovations_.size());
    Innovation& innovation = has_room ? innovations_[innovation_count_] : scratch_;
    if (!filter.innovation(sensors_[s], weighed(outputs), innovation)) continue;
    memory_->offsets->widen(filter, sensors_[s], outputs, innovation);
    innovation_count_ += has_room;
    is_any_measured = true;
    innovation.time = time;
    innovation.sensor = static_cast<int>(s);
    innovation.accepted = admits(s, innovation);
    heard_[s] = time;
    if (innovation.accepted) {
      ++states_[s].accepted;
      if (setup_.whiteness) memory_->correlated->take(filter, s, sensors_[s], innovation);
      is_placed = is_placed || sees_position(sensors_[s].outputs);
      continue;
    }
    is_disputed = true;
    is_back = is_back && records_[s].after_gap && records_[s].failures == 1;
    findings_[s] |= reason::rejected;
    ++states_[s].rejected;
    for (const int j : sensors_[s].outputs) outputs[j] = Memory::unknown;
  }
  if (is_blind_) test_inputs(raw_.data());
  test_doubted();
  if (is_placed || unplaced_samples_ == 0) memory_->unplaced_from = time;
  unplaced_samples_ = is_placed ? 0 : unplaced_samples_ + (is_disputed && counted);
  const int told = is_disputed ? offset_in_dispute() : -1;
  if (is_disputed && end_offset()) {
    filter.update(weighed(outputs));
    end_dispute();
    finding.rebase = true;
  } else if (is_disputed) {
    if (is_disputed_ && is_back) end_dispute();
    finding = settle(time, outputs);
  } else if (is_disputed_ && std::ranges::any_of(records_, [](const Record& each) { return each.failures > 0; })) {
    // What is disputed was not measured.
    for (Hypothesis* each : {slip_.get(), edge_.get(), moved_.get(), back_.get(), blind_.get()})
      if (each->is_active) confront(*each, raw_.data(), false);
    if (memory_->double_fault->is_active) confront(*memory_->double_fault, not_accused(), false);
  } else if (is_any_measured) {
    if (is_disputed_) agree();
    for (std::size_t j = 0; j < input_.size() && !is_blind_; ++j)
      if (!std::isnan(input_[j])) believed_input_[j] = input_[j];
  }
  memory_->loss->update(filter, weighed(outputs), memory_->is_counted);
  if (!finding.rebase && !finding.release) {
    copy_numbers(filter.mean(), memory_->before_update);
    filter.update_as_expected(weighed(outputs));
    const Finding doubt = doubt_bounds(is_disputed, is_placed);
    if (doubt.release) return doubt;
    finding.rebase = doubt.rebase;
    memory_->offsets->take(filter, std::max(1.0, *std::ranges::max_element(excesses_)),
                           memory_->correlated->by_output(), memory_->is_counted);
    const bool is_told = told >= 0 && memory_->offsets->probable() == told;
    // While a position is disputed it is not known yet who is wrong, which is for others to find out.
    const bool is_open = is_disputed_ && is_place_disputed();
    const bool is_found = !is_disputed && !is_open && memory_->offsets->has_suspect();
    if (distrust_again()) return slip_is_new;
    if (is_found && distrust_receiver()) return {.rebase = true};
    if (is_told) {
      memory_->offsets->adopt_candidate(filter);
      std::fill(records_.begin(), records_.end(), Record{});
    } else if (is_found) {
      memory_->offsets->adopt_suspected(filter);
    }
    const bool has_jumped = !is_told && !is_found && follow_biases(filter);
    if (is_told || is_found || has_jumped) {
      end_dispute();
      finding.rebase = true;
    }
  }
  return finding;
}

SensorJudge::Finding SensorJudge::judge(double time, double* outputs, const double* weights) noexcept {
  memory_->has_advanced = false;
  note_sample(time, outputs);
  const int counted = memory_->is_counted;
  if (memory_->since_release < std::numeric_limits<int>::max()) memory_->since_release += counted;
  std::fill(findings_.begin(), findings_.end(), 0u);
  held_count_ = is_disputed_ ? held_count_ : 0;
  Finding finding;
  raw_weights_.assign(weights, weights ? weights + raw_.size() : nullptr);
  memory_->offsets->correct(outputs);
  if (is_searching()) {
    finding = search_heading(outputs);
  } else if (is_active_) {
    own_->filter.expect();
    find_stuck(outputs);
    const bool is_open = is_heading_open(own_->filter, weighed(outputs));
    std::copy_n(outputs, raw_.size(), raw_.data());
    finding = is_open ? open_heading(time, outputs) : judge_each(time, outputs);
    // The estimator's own knowledge of the motion is wrong.
    if (is_blind_ || is_unobserved_) finding = {.rebase = true};
    is_unobserved_ = false;
    if (finding.rebase) begin_anew(outputs);
    // On new ground slip would not be known, either.
    if (finding.release) memory_->loss->end();
    if (finding.release) std::copy(raw_.begin(), raw_.end(), outputs);
    note_corrected(finding.rebase || finding.release);
    remember(time, outputs);
  }
  if (!is_active_) finding = place_start(outputs, weights);
  note_offsets();
  if (is_blind_) input_findings_ |= reason::rejected;
  // A measured input that is off, as by slip that a model does not have, is known from then on: it is said, and all
  // else agrees without that. Until it was found it did not, nor does it where it is off no longer.
  const bool is_input_off = (input_findings_ & reason::off) != 0;
  const bool is_known = is_input_off == memory_->was_input_off;
  memory_->was_input_off = is_input_off;
  bool is_calm = is_known && (input_findings_ & ~reason::off) == 0;
  const bool is_open = is_probably_slip();
  memory_->was_open = is_open;
  memory_->undisputed_samples = is_disputed_ ? 0 : std::min(memory_->undisputed_samples + counted, setup_.calm);
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (is_open && findings_[s] == reason::rejected) continue;
    // So is a sensor that is off by no more than what is stated of its noise.
    const bool is_minor = findings_[s] == reason::off && is_minor_offset(s);
    is_calm = is_calm && (findings_[s] == 0 || (is_minor && memory_->was_minor[s] != 0));
    memory_->was_minor[s] = is_minor;
    quiet_[s] = findings_[s] ? 0 : quiet_[s] + is_expected(s);
    if (findings_[s]) states_[s].reasons = findings_[s] | (states_[s].reasons & reason::moved);
  }
  calm_samples_ = is_calm ? calm_samples_ + counted : 0;
  const bool are_inputs_found = (input_findings_ & ~reason::off) != 0 || (is_input_off && !is_known);
  quiet_inputs_ = are_inputs_found ? 0 : quiet_inputs_ + counted;
  if (are_inputs_found) inputs_.reasons = input_findings_;
  forget_reasons();
  input_findings_ = 0;
  if (is_blind_ || (inputs_.reasons & reason::rejected) == 0) doubted_input_ = -1;
  return finding;
}

/// What sensors and inputs were doubted for is forgotten once they have been quiet, but not all of it before the
/// estimate is calm: one that is quick is quiet after fewer samples that count.
void SensorJudge::forget_reasons() noexcept {
  const auto is_over = [&](std::size_t s) {
    const bool has_moved = (states_[s].reasons & reason::moved) != 0;
    return quiet_[s] >= (has_moved && !memory_->was_return ? setup_.calm_after_moving : setup_.calm);
  };
  const bool are_inputs_over = quiet_inputs_ >= setup_.calm;
  bool is_any_left = calm_samples_ >= setup_.calm || (inputs_.reasons != 0 && !are_inputs_over);
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    is_any_left = is_any_left || (states_[s].reasons != 0 && !is_over(s));
  for (std::size_t s = 0; s < sensors_.size() && is_any_left; ++s)
    if (is_over(s)) states_[s].reasons = 0;
  if (calm_samples_ >= setup_.calm || (is_any_left && are_inputs_over)) inputs_.reasons = input_findings_ & reason::off;
}

/// Sensors whose values are off by what is known, and taken out of them.
void SensorJudge::note_offsets() noexcept {
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    states_[s].offset = 0.0;
    states_[s].rival = -1;
    for (const int j : sensors_[s].outputs) {
      const double offset = memory_->offsets->offset(j);
      if (offset == 0.0) continue;
      states_[s].offset = sensors_[s].outputs.size() == 1 ? offset : std::hypot(states_[s].offset, offset);
      states_[s].rival = sensor_of(memory_->offsets->rival(j), sensors_);
    }
    if (states_[s].offset != 0.0) findings_[s] |= reason::off;
  }
  inputs_.offset = 0.0;
  off_input_ = -1;
  const std::vector<Variable>& about = own_->filter.model().description().inputs;
  for (std::size_t j = 0; j < about.size(); ++j) {
    const double offset = memory_->offsets->input_offset(static_cast<int>(j));
    const bool is_worst =
        off_input_ < 0 || std::abs(offset) / about[j].scale >
                              std::abs(inputs_.offset) / about[static_cast<std::size_t>(off_input_)].scale;
    if (offset == 0.0 || !is_worst) continue;
    inputs_.offset = offset;
    off_input_ = static_cast<int>(j);
    input_findings_ |= reason::off;
  }
}

/// Whether all that a sensor is off by, to be taken out, is within the noise that is stated of it.
bool SensorJudge::is_minor_offset(std::size_t sensor) const noexcept {
  const SensorHealth& state = states_[sensor];
  if (state.offset == 0.0 || state.rival >= 0) return false;
  return std::ranges::all_of(sensors_[sensor].outputs, [&](int j) {
    const double offset = memory_->offsets->offset(j);
    return offset * offset <= setup_.noise.output_variances[static_cast<std::size_t>(j)];
  });
}

/// What is expected of the outputs, now that they have been used; after a small step, to first order.
void SensorJudge::note_corrected(bool has_jumped) noexcept {
  WalkingFilter& filter = own_->filter;
  const int states = filter.model().state_count();
  if (has_jumped) filter.expect();
  for (int j = 0; j < static_cast<int>(raw_.size()); ++j) {
    double expected = filter.expected(j);
    for (int i = 0; i < states && !has_jumped; ++i)
      expected += filter.derivative(j, i) * (filter.mean()[i] - memory_->before_update[i]);
    memory_->stuck.corrected(static_cast<std::size_t>(j), expected);
    memory_->expected[static_cast<std::size_t>(j)] = expected;
  }
}

/// `outputs`: that were used.
void SensorJudge::remember(double time, const double* outputs) noexcept {
  Memory& memory = *memory_;
  bool has_position = false;
  MeasuredOutputs& rejected = memory.replayed;
  rejected.assign(weighed(raw_.data()));
  rejected.remove(outputs);
  for (std::size_t j = 0; j < raw_.size(); ++j) {
    if (!sees_position(static_cast<int>(j))) {
      rejected.values()[j] = Memory::unknown;
      continue;
    }
    has_position = has_position || !std::isnan(raw_[j]);
  }
  const double quickest = position_interval();
  const bool is_known = std::isfinite(quickest);
  memory.recent->join_within(is_known ? std::min(setup_.step, quickest / Memory::most_between_positions) : 0.0);
  memory.contradicting.clear();
  if (!memory.contradictions.empty()) {
    memory.contradicting.assign(weighed(raw_.data()));
    std::fill_n(memory.contradicting.values(), raw_.size(), Memory::unknown);
  }
  for (const Contradiction& each : memory.contradictions)
    for (const int j : sensors_[each.sensor].outputs)
      memory.contradicting.values()[j] = raw_[static_cast<std::size_t>(j)] + memory.offsets->offset(j);
  memory.recent->remember(time, own_->filter, memory.expected, weighed(outputs),
                          {.rejected = rejected.measured(), .contradicting = memory.contradicting.measured()},
                          has_position);
  memory.past->note(time, own_->filter);
}

}  // namespace rhec
