#pragma once

#include <span>

#include "rhec/core/qp/stage_qp.hpp"

namespace rhec::sparse_sqp {

/// Marginal covariances of all stage states, with bounds ignored, if the QP's objective is the quadratic model of twice
/// a negative log-likelihood. Column-major n_s x n_s blocks of the capacity's n_s, one per node; zeros at node 0 if the
/// initial state is given. Returns false and writes nothing if the reduced Hessian is not positive definite.
///
/// They need their own factorisation, which eliminates stage by stage from the end of the horizon (Riccati recursion)
/// without regularising the dynamics:
///
///     G = R + B'PB = LL',  W = L^-1 (S + B'PA),  P_i = Q + A'PA - W'W,  F = A - B L^-T W
///     C_0 = 2 P_0^-1,  C_{i+1} = F C_i F' + 2 (B L^-T)(B L^-T)'
///
/// Every pivot belongs to the reduced Hessian, so variables without a cost of their own do no harm. In an order chosen
/// for sparsity alone, their pivots would be as small as the regularisation and the covariances would not have a single
/// correct digit: refinement repairs individual solutions, not an inverse.
bool stage_covariances(const StageQp& qp, std::span<double> blocks);

}  // namespace rhec::sparse_sqp
