#include "offset_watch.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "innovation.hpp"
#include "rhec/core/base/infinity.hpp"

namespace rhec {

namespace {

// An onset begins where an innovation is larger than so many standard deviations, or none is younger than so many
// samples that count. Where there are many, one of at least so many samples gives way; the oldest say nothing new.
constexpr double strange = 2.0;
constexpr int most_onsets = 7, young = 20, unproven = 10, oldest = 150;
// The difference of two outputs shows at once, and what an input is off by soon: so many onsets of these are enough.
constexpr int onsets_of_rivals = 3, onsets_of_inputs = 3;
// Errors of receivers last, as those by reflections. Until so many innovations tell, the squares of their sums are so
// many times larger than those of independent errors.
constexpr double correlation_of_receivers = 2.0, innovations_to_know = 150.0;
// An offset is as probable as none where b^^2 is so many times its variance, and not worth a thought below.
constexpr double even_odds = 25.0, improbable = 16.0;
// The probability that it is the other one of two outputs that is off.
constexpr double rival_is_off = 0.5;
// What says that an output has always been off is a sum over about so many samples.
constexpr double memory = 100.0;
// One innovation counts as no more than so many standard deviations: slip that jumps makes large ones, but few.
constexpr double most_counted = 3.0;
// The same of one that has lasted.
constexpr double lasting = 9.0;
// How far an input that is off leads an estimate depends on how much the estimator itself believes sensors, which may
// be less than is said of them, since it learns: innovations then seem to say more of it. By such a share it is
// corrected at once, and again while something is left.
constexpr double share_of_input = 0.5;
// Samples that count within which a jump of slip has been seen in positions.
constexpr int samples_to_tell_slip = 3;
// An offset that differs from none by less than so many standard deviations is none.
constexpr double negligible = 2.0;
// By no more than so many is one known that innovations have said: slip makes some that look like one, too, and later
// ones have to be able to say so.
constexpr double most_certain = 4.0;
// In typical magnitudes of an output, what it is not off by: where an offset hardly shows, anything would explain a
// little.
constexpr double impossible_offset = 10.0;

/// P + v v' scale, without a temporary.
template <class Vector>
void add_square(const Vector& v, double scale, Eigen::MatrixXd& P) noexcept {
  for (Eigen::Index c = 0; c < v.size(); ++c) P.col(c) += v * (scale * v[c]);
}

}  // namespace

OffsetWatch::OffsetWatch(const Model& model, const std::vector<Watched>& watched, const KalmanFilter::Noise& noise,
                         double gate)
    : watched_of_(static_cast<std::size_t>(model.output_count()), -1),
      position_x_(model.description().roles.position_x),
      position_y_(model.description().roles.position_y),
      parameter_lower_(noise.parameter_lower),
      parameter_upper_(noise.parameter_upper),
      limit_(gate * gate),
      known_(watched.size()) {
  int slots = static_cast<int>(watched.size());
  const auto is_single = [](const Watched& each) { return each.input < 0 && each.rival < 0; };
  const bool has_single = std::ranges::any_of(watched, is_single);
  const int first_shared = slots;
  if (has_single) slots += most_onsets;
  for (const Watched& each : watched) {
    if (each.output >= 0) watched_of_[each.output] = static_cast<int>(outputs_.size());
    outputs_.push_back(each.output);
    inputs_.push_back(each.input);
    rivals_.push_back(each.rival);
    searched_.push_back(each.is_searched);
    biases_.push_back(each.bias);
    first_slot_.push_back(is_single(each) ? first_shared : slots);
    const int own = each.input >= 0 ? onsets_of_inputs : onsets_of_rivals;
    slots_.push_back(!each.is_searched ? 0 : is_single(each) ? most_onsets : own);
    if (!is_single(each)) slots += slots_.back();
  }
  const ModelDescription& description = model.description();
  for (const Watched& each : watched) {
    const Variable& about = each.input < 0 ? description.outputs[static_cast<std::size_t>(each.output)]
                                           : description.inputs[static_cast<std::size_t>(each.input)];
    most_offset_.push_back(each.rival >= 0 ? infinity : impossible_offset * about.scale);
  }
  onsets_.resize(slots);
  const Eigen::Index n = model.state_count() + model.parameter_count(), needed = lane_of_known(outputs_.size()),
                     lanes = (needed + block - 1) / block * block;
  sensitivities_.columns = KalmanFilter::Deviations::Columns::Zero(n, lanes);
  for (auto* each : {&information_, &score_, &squares_, &count_, &is_sure_}) *each = Eigen::ArrayXd::Zero(lanes);
  is_off_ = Eigen::ArrayXXd::Zero(lanes, model.output_count());
  if (std::ranges::any_of(inputs_, [](int input) { return input >= 0; }))
    sensitivities_.by_input = KalmanFilter::Deviations::Columns::Zero(model.input_count(), lanes);
  for (std::size_t k = 0; k < outputs_.size(); ++k) mark(lane_of_known(k), static_cast<int>(k));
  reset();
}

void OffsetWatch::reset() noexcept {
  known_.assign(known_.size(), {});
  sensitivities_.columns.setZero();
  forget_onsets();
}

void OffsetWatch::set(int lane, const Constant& constant) noexcept {
  information_[lane] = constant.information;
  score_[lane] = constant.score;
  squares_[lane] = constant.squares;
  count_[lane] = constant.count;
}

void OffsetWatch::forget_onsets() noexcept {
  for (std::size_t m = 0; m < onsets_.size(); ++m) {
    const bool is_ever = m < outputs_.size() && searched_[m];
    onsets_[m] = {.watched = is_ever ? static_cast<int>(m) : -1, .age = 0};
    set(static_cast<int>(m), {});
    mark(static_cast<int>(m), is_ever ? static_cast<int>(m) : -1);
  }
  // An offset that has always been there goes on as before.
  sensitivities_.columns.rightCols(sensitivities_.columns.cols() - std::ssize(outputs_)).setZero();
  suspect_ = refuted_ = candidate_ = -1;
  for (std::size_t k = 0; k < known_.size(); ++k) is_sure_[lane_of_known(k)] = known_[k].is_sure ? 1.0 : 0.0;
  find_used_lanes();
}

/// Whole blocks of lanes at the end in which nothing is watched are left out.
void OffsetWatch::find_used_lanes() noexcept {
  int used = 0;
  for (std::size_t m = 0; m < onsets_.size(); ++m)
    if (onsets_[m].watched >= 0) used = static_cast<int>(m) + 1;
  for (std::size_t k = 0; k < known_.size(); ++k)
    if (known_[k].is_off) used = lane_of_known(k) + 1;
  sensitivities_.used = (used + block - 1) / block * block;
}

/// What a lane's constant is that of; -1: of nothing.
void OffsetWatch::mark(int lane, int watched) noexcept {
  is_off_.row(lane).setZero();
  if (sensitivities_.by_input.size() > 0) sensitivities_.by_input.col(lane).setZero();
  if (watched < 0) return;
  if (const int output = outputs_[static_cast<std::size_t>(watched)]; output >= 0) is_off_(lane, output) = 1.0;
  if (const int input = inputs_[static_cast<std::size_t>(watched)]; input >= 0)
    sensitivities_.by_input(input, lane) = 1.0;
}

void OffsetWatch::correct(double* outputs) const noexcept {
  for (std::size_t k = 0; k < outputs_.size(); ++k)
    if (outputs_[k] >= 0) outputs[outputs_[k]] -= known_[k].value;
}

void OffsetWatch::correct_inputs(double* inputs) const noexcept {
  for (std::size_t k = 0; k < inputs_.size(); ++k)
    if (inputs_[k] >= 0) inputs[inputs_[k]] -= known_[k].value;
}

bool OffsetWatch::has_any() const noexcept {
  return std::ranges::any_of(known_, [](const Known& each) { return each.is_off; });
}

bool OffsetWatch::Known::is_recent() const noexcept { return is_off && !is_sure && age <= oldest; }

bool OffsetWatch::has_recent() const noexcept {
  return std::ranges::any_of(known_, [](const Known& each) { return each.is_recent(); });
}

bool OffsetWatch::has_any_but(const std::vector<int>& outputs) const noexcept {
  for (std::size_t k = 0; k < known_.size(); ++k)
    if (known_[k].is_off && std::ranges::find(outputs, outputs_[k]) == outputs.end()) return true;
  return false;
}

bool OffsetWatch::is_significant(std::size_t watched) const noexcept {
  const Constant error = constant(lane_of_known(watched));
  const double total = known_[watched].value + error.value();
  return total * total * error.information > negligible * negligible;
}

void OffsetWatch::clip(Eigen::VectorXd::SegmentReturnType parameters) const noexcept {
  for (Eigen::Index j = 0; j < parameters.size(); ++j)
    parameters[j] = std::min(std::max(parameters[j], parameter_lower_[j]), parameter_upper_[j]);
}

bool OffsetWatch::has_young(int watched) const noexcept {
  const auto first = onsets_.begin() + first_slot_[watched];
  return std::any_of(first, first + slots_[watched],
                     [&](const Onset& each) { return each.watched == watched && each.age < young; });
}

/// Where there is no room, the onset gives way that explains the least; the one that explains the most stays.
void OffsetWatch::begin(const Onset& onset) noexcept {
  const int watched = onset.watched;
  std::size_t least = onsets_.size();
  const auto worth = [this](std::size_t m) {
    return onsets_[m].watched < 0 || onsets_[m].age > oldest ? -1.0 : constant(static_cast<int>(m)).explained();
  };
  const auto first = static_cast<std::size_t>(first_slot_[watched]), end = first + slots_[watched];
  std::size_t best = first;
  for (std::size_t m = first + 1; m < end; ++m)
    if (worth(m) > worth(best)) best = m;
  for (std::size_t m = first; m < end; ++m) {
    const bool is_proven = m == best && worth(m) > improbable;
    const bool may_go = onsets_[m].watched < 0 || (onsets_[m].age >= unproven && !is_proven);
    if (may_go && (least == onsets_.size() || worth(m) < worth(least))) least = m;
  }
  if (least == onsets_.size()) return;
  const auto lane = static_cast<Eigen::Index>(least);
  onsets_[least] = onset;
  set(static_cast<int>(least), {});
  mark(static_cast<int>(least), watched);
  sensitivities_.columns.col(lane).setZero();
  find_used_lanes();
}

/// What an output that has been used says of all constants.
void OffsetWatch::note(const WalkingFilter& filter, int output, const KalmanFilter::Use& use,
                       double correlation) noexcept {
  const int n = static_cast<int>(sensitivities_.columns.rows()), nx = filter.model().state_count();
  const double most = most_counted * std::sqrt(use.variance), inverse = 1.0 / use.variance,
               counted = std::min(std::max(use.innovation, -most), most), square = counted * counted * inverse;
  const auto at = [](auto& array, Eigen::Index first) { return array.template segment<block>(first); };
  for (Eigen::Index first = 0; first < sensitivities_.used; first += block) {
    const auto sensitivity = [&](Eigen::Index r) {
      return sensitivities_.columns.row(r).template segment<block>(first).transpose().array();
    };
    Lanes g = is_off_.col(output).segment<block>(first);
    for (int c = 0; c < nx; ++c)
      if (const double by = filter.derivative(output, c); by != 0.0) g -= by * sensitivity(c);
    // Errors of another receiver that last say less of by how much this one has moved than as many independent ones.
    const Lanes weighted = g * inverse * (1.0 - at(is_sure_, first) * (1.0 - 1.0 / correlation));
    at(information_, first) += g * weighted;
    at(score_, first) += counted * weighted;
    at(squares_, first) += square;
    at(count_, first) += 1.0;
    for (int r = 0; r < n; ++r) sensitivity(r) += use.gain[r] * g;
  }
}

/// What the constant of a lane is known to have done to an innovation is taken out, and what is not known of it added.
void OffsetWatch::widen_by(const WalkingFilter& filter, const Sensor& sensor, const double* outputs, int output,
                           int lane, Innovation& innovation) const noexcept {
  const auto sensitivity = sensitivities_.columns.col(lane);
  const Constant error = constant(lane);
  Innovation::OfSensor<1> by_offset(innovation.value.size());
  Eigen::Index a = 0;
  for (const int j : sensor.outputs) {
    if (std::isnan(outputs[j])) continue;
    double g = j == output ? 1.0 : 0.0;
    for (int c = 0; c < filter.model().state_count(); ++c) g -= filter.derivative(j, c) * sensitivity[c];
    by_offset[a++] = g;
  }
  innovation.value -= by_offset * error.value();
  innovation.covariance += by_offset * by_offset.transpose() / error.information;
}

void OffsetWatch::widen(const WalkingFilter& filter, const Sensor& sensor, const double* outputs,
                        Innovation& innovation) noexcept {
  bool is_wider = false;
  for (std::size_t k = 0; k < outputs_.size(); ++k) {
    if (!known_[k].is_off) continue;
    is_wider = true;
    widen_by(filter, sensor, outputs, outputs_[k], lane_of_known(k), innovation);
  }
  if (is_wider) innovation.nis = squared_size(innovation.value, innovation.covariance);
}

void OffsetWatch::widen_by_candidate(const WalkingFilter& filter, const Sensor& sensor, const double* outputs,
                                     Innovation& innovation) const noexcept {
  widen_by(filter, sensor, outputs, outputs_[onsets_[candidate_].watched], candidate_, innovation);
  innovation.nis = squared_size(innovation.value, innovation.covariance);
}

namespace {

/// By how much larger squares of sums of innovations are than those of independent ones; 1 where it is not watched.
double correlation_by(const InnovationWhiteness* known) noexcept {
  if (!known) return 1.0;
  const double unknown = std::max(0.0, 1.0 - static_cast<double>(known->count()) / innovations_to_know);
  return std::max(known->correlation(), 1.0 + unknown * (correlation_of_receivers - 1.0));
}

/// Whether an output that the filter has used was far from what it expected.
bool is_strange(const KalmanFilter::Use& use) noexcept {
  return use.variance > 0.0 && use.innovation * use.innovation > strange * strange * use.variance;
}

}  // namespace

/// One output after the other, as the filter has done it: innovations of a sample are then independent.
void OffsetWatch::take(const WalkingFilter& filter, double excess,
                       std::span<const InnovationWhiteness* const> whiteness, bool counts) noexcept {
  if (outputs_.empty()) return;
  const double kept = 1.0 - 1.0 / memory;
  for (std::size_t k = 0; counts && k < outputs_.size(); ++k) {
    const int ever = static_cast<int>(k);
    const Constant all = constant(ever);
    set(ever, {kept * all.information, kept * all.score, kept * all.squares, kept * all.count});
  }
  // Innovations of a single angle are correlated by slip, too, which is not to keep an offset from being found.
  const auto whiteness_of = [&](int watched) -> const InnovationWhiteness* {
    if (whiteness.empty() || rivals_[watched] < 0) return nullptr;
    return whiteness[static_cast<std::size_t>(outputs_[watched])];
  };
  begin_inputs(filter, excess);
  const bool has_sure = is_sure_.maxCoeff() > 0.0;
  for (int j = 0; j < filter.model().output_count(); ++j) {
    const KalmanFilter::Use use = filter.use(j);
    if (!(use.variance > 0.0)) continue;
    const double square = use.innovation * use.innovation / use.variance;
    if (const int k = watched_of_[j]; k >= 0 && searched_[k] && (is_strange(use) || !has_young(k)))
      begin({.watched = k,
             .excess = excess,
             .correlation = correlation_by(whiteness_of(k)),
             .first = whiteness_of(k) ? whiteness_of(k)->count() : 0,
             .left_out = std::max(0.0, square - most_counted * most_counted)});
    const bool is_correlated = has_sure && !whiteness.empty();
    note(filter, j, use, is_correlated ? correlation_by(whiteness[static_cast<std::size_t>(j)]) : 1.0);
  }
  age(filter, counts);
  // What an offset does is in the correlation, too: one that has always been there has the least of late.
  for (int k = 0; k < std::ssize(outputs_); ++k) onsets_[k].correlation = correlation_by(whiteness_of(k));
  for (const Onset& each : onsets_)
    if (each.watched >= 0) {
      Onset& ever = onsets_[static_cast<std::size_t>(each.watched)];
      ever.correlation = std::min(ever.correlation, each.correlation);
    }
  double most = find_candidate(filter, excess);
  if (candidate_ < 0) return;
  const int watched = onsets_[candidate_].watched;
  const bool is_end = ends(watched, constant(candidate_));
  if (const InnovationWhiteness* known = whiteness_of(watched);
      known && !is_end && candidate_ >= std::ssize(outputs_)) {
    const Onset& onset = onsets_[candidate_];
    most *= std::min(1.0, onset.correlation / known->correlation_of_last(known->count() - onset.first));
    if (!(most > improbable)) {
      candidate_ = -1;
      return;
    }
  }
  const bool is_measured = outputs_[watched] < 0 || filter.use(outputs_[watched]).variance > 0.0;
  // Slip that jumps looks like an offset of what turns with it, until positions have said how far the vehicle has gone.
  const bool is_told_from_slip = parameter_lower_.empty() || is_end || inputs_[watched] >= 0 || rivals_[watched] >= 0 ||
                                 onsets_[candidate_].age >= samples_to_tell_slip;
  if (is_measured && is_told_from_slip && most > (is_end ? improbable : limit_)) suspect_ = candidate_;
  probability_ = 1.0 / (1.0 + std::exp(0.5 * (even_odds - most)));
}

/// What an input is off by shows in where the vehicle is.
void OffsetWatch::begin_inputs(const WalkingFilter& filter, double excess) noexcept {
  if (sensitivities_.by_input.size() == 0) return;
  const auto sees = [&](int output, int state) { return state >= 0 && filter.depends_on(output, state); };
  bool is_place_strange = false;
  for (int j = 0; j < filter.model().output_count(); ++j) {
    const bool sees_place = sees(j, position_x_) || sees(j, position_y_);
    is_place_strange = is_place_strange || (sees_place && is_strange(filter.use(j)));
  }
  for (int k = 0; k < std::ssize(inputs_); ++k)
    if (inputs_[k] >= 0 && (is_place_strange || !has_young(k))) begin({.watched = k, .excess = excess});
}

/// After a sample.
void OffsetWatch::age(const WalkingFilter& filter, bool counts) noexcept {
  suspect_ = refuted_ = candidate_ = -1;
  for (std::size_t k = 0; k < known_.size(); ++k) {
    Known& known = known_[k];
    known.age += counts;
    if (!known.is_off) continue;
    if (!is_significant(k)) refuted_ = static_cast<int>(k);
    if (rivals_[k] < 0) continue;
    known.by_x = filter.derivative(outputs_[k], position_x_);
    known.by_y = filter.derivative(outputs_[k], position_y_);
  }
  for (Onset& each : onsets_)
    if (each.watched >= 0) each.age += counts;
}

/// The constant that innovations speak for most, and its b^^2 by its variance.
double OffsetWatch::find_candidate(const WalkingFilter& filter, double excess) noexcept {
  double most = improbable;
  for (std::size_t m = 0; m < onsets_.size(); ++m) {
    const Onset& each = onsets_[m];
    if (each.watched < 0) continue;
    // What an offset does is in the excess, too, but not before it began.
    const double alone = m < outputs_.size() ? excess : std::min(excess, each.excess), usual = alone * each.correlation;
    const int lane = static_cast<int>(m);
    // None is more significant than what it explains.
    if (!(score_[lane] * score_[lane] > (most - each.left_out) * alone * information_[lane])) continue;
    const Constant found = constant(lane);
    const bool is_end = ends(each.watched, found);
    double significance = found.significance() / (is_end ? alone : usual);
    // Slip that has jumped does not just take back what an output was off by.
    if (is_end) significance += each.left_out;
    if (!(significance > most) || !is_possible(each.watched, found.value()) || !leaves_possible(lane, filter)) continue;
    most = significance;
    candidate_ = lane;
  }
  return most;
}

/// Whether a change takes back what an output was off by: of all changes the most probable one beforehand.
bool OffsetWatch::ends(int watched, const Constant& change) const noexcept {
  const auto k = static_cast<std::size_t>(watched);
  if (!known_[k].is_off) return false;
  const double total = known_[k].value + constant(lane_of_known(k)).value(), left = total + change.value();
  return std::abs(change.value()) > 0.5 * std::abs(total) && left * left * change.information < negligible * negligible;
}

bool OffsetWatch::can_be_off(int output, double change, double variance) const noexcept {
  const int k = watched_of_[static_cast<std::size_t>(output)];
  return k >= 0 && rivals_[static_cast<std::size_t>(k)] < 0 && is_possible(k, change) &&
         change * change > lasting * variance;
}

bool OffsetWatch::is_right_again(const std::vector<int>& outputs, const Innovation& innovation) const noexcept {
  if (innovation.value.size() != std::ssize(outputs)) return false;
  Innovation::OfSensor<1> rest = innovation.value;
  bool is_any = false;
  for (Eigen::Index i = 0; i < rest.size(); ++i) {
    const int k = watched_of_[static_cast<std::size_t>(outputs[static_cast<std::size_t>(i)])];
    if (k < 0 || !known_[static_cast<std::size_t>(k)].is_off) continue;
    const auto watched = static_cast<std::size_t>(k);
    if (rivals_[watched] >= 0 && !known_[watched].is_sure) return false;
    rest[i] += known_[watched].value + constant(lane_of_known(watched)).value();
    is_any = true;
  }
  const double most = negligible * negligible * static_cast<double>(rest.size());
  return is_any && squared_size(rest, innovation.covariance) < most;
}

void OffsetWatch::end(const std::vector<int>& outputs, WalkingFilter& filter) noexcept {
  for (const int output : outputs) {
    const int watched = watched_of_[static_cast<std::size_t>(output)];
    if (watched < 0 || !known_[static_cast<std::size_t>(watched)].is_off) continue;
    const auto k = static_cast<std::size_t>(watched);
    const Constant error = constant(lane_of_known(k));
    const auto sensitivity = sensitivities_.columns.col(lane_of_known(k));
    filter.mean() -= sensitivity * error.value();
    add_square(sensitivity, 1.0 / error.information, filter.covariance());
    known_[k] = {};
  }
  clip(filter.mean().tail(std::ssize(parameter_lower_)));
  forget_onsets();
}

bool OffsetWatch::is_possible(int watched, double change) const noexcept {
  const auto k = static_cast<std::size_t>(watched);
  return std::abs(known_[k].value + change) <= most_offset_[k];
}

/// Whether slip can be what it is without the constant of a lane: where that hardly shows, it explains what something
/// else has done, and takes slip beyond its bounds for it.
bool OffsetWatch::leaves_possible(int lane, const WalkingFilter& filter) const noexcept {
  const Constant found = constant(lane);
  const Eigen::Index np = std::ssize(parameter_lower_), nx = filter.mean().size() - np;
  for (Eigen::Index j = 0; j < np; ++j) {
    const double by = sensitivities_.columns(nx + j, lane), without = filter.mean()[nx + j] - by * found.value();
    const double beyond = std::max(parameter_lower_[j] - without, without - parameter_upper_[j]);
    const double variance = filter.covariance()(nx + j, nx + j) + by * by / found.information;
    if (beyond > 0.0 && beyond * beyond > negligible * negligible * variance) return false;
  }
  return true;
}

void OffsetWatch::adopt_suspected(WalkingFilter& filter) noexcept {
  if (refuted_ >= 0) return withdraw(static_cast<std::size_t>(refuted_), filter);
  adopt_lane(suspect_, filter);
}

void OffsetWatch::adopt_lane(int lane, WalkingFilter& filter) noexcept {
  const Constant found = constant(lane);
  const int watched = onsets_[lane].watched;
  const auto sensitivity = sensitivities_.columns.col(lane);
  filter.mean() -= sensitivity * found.value();
  clip(filter.mean().tail(std::ssize(parameter_lower_)));
  add_square(sensitivity, 1.0 / found.information, filter.covariance());
  const double share = inputs_[static_cast<std::size_t>(watched)] < 0 ? 1.0 : share_of_input;
  adopt_mean_of(watched, share * found.value(), 1.0 / found.information);
}

void OffsetWatch::adopt_mean(int output, double change, double variance) noexcept {
  adopt_mean_of(watched_of_[static_cast<std::size_t>(output)], change, variance);
}

void OffsetWatch::adopt_mean_of(int watched, double change, double variance) noexcept {
  const double least = change / most_certain;
  adopt_of(watched, change, std::max(variance, least * least), false);
}

void OffsetWatch::adopt(int output, double change, double variance, bool is_sure) noexcept {
  adopt_of(watched_of_[static_cast<std::size_t>(output)], change, variance, is_sure);
}

void OffsetWatch::adopt_of(int watched, double change, double variance, bool is_sure) noexcept {
  const auto k = static_cast<std::size_t>(watched);
  Known& known = known_[k];
  known.value += change;
  known.age = 0;
  known.is_sure = known.is_sure || is_sure;
  set(lane_of_known(k), {.information = 1.0 / variance, .score = 0.0, .squares = 0.0, .count = 0.0});
  known.is_off = known.value * known.value > negligible * negligible * variance;
  if (!known.is_off) known = {};
  forget_onsets();
}

void OffsetWatch::forget_receivers() noexcept {
  for (std::size_t k = 0; k < known_.size(); ++k)
    if (rivals_[k] >= 0) known_[k] = {};
  forget_onsets();
}

/// With x = x^ - V e for an error e of the offset b^, the bias beta + b^ + e has the sensitivity 1 - V_beta to e.
int OffsetWatch::hand_over(WalkingFilter& filter) noexcept {
  for (std::size_t k = 0; k < known_.size(); ++k) {
    const int bias = biases_[k], lane = lane_of_known(k);
    if (bias < 0 || !known_[k].is_off || known_[k].age < for_good) continue;
    const Constant error = constant(lane);
    auto sensitivity = sensitivities_.columns.col(lane);
    sensitivity[bias] -= 1.0;
    filter.mean() -= sensitivity * error.value();
    filter.mean()[bias] += known_[k].value;
    clip(filter.mean().tail(std::ssize(parameter_lower_)));
    add_square(sensitivity, 1.0 / error.information, filter.covariance());
    known_[k] = {};
    forget_onsets();
    return outputs_[k];
  }
  return -1;
}

bool OffsetWatch::move_bias(int output, double change, double variance, WalkingFilter& filter) noexcept {
  const int k = watched_of_[static_cast<std::size_t>(output)];
  const int bias = k < 0 ? -1 : biases_[static_cast<std::size_t>(k)];
  if (bias < 0) return false;
  filter.mean()[bias] += change;
  filter.covariance()(bias, bias) += variance;
  forget_onsets();
  return true;
}

/// An offset that was adopted is none.
void OffsetWatch::withdraw(std::size_t watched, WalkingFilter& filter) noexcept {
  Known& known = known_[watched];
  const auto sensitivity = sensitivities_.columns.col(lane_of_known(watched));
  filter.mean() += sensitivity * known.value;
  clip(filter.mean().tail(std::ssize(parameter_lower_)));
  add_square(sensitivity, known.value * known.value, filter.covariance());
  known = {};
  forget_onsets();
}

void OffsetWatch::withdraw_recent(WalkingFilter& filter) noexcept {
  for (std::size_t k = 0; k < known_.size(); ++k)
    if (known_[k].is_recent()) withdraw(k, filter);
}

void OffsetWatch::refine(Estimate& estimate) const noexcept {
  const Eigen::Index nx = estimate.state.size(), np = estimate.parameters.size();
  if (estimate.covariance.rows() != nx + np) return;
  if (candidate_ >= 0) {
    const Constant offset = constant(candidate_);
    const double square = offset.value() * offset.value() + 1.0 / offset.information;
    add_square(sensitivities_.columns.col(candidate_), probability_ * square, estimate.covariance);
  }
  for (std::size_t k = 0; k < known_.size(); ++k) {
    if (!known_[k].is_off) continue;
    const auto sensitivity = sensitivities_.columns.col(lane_of_known(k));
    const Constant error = constant(lane_of_known(k));
    estimate.state -= sensitivity.head(nx) * error.value();
    estimate.parameters -= sensitivity.tail(np) * error.value();
    clip(estimate.parameters.head(np));
    add_square(sensitivity, 1.0 / error.information, estimate.covariance);
    if (rivals_[k] < 0 || known_[k].is_sure) continue;
    // If the other one is off, the vehicle is where this one says.
    const double squared = known_[k].by_x * known_[k].by_x + known_[k].by_y * known_[k].by_y;
    if (!(squared > 0.0)) continue;
    const double shift = (known_[k].value + error.value()) / squared, by[] = {known_[k].by_x, known_[k].by_y};
    const int at[] = {position_x_, position_y_};
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 2; ++c) estimate.covariance(at[r], at[c]) += rival_is_off * (shift * by[r]) * (shift * by[c]);
  }
}

}  // namespace rhec
