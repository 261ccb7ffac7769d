#include "rhec/core/estimation/sensor_watch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "heading_search.hpp"
#include "rhec/core/base/error.hpp"
#include "stuck_values.hpp"
#include "walking_filter.hpp"

namespace rhec {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t innovation_capacity = 256, held_capacity = 32, remembered_samples = 64;
// A heading that is less certain is still being searched [rad].
constexpr double known_heading = 0.35;
// In typical magnitudes, what a measured input cannot be.
constexpr double impossible_input = 20.0;
// In typical magnitudes, how far off a state can be that a sensor sees after it has moved.
constexpr double displacement = 100.0;
// Samples in a row that measured inputs must fit before they are believed again.
constexpr int trusted_again = 3;
// Disputes longer than this many times the proof mean that nothing explains the sensors.
constexpr int hopeless = 3;
// After so many failures in a row a sensor is suspect: it then has to pass a closer gate, so many times in a row.
constexpr int suspect_after = 3, passes_of_suspects = 2;
constexpr double close_gate = 3.0;
// Silence after which a sensor that disagrees is more likely right than the estimate [s].
constexpr double longest_gap = 1.0;
// A real receiver's errors may be far larger than its noise says, and not Gaussian at all: its gate is as much wider as
// its squared innovations have been over some five hundred samples, of which none counts more than this many times what
// was expected, and those of one that is suspect not at all.
constexpr double most_excess = 100.0, excess_memory = 500.0;
// Samples of a dispute within which slip may have jumped.
constexpr int fresh = 2;
// A hypothesis that has explained so many samples in a row has learnt how the vehicle moves.
constexpr int informed = 4;
// A search that has not explained anything for so long begins anew.
constexpr int stale = 3;

WalkingFilter::Setup filter_setup(const SensorWatch::Setup& setup) {
  return {.noise = setup.noise,
          .walk = setup.walk,
          .has_ramps = setup.has_ramps,
          .step = setup.step,
          .substeps = setup.substeps};
}

/// Inputs count as typical motion: what is measured of them says nothing.
WalkingFilter::Setup blind_setup(const Model& model, const SensorWatch::Setup& setup) {
  WalkingFilter::Setup blind = filter_setup(setup);
  const std::vector<Variable>& inputs = model.description().inputs;
  const std::size_t measured = inputs.size() - model.description().noisy_states.size();
  for (std::size_t j = 0; j < measured; ++j)
    blind.noise.input_variances[j] = std::max(blind.noise.input_variances[j], inputs[j].scale * inputs[j].scale);
  return blind;
}

}  // namespace

/// A filter, and how long what it assumes has explained the measurements.
struct SensorWatch::Hypothesis {
  WalkingFilter filter;
  bool is_active = false;
  int explained = 0, refuted = 0;
  bool is_informed = false;  ///< it has explained much before it was refuted
};

/// What was known after the last samples, and the motion since then.
struct SensorWatch::Memory {
  struct Entry {
    double time = unknown;
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    std::vector<double> inputs;
  };
  std::vector<Entry> entries{remembered_samples};
  std::size_t newest = 0;
  std::int64_t count = 0;
  // Before the last advance, and that.
  Eigen::VectorXd before_mean;
  Eigen::MatrixXd before_covariance;
  double duration = 0.0;
  bool has_advanced = false;  ///< since the last samples
  bool was_calm = true;       ///< health was ok when the dispute began
  StuckValues stuck;
  std::unique_ptr<WalkingFilter> trial;   ///< for what is tried within one call
  std::unique_ptr<HeadingSearch> search;  ///< null for a vehicle without a heading
  /// The same, of a heading that may be wrong, while it is not known who is.
  std::unique_ptr<HeadingSearch> second_thought;
  int in_vain = 0;  ///< samples in a row that it has not explained
};

