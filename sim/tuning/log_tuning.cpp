#include "log_tuner.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/numbers/random.hpp"
#include "tuned_tables.hpp"

namespace rhec::sim {
namespace {

// Another law must gain more than `as_good`, and than so many standard errors of its gain.
constexpr double gain_errors = 1.64;
constexpr int evaluations_of_a_law = 60, most_rounds = 12;
// What an objective is where there is none, below its start.
constexpr double hopeless = 1e4;

double width_of(const Variable& parameter) {
  const double width = parameter.upper - parameter.lower;
  return std::isfinite(width) && width > 0.0 ? width : 2.0 * parameter.scale;
}

Settings law_of(const std::string& name, const std::vector<std::pair<std::string, double>>& numbers) {
  Settings law = Settings::map();
  law.add("name", Settings::scalar(name));
  for (const auto& [key, value] : numbers)
    law.add(key, Settings::scalar(fmt::format("{:.{}g}", value, written_digits)));
  return law;
}

bool is_better(const TriedLaw& law) { return law.gain > as_good && law.gain > gain_errors * law.gain_error; }

}  // namespace

LogTuner::LogTuner(const Settings& settings, const TunedLog& log, const LogTuningOptions& options,
                   const TuningHooks& hooks)
    : log_(log), settings_(settings), options_(options), hooks_(hooks), robot_(log.robot(settings)) {
  const Settings* const name = settings.find("name");
  result_.variant = name ? name->as_text() : "log";
  result_.entry_name = log.entry_name(false);
  result_.entries_name = log.entry_name(true);
  result_.unit = log.withheld_unit();
  estimator_ = robot_.estimator_options().name;
  // Windows of blocks have the filter's process noise in their arrival cost.
  result_.filter = estimator_ == "ekf" || (estimator_ == "rhe" && robot_.has_blockings()) ? "ekf" : "bank";
  for (const TunedEntry& entry : log.entries()) counts_.push_back(entry.counts);
  make_filter();
}

LogTuning LogTuner::run() {
  const Eigen::VectorXd start = Eigen::VectorXd::Zero(size());
  // The scenario's own mistakes show up here, not as a failed search.
  begin("looking at the scenario");
  const std::vector<Innovation> judged = log_.innovations(filter_.settings, options_.hold_out);
  for (std::size_t i = 0; i < judged.size(); ++i) counts_[i] = counts_[i] && judged[i].size > 0;
  const Terms first = terms_of(filter_.settings);
  if (first.likelihood.count < least_fixes)
    throw Error(fmt::format(
        "{}: {} {} are left to tune on, once those withheld and those before the heading is known are taken off; "
        "expected at least {}; give a longer log, or withhold fewer",
        log_.name(), first.likelihood.count, result_.entries_name, least_fixes));
  result_.fixes = first.likelihood.count;
  result_.log_likelihood_before = first.likelihood.total;
  result_.degrees_before = first.likelihood.degrees;
  start_value_ = first.likelihood.total;
  before_ = filter_;

  at_ = start;
  begin("searching");
  search(0.5);
  if (result_.filter == "bank") {
    begin("trying laws");
    for (const Variable& parameter : parameters())
      if (!stopped()) try_laws(parameter);
    begin("searching on");
    if (!stopped()) search(0.2);
  }
  begin("settling");
  settle();
  begin("precision");
  find_precision();
  take_values();
  begin("choosing the estimator");
  choose_estimator();
  begin("slices");
  find_slices();
  begin("judging");
  judge();
  result_.stopped = stopped_;
  result_.evaluations = evaluations_;
  result_.seconds = seconds();
  return std::move(result_);
}

double LogTuner::seconds() const { return std::chrono::duration<double>(Clock::now() - began_).count(); }

bool LogTuner::stopped() const {
  if (!stopped_ && ((hooks_.stop && hooks_.stop()) || seconds() > options_.most_seconds)) stopped_ = true;
  return stopped_;
}

void LogTuner::begin(const std::string& stage) {
  const std::lock_guard lock(mutex_);
  stage_ = stage;
  tell();
}

void LogTuner::tell() const {
  if (hooks_.progress) hooks_.progress({stage_, evaluations_, best_value_ - start_value_, seconds()});
}

/// The filter behind the estimator. It has no robust loss: that decides by the fix whether to follow it, and the
/// likelihood would be torn. The likelihood has tails of its own.
void LogTuner::make_filter() {
  filter_.settings = settings_;
  Settings& to = filter_.settings;
  to.set("noise.adapt", Settings::scalar("false"));
  to.set("estimator.name", Settings::scalar(result_.filter));
  to.set("estimator.robust", Settings::null());
  to.set("estimator.memory", Settings::null());
  if (result_.filter == "bank") {
    to.set("blocking", Settings::null());
    for (const Variable& parameter : parameters()) {
      const std::string key = "estimator.priors." + parameter.name;
      const Settings* given = to.find_path(key);
      if (given && given->kind() == Settings::Kind::map) continue;
      to.set(key, law_of("walk", {{"sigma", 0.01 * width_of(parameter)}}));
    }
  }
  filter_.tunables = log_.tunables(to, options_.wishes);
  if (filter_.tunables.empty()) throw Error("nothing is left to tune; keep fewer numbers");
}

/// The likelihood of the log by a scenario, entry by entry. One that was judged at the start and is not now, such as
/// the first one behind a delay that has grown, counts as the mean of its sensor: nothing is gained by leaving some
/// out.
LogTuner::Terms LogTuner::terms_of(const Settings& settings) const {
  const std::vector<Innovation> found = log_.innovations(settings, options_.hold_out);
  Terms terms{log_likelihood(found, counts_), {}};
  terms.terms.resize(std::count(counts_.begin(), counts_.end(), true));
  std::map<int, std::pair<double, int>> sums;
  std::vector<double> densities(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!counts_[i] || found[i].size == 0) continue;
    auto& [sum, count] = sums[log_.entries()[i].sensor];
    sum += densities[i] = log_density(found[i], terms.likelihood.degrees);
    ++count;
  }
  Eigen::Index next = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!counts_[i]) continue;
    if (found[i].size == 0) {
      const auto& [sum, count] = sums[log_.entries()[i].sensor];
      densities[i] = count > 0 ? sum / count : -hopeless;
      terms.likelihood.total += densities[i];
    }
    terms.terms[next++] = densities[i];
  }
  return terms;
}

