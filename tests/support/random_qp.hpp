#pragma once

#include <random>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/qp/riccati.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"

namespace rhec::testing {

/// Random strictly convex stage QPs and their dense counterpart, for tests of the stage-wise algebra.
class RandomQp {
 public:
  explicit RandomQp(unsigned seed) : random_(seed) {}

  double uniform(double lower, double upper) { return std::uniform_real_distribution<double>(lower, upper)(random_); }
  int integer(int lower, int upper) { return std::uniform_int_distribution<int>(lower, upper)(random_); }

  /// Controls per stage vary between 0 and the capacity's. Bounds are infinite.
  StageQp make(int intervals, int states, int controls, bool given);

  /// Makes most intervals carry over some of their last states unchanged, and declares that or not.
  void carry(StageQp& qp, bool says_so = true);

 private:
  std::mt19937 random_;
};

/// The same QP as one dense system: variables [s_0; w_0; s_1; ...], equality rows for dynamics and active bounds.
struct DenseQp {
  Eigen::MatrixXd H, E;
  Eigen::VectorXd g, e;
  std::vector<int> state_at, control_at;
  int dynamics_rows = 0;

  DenseQp(const StageQp& qp, const ActiveSet& active);

  /// [z; multipliers] of the equality-constrained QP.
  Eigen::VectorXd solve() const;
};

}  // namespace rhec::testing