SensorWatch::SensorWatch(std::shared_ptr<const Model> model, const Setup& setup)
    : setup_(setup), sensors_(sensors_of(model->description(), setup.noise.output_variances)) {
  const auto np = static_cast<std::size_t>(model->parameter_count());
  if (setup_.walk.size() != np || setup_.parameter_sigmas.size() != np)
    throw Error(fmt::format("sensor watch: {} walks and {} standard deviations of parameters; expected {} of each",
                            setup_.walk.size(), setup_.parameter_sigmas.size(), np));
  for (int degrees = 0; degrees <= most_sensor_outputs; ++degrees) {
    limits_.push_back(degrees ? chi_square_limit(degrees, setup_.gate) : 0.0);
    close_limits_.push_back(degrees ? chi_square_limit(degrees, std::min(setup_.gate, close_gate)) : 0.0);
  }
  const auto make = [&](const WalkingFilter::Setup& filter) {
    return std::make_unique<Hypothesis>(Hypothesis{WalkingFilter(model, filter)});
  };
  own_ = make(filter_setup(setup_));
  slip_ = make(filter_setup(setup_));
  moved_ = make(filter_setup(setup_));
  blind_ = make(blind_setup(*model, setup_));
  memory_ = std::make_unique<Memory>();
  memory_->stuck = StuckValues(setup_.noise.output_variances);
  memory_->trial = std::make_unique<WalkingFilter>(model, filter_setup(setup_));
  if (model->description().roles.heading >= 0)
    for (auto* each : {&memory_->search, &memory_->second_thought})
      *each = std::make_unique<HeadingSearch>(model, filter_setup(setup_), close_gate);
  const Eigen::Index n = own_->filter.mean().size();
  memory_->before_mean = Eigen::VectorXd::Zero(n);
  memory_->before_covariance = Eigen::MatrixXd::Zero(n, n);
  for (Memory::Entry& entry : memory_->entries) {
    entry.mean = memory_->before_mean;
    entry.covariance = memory_->before_covariance;
    entry.inputs.assign(model->input_count(), 0.0);
  }
  raw_.assign(model->output_count(), unknown);
  input_.assign(model->input_count(), 0.0);
  believed_input_ = input_;
  held_.assign(held_capacity, {0.0, raw_});
  innovations_.resize(innovation_capacity);
  reset();
}

SensorWatch::~SensorWatch() = default;

const Eigen::VectorXd& SensorWatch::mean() const noexcept { return own_->filter.mean(); }
const Eigen::MatrixXd& SensorWatch::covariance() const noexcept { return own_->filter.covariance(); }

void SensorWatch::reset() noexcept {
  is_active_ = is_blind_ = false;
  end_dispute();
  states_.assign(sensors_.size(), {});
  findings_.assign(sensors_.size(), 0);
  quiet_.assign(sensors_.size(), 0);
  records_.assign(sensors_.size(), {});
  excesses_.assign(sensors_.size(), 1.0);
  heard_.assign(sensors_.size(), unknown);
  is_unobserved_ = false;
  if (memory_->search) memory_->search->cancel();
  inputs_ = {};
  input_findings_ = 0;
  calm_samples_ = setup_.calm;
  held_count_ = innovation_count_ = 0;
  memory_->count = 0;
  memory_->has_advanced = false;
  memory_->stuck.reset();
  std::fill(believed_input_.begin(), believed_input_.end(), 0.0);
}

void SensorWatch::restart(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  own_->filter.mean() = mean;
  own_->filter.covariance() = covariance;
  is_active_ = true;
  is_blind_ = false;
  if (memory_->search) memory_->search->cancel();
  end_dispute();
  memory_->count = 0;
  memory_->has_advanced = false;
}

void SensorWatch::clean_inputs(double* inputs) noexcept {
  const std::vector<Variable>& about = own_->filter.model().description().inputs;
  const std::size_t measured = about.size() - own_->filter.model().description().noisy_states.size();
  for (std::size_t j = 0; j < measured; ++j) {
    const double room = 0.5 * (about[j].upper - about[j].lower), far = impossible_input * about[j].scale;
    const double lower = std::isfinite(room) ? about[j].lower - room : -far,
                 upper = std::isfinite(room) ? about[j].upper + room : far;
    if (std::isnan(inputs[j]) || (inputs[j] >= lower && inputs[j] <= upper)) continue;
    inputs[j] = unknown;
    input_findings_ |= reason::implausible;
    ++inputs_.rejected;
  }
}

