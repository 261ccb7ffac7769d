// A solver: sequential quadratic programming with a line search; the method is in newton.hpp. To write one of your own,
// replace newton.hpp, and change the options and the names in RHEC_PLUGIN. rhec/core/ocp/solver.hpp says what a solver
// must do.
//
// This one does not prepare before the newest data arrive, keeps nothing but the iterate from one solve to the next,
// computes no covariances, and takes no stages wider than the Riccati recursion does. With distant guesses on long
// horizons, or with many active bounds, it may end with iteration_limit or stalled.
#include "newton.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace {

struct PlainSqpOptions {
  double tolerance = 1e-8;
  int max_iterations = 200;

  static const rhec::OptionTable<PlainSqpOptions>& table() {
    static const auto rows =
        rhec::OptionTable<PlainSqpOptions>()
            .number("tolerance", &PlainSqpOptions::tolerance, "KKT residual of a solution", rhec::greater_than(0.0))
            .integer("max_iterations", &PlainSqpOptions::max_iterations, "limit of steps", rhec::between(1, 100000));
    return rows;
  }
};

class PlainSqp : public rhec::Solver {
 public:
  using Options = PlainSqpOptions;
  explicit PlainSqp(const Options& options) : options_(options) {}

  /// Why this solver cannot take a problem; empty: it can. The caller shows the reason to the user.
  std::string why_not(const rhec::Ocp& ocp) const override {
    if (std::max(ocp.capacity().states, ocp.capacity().controls) <= rhec::Riccati::max_width) return {};
    return "a stage has more than " + std::to_string(rhec::Riccati::max_width) + " states or controls";
  }

  /// Takes on the problem to solve and allocates all memory for its capacity.
  void setup(const rhec::Ocp& ocp) override {
    if (const std::string reason = why_not(ocp); !reason.empty()) throw rhec::Error("solver 'plain_sqp': " + reason);
    ocp_ = &ocp;
    newton_ = Newton(ocp);
  }

  void prepare(const rhec::Iterate&) noexcept override {}
  void reset() noexcept override {}

  using Solver::solve;
  rhec::Report solve(rhec::Iterate& iterate, rhec::Clock::time_point deadline) noexcept override {
    rhec::Report report;  // its status is bad_input
    if (!ocp_ || !is_sound_start(*ocp_, iterate, newton_.merit.scratch)) return report;
    newton_.best = iterate;
    if (ocp_->initial_state()) std::copy_n(ocp_->initial_state(), ocp_->state_count(0), newton_.best.state(0));
    report.status = newton_.minimise(*ocp_, options_.tolerance, options_.max_iterations, deadline, report);
    if (report.status != rhec::Status::infeasible) iterate = newton_.best;
    assess(*ocp_, iterate, newton_.qp, newton_.merit.scratch, report);  // the core computes objective and KKT residual
    return report;
  }

 private:
  Options options_;
  const rhec::Ocp* ocp_ = nullptr;
  Newton newton_;
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::solver, PlainSqp,
            {.name = "plain_sqp",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "Newton's method with a line search, to the tolerance"});
