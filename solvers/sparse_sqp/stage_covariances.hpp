#pragma once

#include <span>

#include "rhec/core/qp/stage_qp.hpp"

namespace rhec::sparse_sqp {

/// Marginal covariances of all stage states when a QP's objective is twice a negative log-likelihood's quadratic
/// and its bounds are ignored: column-major blocks of the capacity's n_s x n_s, one a node; zeros where a state is
/// given. False, with nothing written, where the Hessian has no inverse.
///
/// They come from a factor of their own, which eliminates stage after stage from the horizon's end (Riccati) and takes
/// the dynamics as they are:
///
///     G = R + B'PB = LL',  W = L^-1 (S + B'PA),  P_i = Q + A'PA - W'W,  F = A - B L^-T W
///     C_0 = 2 P_0^-1,  C_{i+1} = F C_i F' + 2 (B L^-T)(B L^-T)'
///
/// Every pivot is of the reduced Hessian, so variables without any cost of their own do no harm. In an order that is
/// chosen for sparsity alone they would give pivots of the size of a regularisation, and covariances without a correct
/// digit: refinement, which repairs single solutions, does not repair an inverse.
bool stage_covariances(const StageQp& qp, std::span<double> blocks);

}  // namespace rhec::sparse_sqp
