#pragma once

#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/core/qp/stage_qp.hpp"
#include "rhec/sim/comparison/comparison.hpp"

namespace rhec::sim {

/// Assesses the answers to one problem after the other.
class Assessor {
 public:
  void begin(const HorizonProblem& problem);
  /// For a time that does not depend on who is asked first: brings the problem and its model into the caches.
  void warm_up(const Iterate& guess) { problem_->evaluate(guess, nullptr, scratch_); }
  /// The largest part of the residual; the defect goes into the answer.
  double kkt_of(const Iterate& point, Answer& answer);
  /// The point that counts: an estimate as it is, a plan by what its inputs do.
  void make_assessed(Iterate& point);

  struct Verdict {
    double objective = 0.0, charged = 0.0, defect = 0.0, violation = 0.0;
    bool is_feasible() const;
  };
  /// Defects and violations cost what the multipliers of `prices` say.
  Verdict verdict_on(const Iterate& assessed, const Iterate& prices);

  /// The largest difference, in units of the model's scales.
  double distance(const Iterate& a, const Iterate& b);

 private:
  const HorizonProblem* problem_ = nullptr;
  StageQp qp_;
  std::vector<double> scratch_, defects_, row_, other_row_;
};

}  // namespace rhec::sim
