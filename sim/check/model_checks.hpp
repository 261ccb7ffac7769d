#pragma once

#include <string>
#include <utility>
#include <vector>

#include "rhec/core/model/step_requirement.hpp"
#include "rhec/sim/check/model_check.hpp"

// The individual checks of `check_model`. Each returns at least one finding.
namespace rhec::sim {

/// More Runge-Kutta steps in an interval than this are worth a word.
inline constexpr int costly_substeps = 8;

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