void SensorWatch::advance(double duration, const double* inputs, const double* more_sigmas) noexcept {
  if (!is_active_) return;
  if (more_sigmas) {
    // Nobody knows how the vehicle has moved: what follows starts from here.
    if (!is_unobserved_) {
      memory_->before_mean = own_->filter.mean();
      memory_->before_covariance = own_->filter.covariance();
    }
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
  note_motion(duration, inputs);
  if (memory_->count > 0) std::copy(input_.begin(), input_.end(), memory_->entries[memory_->newest].inputs.begin());
  if (is_blind_) {
    blind_->filter.mean() = own_->filter.mean();
    blind_->filter.covariance() = own_->filter.covariance();
    blind_->filter.predict(believed_input_.data(), duration);
    own_->filter.mean() = blind_->filter.mean();
    own_->filter.covariance() = blind_->filter.covariance();
  } else {
    own_->filter.predict(inputs, duration);
  }
  if (!is_disputed_) return;
  if (slip_->is_active) slip_->filter.predict(inputs, duration);
  if (moved_->is_active) moved_->filter.predict(inputs, duration);
  if (memory_->second_thought && memory_->second_thought->is_active())
    memory_->second_thought->predict(inputs, duration);
  if (blind_->is_active && !is_blind_) blind_->filter.predict(believed_input_.data(), duration);
}

/// Keeps what was known after the last samples, and the mean input since then.
void SensorWatch::note_motion(double duration, const double* inputs) noexcept {
  Memory& memory = *memory_;
  if (!std::exchange(memory.has_advanced, true)) {
    memory.before_mean = own_->filter.mean();
    memory.before_covariance = own_->filter.covariance();
    memory.duration = 0.0;
    std::fill(input_.begin(), input_.end(), unknown);
  }
  memory.duration += duration;
  const double share = memory.duration > 0.0 ? duration / memory.duration : 1.0;
  for (std::size_t j = 0; j < input_.size(); ++j) {
    if (std::isnan(inputs[j])) continue;
    input_[j] = std::isnan(input_[j]) ? inputs[j] : input_[j] + share * (inputs[j] - input_[j]);
  }
}

SensorWatch::Finding SensorWatch::judge(double time, double* outputs) noexcept {
  memory_->has_advanced = false;
  std::fill(findings_.begin(), findings_.end(), 0u);
  held_count_ = is_disputed_ ? held_count_ : 0;
  Finding finding;
  if (is_searching()) {
    finding = search_heading(outputs);
  } else if (is_active_) {
    WalkingFilter& filter = own_->filter;
    filter.expect();
    find_stuck(outputs);
    std::copy_n(outputs, raw_.size(), raw_.data());
    bool is_disputed = false, is_any_measured = false;
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      const bool has_room = innovation_count_ < static_cast<int>(innovations_.size());
      Innovation& innovation = has_room ? innovations_[innovation_count_] : scratch_;
      if (!filter.innovation(sensors_[s], outputs, innovation)) continue;
      innovation_count_ += has_room;
      is_any_measured = true;
      innovation.time = time;
      innovation.sensor = static_cast<int>(s);
      innovation.accepted = admits(s, innovation);
      heard_[s] = time;
      if (innovation.accepted) {
        ++states_[s].accepted;
        continue;
      }
      is_disputed = true;
      findings_[s] |= reason::rejected;
      ++states_[s].rejected;
      for (const int j : sensors_[s].outputs) outputs[j] = unknown;
    }
    if (is_blind_) test_inputs(raw_.data());
    if (is_disputed) {
      finding = settle(time, outputs);
    } else if (is_disputed_ && std::ranges::any_of(records_, [](const Record& each) { return each.failures > 0; })) {
      // What is disputed was not measured.
      for (Hypothesis* each : {slip_.get(), moved_.get(), blind_.get()})
        if (each->is_active) confront(*each, raw_.data(), false);
    } else if (is_any_measured) {
      if (is_disputed_) end_dispute();
      for (std::size_t j = 0; j < input_.size() && !is_blind_; ++j)
        if (!std::isnan(input_[j])) believed_input_[j] = input_[j];
    }
    if (!finding.rebase && !finding.release) filter.update(outputs);
    // The estimator's own knowledge of the motion is wrong.
    if (is_blind_ || is_unobserved_) finding = {.release = false, .rebase = true};
    is_unobserved_ = false;
    if (finding.rebase) start_search(outputs);
    if (finding.release) std::copy(raw_.begin(), raw_.end(), outputs);
    filter.expect();
    for (std::size_t j = 0; j < raw_.size(); ++j) memory_->stuck.corrected(j, filter.expected(static_cast<int>(j)));
    remember(time);
  }
  if (is_blind_) input_findings_ |= reason::rejected;
  bool is_calm = input_findings_ == 0;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    is_calm = is_calm && findings_[s] == 0;
    quiet_[s] = findings_[s] ? 0 : quiet_[s] + 1;
    if (findings_[s]) states_[s].reasons = findings_[s] | (states_[s].reasons & reason::moved);
    const bool has_moved = (states_[s].reasons & reason::moved) != 0;
    if (quiet_[s] >= (has_moved ? setup_.calm_after_moving : setup_.calm)) states_[s].reasons = 0;
  }
  calm_samples_ = is_calm ? calm_samples_ + 1 : 0;
  if (input_findings_) inputs_.reasons = input_findings_;
  if (calm_samples_ >= setup_.calm) inputs_.reasons = 0;
  input_findings_ = 0;
  return finding;
}

