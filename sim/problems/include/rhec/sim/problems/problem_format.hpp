#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/problems/problem_record.hpp"

namespace rhec::sim {

class LineValue;

/// What files and comparisons have to know of one kind of problem: how it is written on a line, how its problem is made
/// of a record, and how a problem is copied. There is one object for each kind, which has no state.
class RHEC_EXPORT ProblemFormat {
 public:
  struct Traits {
    std::string_view kind;             ///< HorizonProblem::kind of its problems, and `problem` on their lines
    std::vector<std::string> keys;     ///< of a line
    std::vector<std::string> since_2;  ///< further keys, which came with version 2
    bool looks_back = false;           ///< its window ends at the step that it belongs to, and does not begin there
    bool may_be_empty = false;         ///< since version 2: it may have no interval yet
    bool has_interval_bounds = false;  ///< since version 2: bounds may differ from interval to interval
    bool finds_parameters = false;     ///< parameters are a part of its solution
  };
  virtual ~ProblemFormat();
  ProblemFormat(const ProblemFormat&) = delete;
  ProblemFormat& operator=(const ProblemFormat&) = delete;

  const Traits& traits() const noexcept { return traits_; }

  /// Reads what this kind has beside the keys that all kinds have. Throws Error naming file, line and key.
  virtual void read(const LineValue& line, ProblemRecord& record) const = 0;
  virtual void write(const ProblemRecord& record, Json& line) const = 0;

  /// Puts a problem's data into its record, whose horizon is there already.
  virtual void keep(const HorizonProblem& problem, ProblemRecord& record) const = 0;
  /// As the functions of problem_record.hpp.
  virtual std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                                int max_intervals, std::vector<int> one_block) const = 0;
  virtual bool refill(const ProblemRecord& record, HorizonProblem& problem) const = 0;

  /// What a guess without a history begins with.
  struct ColdStart {
    std::vector<double> state, parameters;
    std::vector<double> inputs;  ///< interval by interval; NaN where nothing is known
  };
  virtual ColdStart cold_start(const ProblemRecord& record, const ModelDescription& about) const = 0;

  virtual std::unique_ptr<HorizonProblem> copy(const HorizonProblem& problem) const = 0;
  /// Into a problem of the same set-up.
  virtual void take_data(const HorizonProblem& from, HorizonProblem& to) const = 0;

 protected:
  explicit ProblemFormat(Traits traits);

 private:
  Traits traits_;
};

/// The format of a kind of problem; null where there is none.
RHEC_EXPORT const ProblemFormat* find_problem_format(std::string_view kind) noexcept;
/// The same; throws Error, which names the kinds that have one.
RHEC_EXPORT const ProblemFormat& problem_format(std::string_view kind);
/// The kinds that have a format.
RHEC_EXPORT std::vector<std::string> problem_kinds();

}  // namespace rhec::sim