LogTuner::Terms LogTuner::terms_at(const Filter& filter, const Eigen::VectorXd& at) const {
  Terms terms = terms_of(with_values(filter.settings, filter.tunables, at));
  const std::lock_guard lock(mutex_);
  ++evaluations_;
  tell();
  return terms;
}

/// The log likelihood with the prior of the coordinates. Where a scenario cannot be made or replayed, as with a lever
/// arm so long that a wheel would run backwards, it is worse than anything that is finite.
double LogTuner::value_at(const Filter& filter, const Eigen::VectorXd& at) const {
  try {
    const double value = terms_at(filter, at).likelihood.total - 0.5 * at.squaredNorm();
    if (!std::isfinite(value)) return start_value_ - hopeless;
    const std::lock_guard lock(mutex_);
    if (&filter == &filter_) tried_.emplace_back(value, at);
    return value;
  } catch (const Error&) {  // the scenario at the start has been tried, and is fine
    return start_value_ - hopeless;
  }
}

SearchOptions LogTuner::search_options(const Filter& filter, double step, int most_evaluations) const {
  const auto n = static_cast<Eigen::Index>(filter.tunables.size());
  SearchOptions options;
  options.lower.resize(n);
  options.upper.resize(n);
  options.step = Eigen::VectorXd::Constant(n, step);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Tunable& tunable = filter.tunables[static_cast<std::size_t>(i)];
    options.lower[i] = tunable.coordinate_of(tunable.lower);
    options.upper[i] = tunable.coordinate_of(tunable.upper);
  }
  options.most_evaluations = most_evaluations;
  options.tolerance = 0.02;
  options.threads = options_.threads;
  options.stop = [this] { return stopped(); };
  return options;
}

/// The likelihood of a real log is rough, since a filter that has lost its way finds it again or not by chance, and a
/// search that takes that for a maximum ends. So it is begun anew from the best point and beside it, until that gains
/// nothing.
void LogTuner::search(double step) {
  RandomStream random(1, "starts");
  double best = -std::numeric_limits<double>::infinity();
  int idle = 0;
  for (int round = 0; round < most_rounds && idle < 2 && !stopped(); ++round) {
    SearchOptions options = search_options(filter_, step, evaluations_per_number * size());
    options.progress = [this](const Eigen::VectorXd& at, double value) {
      const std::lock_guard lock(mutex_);
      best_value_ = std::max(best_value_, value + 0.5 * at.squaredNorm());
    };
    std::vector<Eigen::VectorXd> starts{at_};
    for (int i = 1; i < std::max(2, options_.threads); ++i) {
      starts.push_back(at_);
      for (double& coordinate : starts.back()) coordinate += step * random.normal();
      starts.back() = starts.back().cwiseMax(options.lower).cwiseMin(options.upper);
    }
    const Maximum found =
        maximise([this](const Eigen::VectorXd& at) { return value_at(filter_, at); }, starts, options);
    idle = found.value > best + as_good ? 0 : idle + 1;
    if (found.value > best) {
      best = found.value;
      at_ = found.at;
    }
    step = std::max(0.5 * step, 0.1);
  }
}