/// Whether a sensor's measurement may be used. One that has failed for some time must agree well, and twice: the filter
/// without it knows less and less, so that a gate opens by itself.
bool SensorWatch::admits(std::size_t sensor, const Innovation& innovation) noexcept {
  Record& record = records_[sensor];
  const bool is_suspect = record.failures >= suspect_after;
  const auto degrees = static_cast<double>(innovation.value.size());
  const bool passes = innovation.nis <= limit(sensor, innovation.value.size());
  double& excess = excesses_[sensor];
  if (record.failures < suspect_after)
    excess += (std::min(innovation.nis / degrees, most_excess) - excess) / excess_memory;
  if (!passes) {
    if (record.failures == 0) record.after_gap = innovation.time - heard_[sensor] > longest_gap;
    ++record.failures;
    record.passes = 0;
    return false;
  }
  ++record.passes;
  if (is_suspect && record.passes < passes_of_suspects) return false;
  record = {};
  return true;
}

bool SensorWatch::is_searching() const noexcept { return memory_->search && memory_->search->is_active(); }

/// A heading that has become unknown is searched once the position is measured again.
void SensorWatch::start_search(const double* outputs) noexcept {
  if (!memory_->search) return;
  const Roles& roles = own_->filter.model().description().roles;
  const int h = roles.heading;
  const bool is_unknown = own_->filter.covariance()(h, h) > known_heading * known_heading;
  bool is_placed = false;
  for (int j = 0; j < static_cast<int>(raw_.size()); ++j)
    is_placed = is_placed || (!std::isnan(outputs[j]) && own_->filter.depends_on(j, roles.position_x));
  if (!is_unknown || !is_placed) return;
  // What a position says of slip, through a motion that nobody knows, is nothing: slip is as it was before. Nor do
  // correlations of what was far too uncertain to be linearised mean anything.
  WalkingFilter& filter = own_->filter;
  const Eigen::Index np = filter.model().parameter_count(), nx = filter.mean().size() - np;
  filter.mean().tail(np) = memory_->before_mean.tail(np);
  for (Eigen::Index j = nx; j < nx + np; ++j) filter.covariance()(j, j) = memory_->before_covariance(j, j);
  search_from(filter, *memory_->search);
}

/// Starts a search from what a filter knows of each variable by itself.
void SensorWatch::search_from(WalkingFilter& filter, HeadingSearch& search) noexcept {
  for (Eigen::Index c = 0; c < filter.mean().size(); ++c)
    for (Eigen::Index r = 0; r < filter.mean().size(); ++r)
      if (r != c) filter.covariance()(r, c) = 0.0;
  search.start(filter.mean(), filter.covariance());
}

/// All measurements are used: there is nothing that they could be judged by. Found or not, the best heading so far is
/// the estimate.
SensorWatch::Finding SensorWatch::search_heading(const double* outputs) noexcept {
  memory_->search->update(sensors_, outputs);
  own_->filter.mean() = memory_->search->best().mean();
  own_->filter.covariance() = memory_->search->best().covariance();
  return {.release = false, .rebase = true};
}

