#pragma once

#include <vector>

#include "rhec/core/ocp/ocp.hpp"

namespace rhec {

/// A linearisation cache: the stage QP of an OCP at an iterate. The OCP makes it (`Ocp::make_linearisation`); a solver
/// holds it and asks for the QP at one iterate after the other. It owns the QP, its workspace, and what it keeps of
/// earlier iterates.
///
/// The base class evaluates everything anew. A problem whose horizon moves from sample to sample derives its own, which
/// evaluates only what has changed; the QP is the same up to rounding.
///
/// The OCP must outlive it. The constructor allocates, nothing else does. One caller at a time.
class RHEC_EXPORT Linearisation {
 public:
  explicit Linearisation(const Ocp& ocp);
  virtual ~Linearisation() = default;
  Linearisation(const Linearisation&) = delete;
  Linearisation& operator=(const Linearisation&) = delete;

  const Ocp& ocp() const noexcept { return ocp_; }
  const StageQp& qp() const noexcept { return qp_; }

  /// Writes the whole QP at an iterate. Returns the objective there.
  virtual double linearise(const Iterate& iterate, Hessian hessian) noexcept;

  /// Writes what the KKT residual at a new iterate needs: all but H. `next` is the Hessian that `prepare` will ask for
  /// at this iterate; a cache may do some of that work already. Returns the objective.
  virtual double linearise_for_residual(const Iterate& iterate, Hessian next) noexcept;

  /// Writes AB, b, H, the sizes and the bounds at an iterate before the newest data are known; `refresh` completes it.
  virtual void prepare(const Iterate& iterate, Hessian hessian) noexcept;
  /// Writes what depends on data that may be new (measurements, references, the initial state, bounds): h, the bounds
  /// and the initial step.
  virtual void refresh(const Iterate& iterate) noexcept;

  /// Whether the QP was made at exactly this iterate, with the present sizes of stages.
  virtual bool is_at(const Iterate& iterate) const noexcept;
  /// Clears the cache.
  virtual void forget() noexcept;

 protected:
  StageQp qp_;
  std::vector<double> scratch_;  ///< of the OCP's `scratch_size()`

 private:
  void remember(const Iterate& iterate) noexcept;

  const Ocp& ocp_;
  Iterate iterate_;        ///< at which the QP was made
  bool is_known_ = false;  ///< whether `iterate_` is valid
};

}  // namespace rhec
