#pragma once

// What Eigen would compile anew for every source that multiplies, solves or decomposes matrices of any size: inner
// loops, which it never inlines, and decompositions. Sources with the precompiled headers, which declare this, take
// them from the static library rhec_compiled_once; a source without those headers has its own.

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/QR>

// What is named below is inside Eigen 3.4; with another version each source has its own.
#if EIGEN_VERSION_AT_LEAST(3, 4, 0) && !EIGEN_VERSION_AT_LEAST(3, 4, 50)

#ifndef RHEC_COMPILED_ONCE  // eigen.cpp defines it as nothing
#define RHEC_COMPILED_ONCE extern
#endif

namespace Eigen {
namespace internal {

using AnyBlock = Block<MatrixXd, Dynamic, Dynamic, false>;
using Result = blas_data_mapper<double, Index, ColMajor>;
template <int order>
using Entries = const_blas_data_mapper<double, Index, order>;
using Products = gebp_traits<double, double>;

RHEC_COMPILED_ONCE template void evaluateProductBlockingSizesHeuristic<double, double, 1, Index>(Index&, Index&, Index&,
                                                                                                 Index);
RHEC_COMPILED_ONCE template void evaluateProductBlockingSizesHeuristic<double, double, 4, Index>(Index&, Index&, Index&,
                                                                                                 Index);
RHEC_COMPILED_ONCE template struct gebp_kernel<double, double, Index, Result, Products::mr, Products::nr, false, false>;
RHEC_COMPILED_ONCE template struct gemm_pack_lhs<double, Index, Entries<ColMajor>, Products::mr, Products::LhsProgress,
                                                 Products::LhsPacket4Packing, ColMajor, false, false>;
RHEC_COMPILED_ONCE template struct gemm_pack_lhs<double, Index, Entries<RowMajor>, Products::mr, Products::LhsProgress,
                                                 Products::LhsPacket4Packing, RowMajor, false, false>;
RHEC_COMPILED_ONCE template struct gemm_pack_lhs<double, Index, Result, Products::mr, Products::LhsProgress,
                                                 Products::LhsPacket4Packing, ColMajor, false, true>;
RHEC_COMPILED_ONCE template struct gemm_pack_rhs<double, Index, Entries<ColMajor>, Products::nr, ColMajor, false,
                                                 false>;
RHEC_COMPILED_ONCE template struct gemm_pack_rhs<double, Index, Entries<RowMajor>, Products::nr, RowMajor, false,
                                                 false>;
RHEC_COMPILED_ONCE template struct gemm_pack_rhs<double, Index, Result, Products::nr, ColMajor, false, true>;
RHEC_COMPILED_ONCE template struct gemm_pack_rhs<double, Index, Entries<RowMajor>, Products::nr, RowMajor, false, true>;
RHEC_COMPILED_ONCE template struct general_matrix_matrix_product<Index, double, ColMajor, false, double, ColMajor,
                                                                 false, ColMajor, 1>;
RHEC_COMPILED_ONCE template struct general_matrix_matrix_product<Index, double, ColMajor, false, double, RowMajor,
                                                                 false, ColMajor, 1>;
RHEC_COMPILED_ONCE template struct general_matrix_matrix_product<Index, double, RowMajor, false, double, ColMajor,
                                                                 false, ColMajor, 1>;
RHEC_COMPILED_ONCE template struct general_matrix_matrix_product<Index, double, RowMajor, false, double, RowMajor,
                                                                 false, ColMajor, 1>;
RHEC_COMPILED_ONCE template struct general_matrix_vector_product<Index, double, Entries<ColMajor>, ColMajor, false,
                                                                 double, Entries<ColMajor>, false, 0>;
RHEC_COMPILED_ONCE template struct general_matrix_vector_product<Index, double, Entries<ColMajor>, ColMajor, false,
                                                                 double, Entries<RowMajor>, false, 0>;
RHEC_COMPILED_ONCE template struct general_matrix_vector_product<Index, double, Entries<RowMajor>, RowMajor, false,
                                                                 double, Entries<ColMajor>, false, 0>;
RHEC_COMPILED_ONCE template struct general_matrix_vector_product<Index, double, Entries<RowMajor>, RowMajor, false,
                                                                 double, Entries<RowMajor>, false, 0>;
RHEC_COMPILED_ONCE template struct general_matrix_vector_product<Index, double, Entries<RowMajor>, RowMajor, false,
                                                                 double, Entries<RowMajor>, false, 1>;
RHEC_COMPILED_ONCE template struct general_matrix_matrix_triangular_product<Index, double, ColMajor, false, double,
                                                                            RowMajor, false, ColMajor, 1, Lower, 0>;
RHEC_COMPILED_ONCE template struct selfadjoint_matrix_vector_product<double, Index, ColMajor, Lower, false, false, 0>;
RHEC_COMPILED_ONCE template struct triangular_matrix_vector_product<Index, UnitUpper, double, false, double, false,
                                                                    RowMajor, 0>;
RHEC_COMPILED_ONCE template struct product_triangular_matrix_matrix<double, Index, Lower, true, ColMajor, false,
                                                                    ColMajor, false, ColMajor, 1, 0>;
RHEC_COMPILED_ONCE template struct product_triangular_matrix_matrix<double, Index, UnitLower, true, ColMajor, false,
                                                                    ColMajor, false, ColMajor, 1, 0>;
RHEC_COMPILED_ONCE template struct product_triangular_matrix_matrix<double, Index, Upper, true, RowMajor, false,
                                                                    ColMajor, false, ColMajor, 1, 0>;
RHEC_COMPILED_ONCE template struct product_triangular_matrix_matrix<double, Index, UnitUpper, true, RowMajor, false,
                                                                    ColMajor, false, ColMajor, 1, 0>;
RHEC_COMPILED_ONCE template struct triangular_solve_matrix<double, Index, OnTheRight, Upper, false, RowMajor, ColMajor,
                                                           1>;
RHEC_COMPILED_ONCE template struct triangular_solve_matrix<double, Index, OnTheLeft, Lower, false, ColMajor, ColMajor,
                                                           1>;
RHEC_COMPILED_ONCE template struct triangular_solve_matrix<double, Index, OnTheLeft, UnitLower, false, ColMajor,
                                                           ColMajor, 1>;
RHEC_COMPILED_ONCE template struct triangular_solve_matrix<double, Index, OnTheLeft, Upper, false, ColMajor, ColMajor,
                                                           1>;
RHEC_COMPILED_ONCE template struct triangular_solve_matrix<double, Index, OnTheLeft, Upper, false, RowMajor, ColMajor,
                                                           1>;
RHEC_COMPILED_ONCE template struct triangular_solve_vector<double, double, Index, OnTheLeft, Lower, false, ColMajor>;
RHEC_COMPILED_ONCE template struct triangular_solve_vector<double, double, Index, OnTheLeft, Upper, false, ColMajor>;
RHEC_COMPILED_ONCE template void apply_block_householder_on_the_left(AnyBlock&, const AnyBlock&,
                                                                     const VectorBlock<const VectorXd>&, bool);
RHEC_COMPILED_ONCE template void apply_block_householder_on_the_left(AnyBlock&, const AnyBlock&,
                                                                     const Block<const VectorXd, Dynamic, 1, false>&,
                                                                     bool);
RHEC_COMPILED_ONCE template Index llt_inplace<double, Lower>::blocked(MatrixXd&);

}  // namespace internal

RHEC_COMPILED_ONCE template void MatrixBase<internal::AnyBlock>::applyHouseholderOnTheLeft(
    const Block<const MatrixXd, Dynamic, 1, false>&, const double&, double*);
RHEC_COMPILED_ONCE template void MatrixBase<internal::AnyBlock>::applyHouseholderOnTheRight(
    const Block<const MatrixXd, Dynamic, 1, false>&, const double&, double*);
RHEC_COMPILED_ONCE template void MatrixBase<internal::AnyBlock>::applyHouseholderOnTheLeft(
    const VectorBlock<Block<MatrixXd, Dynamic, 1, true>>&, const double&, double*);
RHEC_COMPILED_ONCE template LLT<MatrixXd>& LLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
RHEC_COMPILED_ONCE template void PartialPivLU<MatrixXd>::compute();
RHEC_COMPILED_ONCE template void ColPivHouseholderQR<MatrixXd>::computeInPlace();

}  // namespace Eigen

#endif