/// Largest nu' S^-1 nu of a sensor.
double SensorWatch::limit(std::size_t sensor, Eigen::Index degrees) const noexcept {
  const bool is_suspect = records_[sensor].failures >= suspect_after;
  const double usual = std::max(1.0, excesses_[sensor]) * limits_[static_cast<std::size_t>(degrees)];
  return is_suspect ? close_limits_[static_cast<std::size_t>(degrees)] : usual;
}

/// Takes out sensors that give the same values again and again.
void SensorWatch::find_stuck(double* outputs) noexcept {
  for (std::size_t j = 0; j < raw_.size(); ++j)
    memory_->stuck.take(j, outputs[j], own_->filter.expected(static_cast<int>(j)));
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    const std::vector<int>& all = sensors_[s].outputs;
    if (std::none_of(all.begin(), all.end(), [&](int j) { return memory_->stuck.is_stuck(j); })) continue;
    findings_[s] |= reason::stuck;
    ++states_[s].rejected;
    for (const int j : all) outputs[j] = unknown;
  }
}

void SensorWatch::start(Hypothesis& hypothesis) noexcept {
  hypothesis.is_active = true;
  hypothesis.explained = 0;
  hypothesis.filter.mean() = memory_->before_mean;
  hypothesis.filter.covariance() = memory_->before_covariance;
  if (&hypothesis == slip_.get()) {
    for (std::size_t j = 0; j < setup_.parameter_sigmas.size(); ++j)
      slip_->filter.restart_parameter(static_cast<int>(j), setup_.parameter_sigmas[j]);
    slip_->filter.predict(input_.data(), memory_->duration);
  } else {
    blind_->filter.predict(believed_input_.data(), memory_->duration);
  }
}

/// The states that disputed sensors see are known anew: the position if it is among them, else all of them. One that
/// has followed the sensor for some time, until it jumped again, knows more of heading and slip than the estimate,
/// which has gone on without.
void SensorWatch::start_moved() noexcept {
  WalkingFilter& filter = moved_->filter;
  moved_->is_active = true;
  moved_->explained = 0;
  const ModelDescription& about = filter.model().description();
  if (!moved_->is_informed) {
    filter.mean() = own_->filter.mean();
    filter.covariance() = own_->filter.covariance();
  }
  const auto is_position = [&](int i) { return i == about.roles.position_x || i == about.roles.position_y; };
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (!(findings_[s] & reason::rejected)) continue;
    for (const int j : sensors_[s].outputs) {
      const bool sees_position = (about.roles.position_x >= 0 && own_->filter.depends_on(j, about.roles.position_x)) ||
                                 (about.roles.position_y >= 0 && own_->filter.depends_on(j, about.roles.position_y));
      for (int i = 0; i < filter.model().state_count(); ++i) {
        if (!own_->filter.depends_on(j, i) || (sees_position && !is_position(i))) continue;
        const double error = std::isnan(raw_[j]) ? 0.0 : 3.0 * std::abs(raw_[j] - own_->filter.expected(j));
        const double sigma =
            about.states[i].is_angle ? std::numbers::pi : std::max(displacement * about.states[i].scale, error);
        filter.covariance()(i, i) = std::max(filter.covariance()(i, i), sigma * sigma);
      }
    }
  }
}

/// Whether all measurements pass their gates.
bool SensorWatch::fits(WalkingFilter& filter, const double* outputs) noexcept {
  filter.expect();
  bool fits = true;
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (filter.innovation(sensors_[s], outputs, scratch_))
      fits = fits && scratch_.nis <= limit(s, scratch_.value.size());
  return fits;
}

void SensorWatch::confront(Hypothesis& hypothesis, const double* outputs, bool counts) noexcept {
  if (!fits(hypothesis.filter, outputs)) {
    hypothesis.is_informed = hypothesis.explained >= informed;
    hypothesis.is_active = false;
    hypothesis.explained = 0;
    ++hypothesis.refuted;
    return;
  }
  hypothesis.filter.update(outputs);
  hypothesis.explained += counts;
}