/// A law of a parameter with the numbers that suit it best, while all others keep their values.
LogTuner::Trial LogTuner::try_law(const std::string& key, const Settings& law) const {
  Trial trial;
  trial.law = {.key = key, .law = law.find("name")->text()};
  Settings& settings = trial.filter.settings = with_values(filter_.settings, filter_.tunables, at_);
  settings.set(key, law);
  for (const Tunable& tunable : log_.tunables(settings, options_.wishes))
    if (tunable.name.starts_with(key)) trial.filter.tunables.push_back(tunable);
  Eigen::VectorXd at = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(trial.filter.tunables.size()));
  if (at.size() > 0) {
    SearchOptions options = search_options(trial.filter, 0.5, evaluations_of_a_law);
    options.threads = 1;
    options.tolerance = 0.2;
    at = maximise([&](const Eigen::VectorXd& to) { return value_at(trial.filter, to); }, {at}, options).at;
  }
  trial.terms = terms_at(trial.filter, at);
  settings = with_values(settings, trial.filter.tunables, at);
  return trial;
}

/// The gain, and its standard error by blocks of the log.
void LogTuner::compare_with(const Terms& present, Trial& trial) const {
  const Eigen::VectorXd gains = trial.terms.terms - present.terms;
  trial.law.gain = gains.sum();
  const int count = block_count();
  Eigen::VectorXd blocks = Eigen::VectorXd::Zero(count);
  for (Eigen::Index i = 0; i < gains.size(); ++i) blocks[i * count / gains.size()] += gains[i];
  trial.law.gain_error = std::sqrt((blocks.array() - blocks.mean()).square().sum() * count / (count - 1.0));
}

/// Numbers that stay keep their coordinates, so that the prior about what the scenario said stays, too.
void LogTuner::take(const Trial& trial) {
  const Filter before = filter_;
  const Eigen::VectorXd at = at_;
  for (const Settings::Member& section : trial.filter.settings.members())
    filter_.settings.set(section.first, section.second);
  filter_.tunables = log_.tunables(filter_.settings, options_.wishes);
  tried_.clear();
  at_ = Eigen::VectorXd::Zero(size());
  for (int i = 0; i < size(); ++i) {
    for (std::size_t j = 0; j < before.tunables.size(); ++j) {
      const std::string& name = before.tunables[j].name;
      if (name != filter_.tunables[i].name || name.starts_with(trial.law.key)) continue;
      filter_.tunables[i] = before.tunables[j];
      at_[i] = at[static_cast<Eigen::Index>(j)];
    }
  }
}

void LogTuner::try_laws(const Variable& parameter) {
  const std::string key = "estimator.priors." + parameter.name;
  const Settings* asked = settings_.find_path(key);
  if (asked && asked->kind() == Settings::Kind::map) return;  // a law that was chosen
  if (std::any_of(options_.wishes.keep.begin(), options_.wishes.keep.end(),
                  [&](const std::string& kept) { return key.starts_with(kept); }))
    return;
  const Terms present = terms_at(filter_, at_);
  const double sigma = 0.15 * width_of(parameter);
  const std::vector<Settings> laws = {law_of("matern", {{"length", 10.0}, {"sigma", sigma}}),
                                      law_of("jumps", {{"length", 10.0}, {"sigma", sigma}})};
  std::vector<std::optional<Trial>> trials(laws.size());
  in_parallel(static_cast<int>(laws.size()), options_.threads, [&](int i) {
    if (!stopped()) trials[i] = try_law(key, laws[i]);
  });
  const Trial* best = nullptr;
  for (std::optional<Trial>& trial : trials) {
    if (!trial) continue;
    compare_with(present, *trial);
    if (is_better(trial->law) && (!best || trial->law.gain > best->law.gain)) best = &*trial;
  }
  for (std::optional<Trial>& trial : trials) {
    if (!trial) continue;
    trial->law.is_taken = &*trial == best;
    result_.laws.push_back(trial->law);
  }
  if (best) take(*best);
}

LogTuning tune_on_log(const Host& host, const Settings& settings, const LogTables& tables,
                      const LogTuningOptions& options, const TuningHooks& hooks) {
  const TunedTables log(host, tables, settings, options.hold_out);
  return LogTuner(settings, log, options, hooks).run();
}

}  // namespace rhec::sim
