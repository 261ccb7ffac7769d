#pragma once

#include <limits>

#include "merit.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/riccati.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"

/// The method of plain_sqp: Newton steps for the dynamics and an augmented Lagrangian of the bounds, computed by the
/// core's Riccati recursion, with a line search on Merit.
class Newton {
 public:
  using Iterate = rhec::Iterate;
  using Ocp = rhec::Ocp;
  using Status = rhec::Status;
  static constexpr double least_damping = 1e-10;

  Newton() = default;
  explicit Newton(const Ocp& ocp)
      : qp(ocp.capacity()), merit(ocp), riccati_(ocp.capacity()), none_active_(ocp.capacity()) {
    for (Iterate* each : {&best, &step_, &trial_, &terms_}) *each = Iterate(ocp.capacity());
  }

  Iterate best;
  rhec::StageQp qp;
  Merit merit;

  /// Improves `best`, which is always finite, and returns why it stopped.
  Status minimise(const Ocp& ocp, double tolerance, int max_iterations, rhec::Clock::time_point deadline,
                  rhec::Report& report) noexcept {
    // Residuals are small in estimation, where the Gauss-Newton Hessian suffices; in control under slip they are large.
    const bool exact = ocp.preferred_hessian() == rhec::Hessian::exact;
    merit.price = 0.0;
    merit.multipliers = best;
    double curvature = 0.0, damping = 0.0, outside_before = std::numeric_limits<double>::infinity();
    for (;; ++report.iterations) {
      ocp.linearise(all_stages(ocp), best, exact ? rhec::Hessian::exact : rhec::Hessian::gauss_newton, qp,
                    merit.scratch);
      if (report.iterations == 0) {
        curvature = largest_curvature();
        merit.weight = 0.01 * curvature;
        damping = least_damping * curvature;
      }
      merit.cost_of_bounds(ocp, best);
      const rhec::KktResidual kkt = kkt_residual(qp, best);
      if (kkt.largest() <= tolerance) return Status::solved;
      if (report.iterations == max_iterations) return Status::iteration_limit;
      if (rhec::Clock::now() > deadline) return Status::deadline;
      const double outside = std::max(kkt.bound_violation, kkt.complementarity);
      if (std::max(kkt.stationarity, kkt.defect) <= std::max(0.1 * tolerance, 0.01 * outside)) {
        // Minimised for these multipliers: update them, and raise the weight if the violation has hardly decreased.
        const double heaviest = 1e5 * curvature;
        if (merit.weight >= heaviest && kkt.bound_violation > 0.5 * outside_before) return Status::infeasible;
        if (outside > 0.1 * outside_before) merit.weight = std::min(10.0 * merit.weight, heaviest);
        outside_before = outside;
        merit.multipliers = best;
        merit.cost_of_bounds(ocp, best);
      }
      ++report.factorisations;
      const double length = find_step(ocp, damping) ? take_step(ocp, kkt.largest()) : 0.0;
      // Full steps need less damping; very short steps indicate directions that hardly anything determines.
      if (length == 1.0) damping = std::max(0.01 * damping, least_damping * curvature);
      if (length < 0.01) damping = std::max(10.0 * damping, 1e-9 * curvature);
      if (length == 0.0 && !(damping < curvature)) return Status::stalled;
    }
  }

 private:
  double largest_curvature() const {
    double largest = 1.0;
    for (int i = 0; i <= qp.intervals(); ++i) {
      for (int j = 0; j < qp.states(i); ++j) largest = std::max(largest, Q_of(qp, i)(j, j));
      for (int j = 0; j < qp.controls(i); ++j) largest = std::max(largest, R_of(qp, i)(j, j));
    }
    return largest;
  }

  /// The Newton step from `best`. A little damping determines the directions that nothing else does.
  bool find_step(const Ocp& ocp, double damping) noexcept {
    for (int i = 0; i <= qp.intervals(); ++i) {
      const auto add_terms = [&](const double* gradient, const double* multiplier, double* sum, double* diagonal,
                                 int n) {
        for (int j = 0; j < n; ++j) {
          sum[j] = gradient[j] + multiplier[j];
          diagonal[j] = multiplier[j] == 0.0 ? damping : merit.weight;
        }
      };
      add_terms(qp.q(i), best.state_bound(i), terms_.state(i), terms_.state_bound(i), qp.states(i));
      if (i == qp.intervals()) break;
      add_terms(qp.r(i), best.control_bound(i), terms_.control(i), terms_.control_bound(i), qp.controls(i));
    }
    riccati_.factor(qp, none_active_, terms_.bound_row(0));
    return riccati_.solve(qp, none_active_, step_, terms_.row(0)) == rhec::Riccati::Outcome::done &&
           is_finite(ocp, step_);
  }

  /// Halves the step until it improves the merit or, near the solution, where merit differences are rounding, the
  /// residual.
  double take_step(const Ocp& ocp, double residual) noexcept {
    merit.price = std::max(merit.price, 1.5 * largest_costate(ocp, step_));
    const double before = merit(ocp, best);
    for (double length = 1.0; length > 1e-7; length *= 0.5) {
      for (int i = 0; i <= ocp.intervals(); ++i) {
        for (int j = 0; j < ocp.state_count(i); ++j) {
          trial_.state(i)[j] = best.state(i)[j] + length * step_.state(i)[j];
          trial_.costate(i)[j] = best.costate(i)[j] + length * (step_.costate(i)[j] - best.costate(i)[j]);
        }
        for (int j = 0; i < ocp.intervals() && j < ocp.control_count(i); ++j)
          trial_.control(i)[j] = best.control(i)[j] + length * step_.control(i)[j];
      }
      const double after = merit(ocp, trial_);
      bool pays = after <= before + 1e-13 * (1.0 + std::abs(before));  // differences below this are rounding
      if (!pays && length == 1.0 && residual < 1e-3 && std::isfinite(after))
        pays = kkt_residual(ocp, trial_, qp, merit.scratch).largest() < 0.5 * residual;
      if (!pays) continue;
      std::swap(best, trial_);
      return length;
    }
    return 0.0;
  }

  rhec::Riccati riccati_;
  rhec::ActiveSet none_active_;
  Iterate step_, trial_;
  Iterate terms_;  ///< gradients; its bound multipliers hold the diagonals that the Riccati recursion adds
};