/// A disputed position can be followed only if nothing else says where the vehicle is.
bool SensorWatch::may_follow() const noexcept {
  const Roles& roles = own_->filter.model().description().roles;
  bool is_position_disputed = false, is_any_undisputed = false;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    bool sees_position = false, is_measured = false;
    for (const int j : sensors_[s].outputs) {
      sees_position = sees_position || (roles.position_x >= 0 && own_->filter.depends_on(j, roles.position_x));
      is_measured = is_measured || !std::isnan(raw_[j]);
    }
    if (!is_measured) continue;
    const bool is_rejected = (findings_[s] & reason::rejected) != 0;
    is_position_disputed = is_position_disputed || (sees_position && is_rejected);
    is_any_undisputed = is_any_undisputed || (!is_rejected && (sees_position || !is_position_disputed));
    if (sees_position && !is_rejected) return false;
  }
  return is_position_disputed || !is_any_undisputed;
}

SensorWatch::Finding SensorWatch::settle(double time, const double* outputs) noexcept {
  if (!is_disputed_) memory_->was_calm = calm_samples_ >= setup_.calm;
  is_disputed_ = true;
  ++disputed_samples_;
  const auto consider = [&](Hypothesis& hypothesis) {
    const bool is_new = !hypothesis.is_active;
    if (is_new && &hypothesis == moved_.get()) start_moved();
    if (is_new && &hypothesis != moved_.get()) start(hypothesis);
    if (is_new && &hypothesis == slip_.get()) held_count_ = 0;
    confront(hypothesis, raw_.data(), true);
  };
  consider(*slip_);
  consider(*moved_);
  think_again();
  if (!is_blind_) consider(*blind_);
  // Slip that has jumped shows from the first sample on. Later the filter without the sensor knows so little that new
  // slip explains nearly anything.
  const bool has_begun_with_it = disputed_samples_ - slip_->explained < fresh;
  if (slip_->explained >= (has_begun_with_it ? setup_.slip_proof : setup_.proof)) {
    Finding finding = accept(*slip_);
    for (Record& record : records_) record = {};
    acquit(outputs);
    finding.release = true;
    finding.rebase = false;
    return finding;
  }
  if (slip_->is_active) hold_back(time, outputs);
  bool after_gap = true;
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (findings_[s] & reason::rejected) after_gap = after_gap && records_[s].after_gap;
  if (moved_->explained >= (after_gap ? setup_.gap_proof : setup_.proof) && may_follow()) {
    for (std::uint32_t& each : findings_)
      if (each & reason::rejected) each |= reason::moved;
    for (std::size_t s = 0; s < sensors_.size(); ++s) states_[s].reasons |= findings_[s] & reason::moved;
    for (Record& record : records_) record = {};
    return accept(*moved_);
  }
  if (memory_->search && disputed_samples_ > hopeless * setup_.proof) {
    // Nothing explains what is measured: the position counts, and all else is found anew.
    start_moved();
    moved_->filter.update(raw_.data());
    for (std::size_t j = 0; j < setup_.parameter_sigmas.size(); ++j)
      moved_->filter.restart_parameter(static_cast<int>(j), setup_.parameter_sigmas[j]);
    search_from(moved_->filter, *memory_->search);
    for (Record& record : records_) record = {};
    return accept(*moved_);
  }
  if (!is_blind_ && blind_->explained >= setup_.proof && slip_->refuted > 0 && moved_->refuted > 0) {
    is_blind_ = true;
    trusted_samples_ = 0;
    for (Record& record : records_) record = {};
    return accept(*blind_);
  }
  return {};
}

