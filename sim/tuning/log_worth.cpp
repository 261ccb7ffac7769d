// What was found is worth: its precision, what the log does not tell, and how it does on fixes that it was not tuned
// on.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "rhec/sim/numbers/random.hpp"

#include "judgement.hpp"
#include "log_tuner.hpp"

namespace rhec::sim {
namespace {

// A coordinate whose standard error is not below this share of its doubt is not told by the log.
constexpr double told_below = 0.5;
constexpr std::size_t most_named = 6;  // confounded pairs
constexpr int fewest_blocks = 10, most_blocks = 60, fixes_of_a_block = 10;
constexpr double block_seconds = 30.0;
// Estimators are chosen by these many rests of so many, at least.
constexpr int rests_tried = 4, fewest_rests = 5;
// Roughness is looked for at so many points, this far away in the coordinates; and so many points are told apart.
constexpr int looks_about = 15;
constexpr double nearby = 0.01;
constexpr std::size_t most_settled = 100;
// Another estimator than the scenario's must have errors that are smaller by so much, relative to each other.
constexpr double clearly_better = 0.02;

/// Half of it is how it is usually, half how it is where it is bad.
double score_of(const std::vector<double>& errors) {
  return std::log(median_of(errors)) + std::log(capped_rmse_of(errors));
}

}  // namespace

int LogTuner::block_count() const { return std::clamp(result_.fixes / fixes_of_a_block, fewest_blocks, most_blocks); }

Precision LogTuner::precision_of(const Filter& filter, const Eigen::VectorXd& at) const {
  const SearchOptions bounds = search_options(filter, 1.0, 1);
  return precision_at([&](const Eigen::VectorXd& to) { return terms_at(filter, to).terms; }, at,
                      {.lower = bounds.lower,
                       .upper = bounds.upper,
                       .blocks = block_count(),
                       .threads = options_.threads,
                       .stop = [this] { return stopped(); }});
}

/// Rests of the fixes that were tuned on, to be withheld in turn.
std::vector<HoldOut> LogTuner::rests() const {
  const int every = std::max(options_.hold_out.every, fewest_rests);
  std::vector<HoldOut> rests;
  for (int phase = 0; phase < every && std::ssize(rests) < rests_tried; ++phase)
    if (every != options_.hold_out.every || phase != options_.hold_out.phase) rests.push_back({every, phase});
  return rests;
}

/// Errors of the predictions of such a rest, without those that judge.
std::vector<double> LogTuner::errors_of(const Settings& settings, const HoldOut& rest) const {
  std::vector<double> errors;
  const std::vector<double> distances = log_.predictions(settings, rest, true);
  for (std::size_t i = 0; i < distances.size(); ++i)
    if (log_.entries()[i].counts && !std::isnan(distances[i])) errors.push_back(distances[i]);
  return errors;
}

/// Where the likelihood is rough, many points are as likely as the best, which is so by chance. Of these the one is
/// taken that predicts withheld fixes best.
void LogTuner::settle() {
  if (stopped() || tried_.empty()) return;
  RandomStream random(2, "settling");
  std::vector<Eigen::VectorXd> near(looks_about, at_);
  const SearchOptions bounds = search_options(filter_, 1.0, 1);
  for (Eigen::VectorXd& at : near) {
    for (double& coordinate : at) coordinate += nearby * random.normal();
    at = at.cwiseMax(bounds.lower).cwiseMin(bounds.upper);
  }
  const double best = terms_at(filter_, at_).likelihood.total;
  std::vector<double> squares(near.size());
  in_parallel(looks_about, options_.threads, [&](int i) {
    const double difference = terms_at(filter_, near[i]).likelihood.total - best;
    squares[i] = difference * difference;
  });
  // The median: a point beside it where the filter is lost for good is no measure.
  const double roughness = std::sqrt(median_of(squares));
  if (roughness < as_good) return;
  std::vector<std::pair<double, Eigen::VectorXd>> points;
  {
    const std::lock_guard lock(mutex_);
    points = tried_;
  }
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  const double least = points.front().first - 2.0 * roughness;
  const auto end = std::find_if(points.begin(), points.end(), [&](const auto& point) { return point.first < least; });
  points.resize(std::min<std::size_t>(static_cast<std::size_t>(end - points.begin()), most_settled));
  std::vector<double> scores(points.size(), std::numeric_limits<double>::infinity());
  in_parallel(static_cast<int>(points.size()), options_.threads, [&](int i) {
    if (stopped()) return;
    std::vector<double> errors;
    for (const HoldOut& rest : rests())
      for (const double error : errors_of(with_values(filter_.settings, filter_.tunables, points[i].second), rest))
        errors.push_back(error);
    if (!errors.empty()) scores[i] = score_of(errors);
  });
  const auto chosen = std::min_element(scores.begin(), scores.end());
  if (std::isfinite(*chosen)) at_ = points[static_cast<std::size_t>(chosen - scores.begin())].second;
}

void LogTuner::find_precision() {
  if (stopped()) return;
  const Precision found = precision_of(filter_, at_);
  if (stopped()) return;
  precision_ = found;
  is_told_.clear();
  for (int i = 0; i < size(); ++i) is_told_.push_back(!found.is_free[i] || found.error(i) < told_below);
  if (std::find(is_told_.begin(), is_told_.end(), false) != is_told_.end()) hold_what_is_not_told();
}

/// What the log does not tell goes back to what the scenario says, if that costs nothing.
void LogTuner::hold_what_is_not_told() {
  begin("holding what is not told");
  Filter told;
  Eigen::VectorXd all = at_, at(size());
  Eigen::Index count = 0;
  for (int i = 0; i < size(); ++i) {
    if (is_told_[i]) {
      told.tunables.push_back(filter_.tunables[i]);
      at[count++] = at_[i];
    } else {
      all[i] = 0.0;
    }
  }
  at.conservativeResize(count);
  told.settings = with_values(filter_.settings, filter_.tunables, all);
  if (count > 0) {
    const SearchOptions options = search_options(told, 0.1, evaluations_per_number * static_cast<int>(count));
    at = maximise([&](const Eigen::VectorXd& to) { return value_at(told, to); }, {at}, options).at;
  }
  count = 0;
  for (int i = 0; i < size(); ++i)
    if (is_told_[i]) all[i] = at[count++];
  const double value = terms_at(filter_, at_).likelihood.total, held = terms_at(filter_, all).likelihood.total;
  is_held_ = held > value - as_good;
  if (is_held_) at_ = all;
}

void LogTuner::take_values() {
  for (int i = 0; i < size(); ++i) {
    const Tunable& tunable = filter_.tunables[i];
    TunedNumber number;
    number.tunable = tunable;
    number.error = number.hessian_error = std::nan("");
    number.value = tunable.value_at(at_[i]);
    number.value = *Settings::scalar(fmt::format("{:.{}g}", number.value, written_digits)).number();
    if (std::abs(at_[i]) < 1e-9) number.value = tunable.start;
    if (precision_) {
      number.is_told = is_told_[i];
      number.is_at_bound = !precision_->is_free[i];
      number.error = tunable.error_of(precision_->error(i), number.value);
      number.hessian_error = tunable.error_of(precision_->hessian_errors[i], number.value);
    }
    result_.numbers.push_back(number);
  }
  note_what_is_not_told();

  Settings& to = result_.settings = settings_;
  if (result_.filter == "bank") {
    to.set("noise.adapt", Settings::scalar("false"));  // the noise was found from all of the log
    if (const Settings* priors = filter_.settings.find_path("estimator.priors")) to.set("estimator.priors", *priors);
  }
  to = with_values(std::move(to), filter_.tunables, at_, written_digits);
  const Terms after = terms_at(filter_, at_);
  result_.log_likelihood_after = after.likelihood.total;
  result_.degrees_after = after.likelihood.degrees;
}

/// The likelihood is that of a filter. Which estimator predicts best with what was found is seen by withholding fixes
/// that it was found from: the scenario's, the filter itself, or the scenario's as it was.
void LogTuner::choose_estimator() {
  struct Candidate {
    std::string name;
    Settings settings;
    std::vector<double> errors = {};
  };
  std::vector<Candidate> candidates{{estimator_ + ", tuned", result_.settings}};
  if (estimator_ != result_.filter) {
    Settings filter = result_.settings;
    filter.set("estimator.name", Settings::scalar(result_.filter));
    if (filter.find_path("estimator.robust")) filter.set("estimator.robust", Settings::null());
    candidates.push_back({result_.filter + ", tuned", filter});
  }
  if (result_.filter == "bank") {
    // Laws that suit the log best need not be better than those that were there.
    Settings laws = result_.settings;
    const Settings* const priors = settings_.find_path("estimator.priors");
    laws.set("estimator.priors", priors ? *priors : Settings::null());
    candidates.push_back({estimator_ + ", tuned but for its priors", laws});
  }
  candidates.push_back({estimator_ + ", as it was", settings_});
  const std::vector<HoldOut> withheld = rests();
  std::mutex mutex;
  in_parallel(static_cast<int>(candidates.size() * withheld.size()), options_.threads, [&](int k) {
    Candidate& candidate = candidates[static_cast<std::size_t>(k) / withheld.size()];
    const std::vector<double> errors =
        errors_of(candidate.settings, withheld[static_cast<std::size_t>(k) % withheld.size()]);
    const std::lock_guard lock(mutex);
    candidate.errors.insert(candidate.errors.end(), errors.begin(), errors.end());
  });
  const Candidate* best = nullptr;
  double least = 0.0;
  for (const Candidate& candidate : candidates) {
    if (candidate.errors.empty()) continue;
    const TriedEstimator tried{candidate.name, median_of(candidate.errors), capped_rmse_of(candidate.errors)};
    result_.estimators.push_back(tried);
    const double score = score_of(candidate.errors);
    if (best && score > least - clearly_better) continue;
    best = &candidate;
    least = score;
  }
  if (!best) return;
  for (TriedEstimator& tried : result_.estimators) tried.is_taken = tried.name == best->name;
  result_.settings = best->settings;
  if (best == &candidates.back())
    result_.remarks.push_back(
        fmt::format("The scenario as it was predicts the {} better than what is most likely by its filter: it is left "
                    "as it was.",
                    result_.entries_name));
}

void LogTuner::note_what_is_not_told() {
  std::vector<std::string> untold;
  for (const TunedNumber& number : result_.numbers) {
    if (number.is_at_bound)
      result_.remarks.push_back(
          fmt::format("{} is at the end of its range, {:.4g}: the log would have it beyond, or "
                      "does not bound it on that side.",
                      number.tunable.name, number.value));
    if (!number.is_told) untold.push_back(number.tunable.name);
  }
  if (!untold.empty())
    result_.remarks.push_back(
        fmt::format("This log tells little of {}: whatever their values (within a few times what "
                    "the scenario says), the {} are about as likely. {}.",
                    fmt::join(untold, "; "), result_.entries_name,
                    is_held_ ? "They are as the scenario has them"
                             : "They have their best values all the same, since together they matter"));
  if (precision_ && precision_->roughness > as_good)
    result_.remarks.push_back(fmt::format(
        "The likelihood is rough by {:.0f}: the filter loses its way somewhere, and finds it again by chance. "
        "Standard errors are those of a coarser look; numbers that differ by less are as good.",
        precision_->roughness));
  if (!precision_) {
    result_.remarks.emplace_back("Stopped before standard errors were known.");
    return;
  }
  for (int i = 0; i < size(); ++i) {
    for (int j = 0; j < i; ++j) {
      const double correlation = precision_->correlation(i, j);
      if (std::abs(correlation) >= confounded_from && precision_->is_free[i] && precision_->is_free[j])
        result_.confounded.push_back({filter_.tunables[j].name, filter_.tunables[i].name, correlation});
    }
  }
  std::sort(result_.confounded.begin(), result_.confounded.end(),
            [](const auto& a, const auto& b) { return std::abs(a.correlation) > std::abs(b.correlation); });
  for (std::size_t i = 0; i < std::min(result_.confounded.size(), most_named); ++i) {
    const ConfoundedPair& pair = result_.confounded[i];
    result_.remarks.push_back(
        fmt::format("{} and {} are confounded (correlation {:.2f}): an error of one hides in the other; measure one of "
                    "them, and give --keep for it.",
                    pair.first, pair.second, pair.correlation));
  }
  if (result_.confounded.size() > most_named)
    result_.remarks.push_back(
        fmt::format("So are {} more pairs; summary.json has all.", result_.confounded.size() - most_named));
}

void LogTuner::find_slices() {
  if (stopped() || !precision_) return;
  constexpr double points[] = {-2.0, -1.0, -0.5, 0.5, 1.0, 2.0};
  const SearchOptions bounds = search_options(filter_, 1.0, 1);
  const double top = terms_at(filter_, at_).likelihood.total;
  in_parallel(size(), options_.threads, [&](int i) {
    auto& slice = result_.numbers[i].slice;
    slice.emplace_back(filter_.tunables[i].value_at(at_[i]), 0.0);
    for (const double point : points) {
      Eigen::VectorXd to = at_;
      to[i] = std::clamp(at_[i] + point * precision_->widths[i], bounds.lower[i], bounds.upper[i]);
      if (stopped() || to[i] == at_[i]) continue;
      slice.emplace_back(filter_.tunables[i].value_at(to[i]), terms_at(filter_, to).likelihood.total - top);
    }
    std::sort(slice.begin(), slice.end());
  });
}

void LogTuner::judge() {
  if (options_.hold_out.every == 0) return;
  const bool smooths = options_.smooths && !stopped();  // it takes long
  const Settings* const scenarios[] = {&settings_, &result_.settings};
  const Settings filters[] = {before_.settings, with_values(filter_.settings, filter_.tunables, at_, written_digits)};
  std::vector<double> predicted[2], smoothed[2], densities[2], squares[2];
  std::vector<SensorSummary> sensors[2];
  int values[2] = {};  // of a withheld measurement
  in_parallel(2, options_.threads, [&](int k) {
    predicted[k] = log_.predictions(*scenarios[k], options_.hold_out, false);
    if (smooths) smoothed[k] = log_.interpolations(*scenarios[k], options_.hold_out);
    sensors[k] = log_.sensors(*scenarios[k], options_.hold_out);
    // The filter expects a measurement that nothing was tuned on from all before it.
    const std::vector<Innovation> found = log_.innovations(filters[k], {});
    const double degrees = k == 0 ? result_.degrees_before : result_.degrees_after;
    int whole = 0;
    for (std::size_t i = 0; i < found.size(); ++i)
      if (log_.entries()[i].is_judge) whole = std::max(whole, found[i].size);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const bool counts = log_.entries()[i].is_judge && found[i].size > 0 && found[i].size == whole;
      densities[k].push_back(counts ? log_density(found[i], degrees) : std::nan(""));
      squares[k].push_back(counts ? found[i].squared : std::nan(""));
    }
    values[k] = whole;
  });
  Pairs pairs;
  for (const TunedEntry& entry : log_.entries()) pairs.times.push_back(entry.time);
  const auto add = [&](const std::string& name, const std::string& unit, std::vector<double>* of,
                       const Statistic& statistic) {
    pairs.before = of[0];
    pairs.after = of[1];
    result_.judged.push_back(compare(name, unit, pairs, statistic, block_seconds));
  };
  const std::string &unit = result_.unit, withheld = "withheld " + result_.entries_name,
                    rmse = fmt::format("RMSE ({:g} {})", error_cap, unit);
  add(withheld + ": median", unit, predicted, median_of);
  add(withheld + ": " + rmse, unit, predicted, capped_rmse_of);
  if (smooths) {
    add("smoothed: median", unit, smoothed, median_of);
    add("smoothed: " + rmse, unit, smoothed, capped_rmse_of);
  }
  add("log likelihood of a " + result_.entry_name, "", densities, mean_of);
  // The median of chi-square with two degrees of freedom.
  if (values[1] == 2)
    add(fmt::format("NIS: median ({:.2f} if right)", 2.0 * std::numbers::ln2), "", squares, median_of);
  add(fmt::format("NIS: mean ({} if normal)", values[1]), "", squares, mean_of);
  for (std::size_t i = 0; i < sensors[0].size(); ++i)
    result_.sensors.push_back({sensors[0][i].name, sensors[0][i].expected, sensors[0][i].nis, sensors[1][i].nis});
}

}  // namespace rhec::sim
