// Solvers that are wrong on purpose, to see that a comparison sees it.
#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace {

enum class Kind { worse, defect, refuse_rhe, lost };

struct ToyOptions {
  Kind kind = Kind::worse;
  static const rhec::OptionTable<ToyOptions>& table() {
    static const auto options = rhec::OptionTable<ToyOptions>().choice(
        "kind", &ToyOptions::kind,
        {{"worse", Kind::worse}, {"defect", Kind::defect}, {"refuse_rhe", Kind::refuse_rhe}, {"lost", Kind::lost}},
        "what is wrong with it");
    return options;
  }
};

class ToySolver : public rhec::Solver {
 public:
  using Options = ToyOptions;
  explicit ToySolver(const Options& options) : kind_(options.kind) {}

  std::string why_not(const rhec::Ocp& ocp) const override {
    return kind_ == Kind::refuse_rhe && !ocp.can_roll_out() ? "a toy cannot look back" : "";
  }
  void setup(const rhec::Ocp& ocp) override {
    ocp_ = &ocp;
    qp_ = rhec::StageQp(ocp.capacity());
    scratch_.assign(ocp.scratch_size(), 0.0);
  }
  void prepare(const rhec::Iterate&) noexcept override {}

  using Solver::solve;
  rhec::Report solve(rhec::Iterate& point, rhec::Clock::time_point) noexcept override {
    const rhec::Ocp& ocp = *ocp_;
    rhec::Report report;
    report.iterations = 1;
    report.status = kind_ == Kind::lost ? rhec::Status::infeasible : rhec::Status::solved;  // or so it says
    if (kind_ == Kind::worse || kind_ == Kind::refuse_rhe) go_astray(ocp, point);
    if (kind_ == Kind::defect) ignore_the_dynamics(ocp, point);
    report.objective = ocp.evaluate(point, nullptr, scratch_);
    report.kkt = rhec::kkt_residual(ocp, point, qp_, scratch_);
    return report;
  }
  void reset() noexcept override {}

 private:
  /// A point that keeps every constraint, and is no optimum.
  void go_astray(const rhec::Ocp& ocp, rhec::Iterate& point) noexcept {
    for (int i = 0; i < ocp.intervals(); ++i)
      for (int j = 0; j < ocp.control_count(i); ++j) point.control(i)[j] += 0.01;
    if (!ocp.initial_state()) point.state(0)[0] += 0.02;
    rhec::roll_out(ocp, point, scratch_);
  }

  /// Each node goes where its own cost is least: far below the optimum, but no vehicle drives so.
  void ignore_the_dynamics(const rhec::Ocp& ocp, rhec::Iterate& point) noexcept {
    ocp.linearise(rhec::all_stages(ocp), point, rhec::Hessian::gauss_newton, qp_, scratch_);
    for (int i = ocp.initial_state() ? 1 : 0; i <= ocp.intervals(); ++i) {
      const int n = ocp.state_count(i);
      const Eigen::Map<const Eigen::VectorXd> q(qp_.q(i), n);
      const Eigen::MatrixXd symmetric = Q_of(qp_, i);
      const Eigen::VectorXd step = symmetric.completeOrthogonalDecomposition().solve(-q);
      for (int j = 0; j < n; ++j)
        point.state(i)[j] = std::clamp(point.state(i)[j] + step[j], ocp.state_lower(i)[j], ocp.state_upper(i)[j]);
    }
  }

  Kind kind_;
  const rhec::Ocp* ocp_ = nullptr;
  rhec::StageQp qp_;
  std::vector<double> scratch_;
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::solver, ToySolver, {.name = "toy_solver", .version = "1.0", .licence = "BSD-2-Clause"});