/// What was held back, and what was rejected last, is right after all.
void SensorWatch::acquit(const double* outputs) noexcept {
  const auto take_back = [&](auto&& was_rejected) {
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      if (std::ranges::none_of(sensors_[s].outputs, was_rejected)) continue;
      --states_[s].rejected;
      ++states_[s].accepted;
    }
  };
  for (int i = 0; i < held_count_; ++i) take_back([&](int j) { return !std::isnan(held_[i].outputs[j]); });
  take_back([&](int j) { return std::isnan(outputs[j]) && !std::isnan(raw_[j]); });
  for (std::uint32_t& each : findings_) each &= ~reason::rejected;
  // Slip at a bound may well be beyond it, as that of wheels that spin on the spot.
  const Eigen::Index nx = own_->filter.model().state_count();
  bool is_usual = memory_->was_calm;
  for (std::size_t j = 0; j < setup_.walk.size(); ++j) {
    const double slip = own_->filter.mean()[nx + static_cast<Eigen::Index>(j)];
    is_usual = is_usual && slip > setup_.noise.parameter_lower[j] && slip < setup_.noise.parameter_upper[j];
  }
  if (!is_usual) return;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    states_[s].reasons &= ~reason::rejected;
    quiet_[s] = setup_.calm;
  }
  calm_samples_ = setup_.calm;
}

SensorWatch::Finding SensorWatch::accept(Hypothesis& hypothesis) noexcept {
  own_->filter.mean() = hypothesis.filter.mean();
  own_->filter.covariance() = hypothesis.filter.covariance();
  end_dispute();
  return {.release = false, .rebase = true};
}

/// Where a sensor that has moved does not explain what follows, the heading may be wrong, too, e.g. after a turn
/// without a position. One that is found goes on as if the sensor had moved.
void SensorWatch::think_again() noexcept {
  if (!memory_->second_thought || moved_->refuted == 0 || moved_->explained >= informed) return;
  HeadingSearch& search = *memory_->second_thought;
  if (search.is_active()) {
    const bool is_found = search.update(sensors_, raw_.data());
    memory_->in_vain = search.explained() > 0 ? 0 : memory_->in_vain + 1;
    if (!is_found && memory_->in_vain < stale) return;
    if (is_found) {
      moved_->is_active = true;
      moved_->explained = search.explained();
      moved_->filter.mean() = search.best().mean();
      moved_->filter.covariance() = search.best().covariance();
      return;
    }
  }
  start_moved();
  moved_->filter.update(raw_.data());
  WalkingFilter& trial = *memory_->trial;
  trial.mean() = moved_->filter.mean();
  trial.covariance() = moved_->filter.covariance();
  search_from(trial, search);
  moved_->explained = 1;
  memory_->in_vain = 0;
}

/// Keeps what was rejected, in case it is right.
void SensorWatch::hold_back(double time, const double* outputs) noexcept {
  if (held_count_ == static_cast<int>(held_.size())) return;
  Held& held = held_[held_count_++];
  held.time = time;
  for (std::size_t j = 0; j < raw_.size(); ++j) held.outputs[j] = std::isnan(outputs[j]) ? raw_[j] : unknown;
}

void SensorWatch::end_dispute() noexcept {
  is_disputed_ = false;
  disputed_samples_ = 0;
  if (memory_->second_thought) memory_->second_thought->cancel();
  for (Hypothesis* each : {slip_.get(), moved_.get(), blind_.get()}) {
    each->is_active = each->is_informed = false;
    each->explained = each->refuted = 0;
  }
}

/// Whether the measured inputs explain the last interval again.
void SensorWatch::test_inputs(const double* outputs) noexcept {
  WalkingFilter& trial = *memory_->trial;
  trial.mean() = memory_->before_mean;
  trial.covariance() = memory_->before_covariance;
  trial.predict(input_.data(), memory_->duration);
  trusted_samples_ = fits(trial, outputs) ? trusted_samples_ + 1 : 0;
  if (trusted_samples_ >= trusted_again) is_blind_ = false;
}

void SensorWatch::remember(double time) noexcept {
  Memory& memory = *memory_;
  memory.newest = static_cast<std::size_t>(memory.count % static_cast<std::int64_t>(memory.entries.size()));
  ++memory.count;
  Memory::Entry& entry = memory.entries[memory.newest];
  entry.time = time;
  entry.mean = own_->filter.mean();
  entry.covariance = own_->filter.covariance();
}

