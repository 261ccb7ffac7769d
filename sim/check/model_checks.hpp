#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/model/step_requirement.hpp"
#include "rhec/sim/check/model_check.hpp"

// The individual checks of `check_model`. Each returns at least one finding.
namespace rhec::sim {

/// More Runge-Kutta steps in an interval than this are worth a word.
inline constexpr int costly_substeps = 8;

/// Derivatives are compared at so many stages: they fill SIMD packs and leave one partly filled.
inline constexpr int stages_of_a_range = 15;
inline constexpr double derivative_tolerance = 1e-6;

/// Input of every check.
struct CheckedModel {
  Model& model;
  const ModelDescription& about;  ///< with the bounds to respect
  const ModelCheckOptions& options;
  std::vector<double> output_sigmas, input_sigmas;
  int substeps = 1;  ///< of the options, or those that the model needs
};

/// Findings of one check.
class FindingList {
 public:
  explicit FindingList(std::string check) : check_(std::move(check)) {}
  using Numbers = std::vector<std::pair<std::string, double>>;

  void fail(std::string where, std::string found, std::string advice, Numbers numbers = {}) {
    add(Verdict::fail, std::move(where), std::move(found), std::move(advice), std::move(numbers));
  }
  void warn(std::string where, std::string found, std::string advice, Numbers numbers = {}) {
    add(Verdict::warn, std::move(where), std::move(found), std::move(advice), std::move(numbers));
  }
  void pass(std::string found, Numbers numbers = {}, std::string where = {}) {
    add(Verdict::pass, std::move(where), std::move(found), {}, std::move(numbers));
  }
  void skip(std::string found) { add(Verdict::skip, {}, std::move(found), {}, {}); }
  bool empty() const { return all_.empty(); }
  std::vector<Finding> take() { return std::move(all_); }

 private:
  void add(Verdict verdict, std::string where, std::string found, std::string advice, Numbers numbers) {
    all_.push_back({check_, verdict, std::move(where), std::move(found), std::move(advice), std::move(numbers)});
  }

  std::string check_;
  std::vector<Finding> all_;
};

/// How long a call that does `range` stages takes for one of them [ns].
template <class Call>
Spread time_of_calls(int range, const Call& call) {
  using Clock = std::chrono::steady_clock;
  constexpr int calls = 300;
  constexpr double longest = 0.05;  // of one measurement [s]
  std::vector<double> nanoseconds;
  call();
  double seconds = 0.0;
  for (int i = 0; i < calls && seconds < longest; ++i) {
    const auto start = Clock::now();
    call();
    const std::chrono::duration<double> taken = Clock::now() - start;
    seconds += taken.count();
    nanoseconds.push_back(1e9 * taken.count() / range);
  }
  return spread_of(nanoseconds);
}

/// `can_go_on`: whether the description suffices to evaluate the model.
std::vector<Finding> check_description(const ModelDescription& about, bool& can_go_on);
std::vector<Finding> check_symmetry(const CheckedModel& checked);
std::vector<Finding> check_straight_motion(const CheckedModel& checked);
/// At its speed, or where the inputs have their typical magnitudes.
StepRequirement required_steps(const CheckedModel& checked);
std::vector<Finding> check_integration(const CheckedModel& checked, const StepRequirement& needed);
std::vector<Finding> check_derivatives(const CheckedModel& checked);
std::vector<Finding> check_numbers(const CheckedModel& checked);
/// Checks "scaling" and "observability", which use the same drives.
std::vector<Finding> check_drives(const CheckedModel& checked, std::vector<DriveInformation>& drives);
std::vector<Finding> measure_times(const CheckedModel& checked, std::vector<EvaluationTimes>& times);

/// The state at the origin with all bodies in line along `direction`, all else 0 or as close to 0 as bounds allow.
std::vector<double> state_in_line(const CheckedModel& checked, double direction);
/// The ground speed at which the largest input has its typical magnitude; none if no input produces speed [m/s].
std::optional<double> typical_speed(const CheckedModel& checked);

}  // namespace rhec::sim
