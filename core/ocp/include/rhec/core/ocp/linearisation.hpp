#pragma once

#include <vector>

#include "rhec/core/ocp/ocp.hpp"

namespace rhec {

/// An OCP as a stage QP at an iterate. The OCP makes it (`Ocp::make_linearisation`); a solver holds it and asks for the
/// QP at one iterate after the other. It owns the QP, its workspace, and whatever it remembers of earlier iterates.
///
/// As it is, it evaluates everything anew. A problem whose horizon moves on from sample to sample derives its own,
/// which evaluates only what has changed; the QP is the same, but for rounding.
///
/// Refers to the OCP, which must outlive it. The constructor allocates, nothing else does. One caller at a time.
class RHEC_EXPORT Linearisation {
 public:
  explicit Linearisation(const Ocp& ocp);
  virtual ~Linearisation() = default;
  Linearisation(const Linearisation&) = delete;
  Linearisation& operator=(const Linearisation&) = delete;

  const Ocp& ocp() const noexcept { return ocp_; }
  const StageQp& qp() const noexcept { return qp_; }

  /// The whole QP at an iterate. Returns the objective there.
  virtual double linearise(const Iterate& iterate, Hessian hessian) noexcept;

  /// What the KKT residual at a new iterate takes: all but H. `next` is the Hessian that `prepare` is going to be asked
  /// for from there; one that remembers may do some of that work already. Returns the objective.
  virtual double linearise_for_residual(const Iterate& iterate, Hessian next) noexcept;

  /// AB, b and H, the sizes and the bounds at an iterate, while the newest data are still to come; `refresh` does the
  /// rest.
  virtual void prepare(const Iterate& iterate, Hessian hessian) noexcept;
  /// What depends on data that may have come since (measurements, references, the initial state, bounds): h, the bounds
  /// and the initial step.
  virtual void refresh(const Iterate& iterate) noexcept;

  /// Whether the QP was made at this very iterate, for stages of today's sizes.
  virtual bool is_at(const Iterate& iterate) const noexcept;
  /// Forgets all that is remembered.
  virtual void forget() noexcept;

 protected:
  StageQp qp_;
  std::vector<double> scratch_;  ///< of the OCP's `scratch_size()`

 private:
  void remember(const Iterate& iterate) noexcept;

  const Ocp& ocp_;
  Iterate iterate_;        ///< that the QP was made at
  bool is_known_ = false;  ///< whether it is
};

}  // namespace rhec
