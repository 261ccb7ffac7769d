#pragma once

#include <cstdint>
#include <span>

#include "rhec/core/qp/stage_qp.hpp"

namespace rhec::sparse_sqp {

/// Makes the reduced Hessian of `qp` positive definite: at the stages where that is needed, it replaces the cost
/// matrices by those of `gauss_newton`, the same QP with the Gauss-Newton Hessian. At the other stages the Hessian
/// stays exact. `fixed` flags the fixed variables, in the order of SparseNlp; empty: none are fixed. Returns the number
/// of stages replaced.
///
/// The reduced Hessian is positive definite if and only if all pivots G of the Riccati recursion from the end of the
/// horizon are (and P_0 if the initial state is free), restricted to the rows and columns of the free controls:
///
///     G = R + B'PB,   P_i = Q + A'PA - (S + B'PA)' G^-1 (S + B'PA)
///
/// If a pivot is not positive definite, the stages that cause it take the Gauss-Newton Hessian: first the stage of the
/// pivot, then, as long as that does not suffice, twice as many stages from there on each time.
int convexify_by_stages(StageQp& qp, const StageQp& gauss_newton, std::span<const std::uint8_t> fixed);

}  // namespace rhec::sparse_sqp
