#pragma once

#include <cstdint>
#include <span>

#include "rhec/core/qp/stage_qp.hpp"

namespace rhec::sparse_sqp {

/// Makes the reduced Hessian of `qp` positive definite by taking over the cost matrices of `gauss_newton`, the same
/// QP with another curvature, at those stages where it is needed; elsewhere the curvature stays exact. `fixed`
/// flags the variables, in the order of SparseNlp, that do not move; empty: all do. Returns the number of stages taken
/// over.
///
/// The reduced Hessian is positive definite if and only if all pivots of the Riccati recursion from the horizon's end
/// are (and P_0 where the initial state is free), with the rows and columns of the controls that are free:
///
///     G = R + B'PB,   P_i = Q + A'PA - (S + B'PA)' G^-1 (S + B'PA)
///
/// Where one is not, the stages that it comes from give up their curvature: first the one that shows it, then, as long
/// as that does not suffice, twice as many after it each time.
int convexify_by_stages(StageQp& qp, const StageQp& gauss_newton, std::span<const std::uint8_t> fixed);

}  // namespace rhec::sparse_sqp
