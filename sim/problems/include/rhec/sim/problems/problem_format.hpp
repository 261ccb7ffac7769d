#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/problems/problem_record.hpp"

namespace rhec::sim {

class LineValue;

/// What files and comparisons need to know about one kind of problem: its line format, how to build the problem from a
/// record, and how to copy it. There is one stateless object per kind.
class RHEC_EXPORT ProblemFormat {
 public:
  struct Traits {
    std::string_view kind;          ///< HorizonProblem::kind of its problems, and `problem` on their lines
    std::vector<std::string> keys;  ///< keys of a line
    std::map<int, std::vector<std::string>> added;  ///< further keys, by the version that added them
    bool looks_back = false;                        ///< its window ends at its step instead of starting there
    bool may_be_empty = false;                      ///< since version 2: it may have no intervals yet
    bool has_interval_bounds = false;               ///< since version 2: bounds may differ between intervals
    bool finds_parameters = false;                  ///< parameters are part of its solution
  };
  virtual ~ProblemFormat();
  ProblemFormat(const ProblemFormat&) = delete;
  ProblemFormat& operator=(const ProblemFormat&) = delete;

  const Traits& traits() const noexcept { return traits_; }

  /// Reads the keys specific to this kind. Throws Error naming file, line and key.
  virtual void read(const LineValue& line, ProblemRecord& record) const = 0;
  virtual void write(const ProblemRecord& record, Json& line) const = 0;

  /// Stores a problem's data in its record, whose horizon is already set.
  virtual void keep(const HorizonProblem& problem, ProblemRecord& record) const = 0;
  /// See the functions of the same names in problem_record.hpp.
  virtual std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                                int max_intervals, std::vector<int> one_block) const = 0;
  virtual bool refill(const ProblemRecord& record, HorizonProblem& problem) const = 0;

  /// Start of an initial guess without history.
  struct ColdStart {
    std::vector<double> state, parameters;
    std::vector<double> inputs;  ///< by interval; NaN if unknown
  };
  virtual ColdStart cold_start(const ProblemRecord& record, const ModelDescription& about) const = 0;

  virtual std::unique_ptr<HorizonProblem> copy(const HorizonProblem& problem) const = 0;
  /// Copies data to a problem with the same set-up.
  virtual void take_data(const HorizonProblem& from, HorizonProblem& to) const = 0;

 protected:
  explicit ProblemFormat(Traits traits);

 private:
  Traits traits_;
};

/// The format of a kind of problem; null if there is none.
RHEC_EXPORT const ProblemFormat* find_problem_format(std::string_view kind) noexcept;
/// The same, but throws Error listing the known kinds if there is none.
RHEC_EXPORT const ProblemFormat& problem_format(std::string_view kind);
/// All kinds with a format.
RHEC_EXPORT std::vector<std::string> problem_kinds();

}  // namespace rhec::sim