void SensorWatch::judge_late(double time, double* outputs) noexcept {
  if (!is_active_) return;
  const Memory::Entry* last = nullptr;
  const auto known = static_cast<std::size_t>(std::min<std::int64_t>(memory_->count, remembered_samples));
  for (std::size_t i = 0; i < known; ++i) {
    const Memory::Entry& entry = memory_->entries[i];
    if (entry.time <= time && (!last || entry.time > last->time)) last = &entry;
  }
  if (!last) return;
  WalkingFilter& filter = *memory_->trial;
  filter.mean() = last->mean;
  filter.covariance() = last->covariance;
  filter.predict(last->inputs.data(), time - last->time);
  filter.expect();
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (!filter.innovation(sensors_[s], outputs, scratch_)) continue;
    if (scratch_.nis <= limit(s, scratch_.value.size())) {
      ++states_[s].accepted;
      continue;
    }
    ++states_[s].rejected;
    states_[s].reasons |= reason::rejected;
    quiet_[s] = 0;
    for (const int j : sensors_[s].outputs) outputs[j] = unknown;
  }
}

void SensorWatch::follow(const Estimate& estimate) noexcept {
  const Model& model = own_->filter.model();
  const Eigen::Index nx = model.state_count(), np = model.parameter_count(), n = nx + np;
  if (estimate.state.size() != nx || estimate.parameters.size() != np || estimate.covariance.rows() != n) return;
  if (!estimate.state.allFinite() || !estimate.parameters.allFinite() || !estimate.covariance.allFinite()) return;
  const int heading = model.description().roles.heading;
  if (!is_active_) {
    if (!(estimate.covariance.diagonal().maxCoeff() > 0.0)) return;  // of one that is not estimated
    if (heading >= 0 && estimate.covariance(heading, heading) > known_heading * known_heading) return;
    is_active_ = true;
  }
  if (is_blind_ || is_searching()) return;
  own_->filter.mean().head(nx) = estimate.state;
  own_->filter.mean().tail(np) = estimate.parameters;
  own_->filter.covariance() = estimate.covariance;
}

void SensorWatch::assess(const Estimate& estimate, std::span<const std::uint8_t> silent, std::uint32_t reasons,
                         Health& health) const noexcept {
  health.reasons = reasons;
  health.sensors.assign(states_.begin(), states_.end());
  health.inputs = inputs_;
  bool has_finding = reasons != 0 || calm_samples_ < setup_.calm || inputs_.reasons != 0;
  for (std::size_t s = 0; s < sensors_.size(); ++s) {
    if (silent[s]) health.sensors[s].reasons |= reason::silent;
    has_finding = has_finding || health.sensors[s].reasons != 0;
  }
  const Roles& roles = own_->filter.model().description().roles;
  const Eigen::MatrixXd& P = estimate.covariance;
  if (is_searching()) health.reasons |= reason::uncertain;
  bool is_lost = (reasons & reason::starting) != 0;
  if (P.rows() > 0) {
    double variance = 0.0;
    for (const int i : {roles.position_x, roles.position_y})
      if (i >= 0) variance = std::max(variance, P(i, i));
    const bool is_place_known = variance <= setup_.lost_position * setup_.lost_position;
    const bool is_heading_known =
        roles.heading < 0 || P(roles.heading, roles.heading) <= setup_.lost_heading * setup_.lost_heading;
    if (!is_place_known || !is_heading_known) {
      health.reasons |= reason::uncertain;
      is_lost = true;
    }
  }
  is_lost = is_lost || is_searching() || disputed_samples_ > hopeless * setup_.proof;
  health.level = is_lost ? HealthLevel::lost : has_finding ? HealthLevel::degraded : HealthLevel::ok;
}

void SensorWatch::predict(double duration, const double* inputs, const double* input_sigmas,
                          Estimate& estimate) noexcept {
  WalkingFilter& filter = *memory_->trial;
  const Eigen::Index nx = filter.model().state_count(), np = filter.model().parameter_count();
  if (estimate.state.size() != nx || estimate.parameters.size() != np || estimate.covariance.rows() != nx + np) return;
  filter.mean().head(nx) = estimate.state;
  filter.mean().tail(np) = estimate.parameters;
  filter.covariance() = estimate.covariance;
  filter.predict(inputs, duration, input_sigmas);
  estimate.state = filter.mean().head(nx);
  estimate.covariance = filter.covariance();
}

}  // namespace rhec
