// The Riccati recursion, compared with dense systems, on every instruction set that this machine supports.
#include "rhec/core/kernels/riccati_kernels.hpp"

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/random_qp.hpp"

namespace rhec {
namespace riccati_kernels_test {

using testing::DenseQp;
using testing::RandomQp;

/// What the recursion stores for a QP.
struct Recursion {
  AlignedDoubles P, U, V, closed, T, inverse, drift, g, p, PB;
  std::vector<std::uint8_t> fixes, special, additive;
  std::vector<int> added_to;
  Iterate step;
  RiccatiView view;

  Recursion(const StageQp& qp, const ActiveSet& active) : step(qp.capacity()) {
    const Capacity& capacity = qp.capacity();
    const std::size_t stages = capacity.intervals + 1, row = qp.stride();
    P.assign(stages * capacity.states * row, 0.0);
    for (auto* v : {&U, &V, &PB}) v->assign(stages * capacity.controls * row, 0.0);
    for (auto* v : {&closed, &T}) v->assign(stages * 64, 0.0);
    inverse.assign(stages * capacity.controls, 0.0);
    for (auto* v : {&drift, &g, &p}) v->assign(stages * row, 0.0);
    added_to.assign(stages * capacity.controls, 0);
    for (auto* v : {&fixes, &special, &additive}) v->assign(stages, 0);
    view.intervals = qp.intervals();
    view.states = capacity.states;
    view.controls = capacity.controls;
    view.stride = qp.stride();
    view.state_counts = qp.state_counts();
    view.control_counts = qp.control_counts();
    view.identity_counts = qp.identity_counts();
    view.AB = qp.AB(0);
    view.H = qp.H(0);
    view.h = qp.h(0);
    view.b = qp.b(0);
    view.lower = qp.lower(0);
    view.upper = qp.upper(0);
    view.sides = active.row(0);
    view.special = special.data();
    view.P = P.data();
    view.U = U.data();
    view.V = V.data();
    view.closed = closed.data();
    view.T = T.data();
    view.inverse = inverse.data();
    view.fixes = fixes.data();
    view.additive = additive.data();
    view.added_to = added_to.data();
    view.PB = PB.data();
    view.drift = drift.data();
    view.g = g.data();
    view.p = p.data();
    view.values = step.row(0);
    view.costates = step.costate(0);
    view.bounds = step.bound_row(0);
    const int N = qp.intervals();
    for (int j = 0; j < qp.states(N); ++j) {
      std::copy_n(qp.H(N) + j * row, qp.states(N), P.data() + (N * capacity.states + j) * row);
      p[N * row + j] = qp.q(N)[j];
    }
    std::copy_n(qp.initial_step(), qp.states(0), step.state(0));
  }

  void solve(const RiccatiKernels& kernels) {
    const int last = view.intervals - 1;
    ASSERT_EQ(kernels.factor(view, last, 1e-11), -1);
    ASSERT_EQ(kernels.solve_backward(view, last), -1);
    ASSERT_EQ(kernels.solve_forward(view, 0), view.intervals);
  }
};

/// Holds some controls at their bounds.
ActiveSet some_active_controls(RandomQp& random, StageQp& qp) {
  ActiveSet active(qp.capacity());
  for (int i = 0; i < qp.intervals(); ++i) {
    for (int j = 0; j < qp.controls(i); ++j) {
      if (random.integer(0, 3) != 0) continue;
      const bool is_lower = random.integer(0, 1) == 0;
      active.control(i)[j] = is_lower ? std::int8_t{-1} : std::int8_t{1};
      (is_lower ? qp.control_lower(i) : qp.control_upper(i))[j] = random.uniform(-0.5, 0.5);
    }
  }
  return active;
}

TEST(RiccatiKernels, OfTheRecursionAgreeWithTheDenseSystem) {
  RandomQp random(7);
  for (int trial = 0; trial < 300; ++trial) {
    // There are special kernels for five to eight states with two to four controls; long rows take several registers.
    const bool is_long = trial % 30 == 0;
    const int states = is_long ? random.integer(15, 40) : trial % 3 == 0 ? random.integer(1, 14) : random.integer(5, 8);
    const int controls = trial % 3 == 0 ? random.integer(1, 12) : random.integer(2, 4);
    StageQp qp = random.make(random.integer(1, is_long ? 3 : 7), states, controls, true);
    if (trial % 2 == 0) random.carry(qp);
    const ActiveSet active = some_active_controls(random, qp);
    const DenseQp dense(qp, active);
    const Eigen::VectorXd z = dense.solve();
    for (const KernelSet& set : runnable_kernels()) {
      Recursion recursion(qp, active);
      recursion.solve(*set.riccati);
      const Iterate& step = recursion.step;
      const auto where = [&](int i) { return std::string(set.instruction_set) + ", stage " + std::to_string(i); };
      int costate = static_cast<int>(dense.H.rows()), bound = costate + dense.dynamics_rows;
      for (int i = 0; i <= qp.intervals(); ++i) {
        for (int j = 0; j < states; ++j)
          ASSERT_NEAR(step.state(i)[j], z[dense.state_at[i] + j], 1e-8) << where(i) << " of " << states;
        for (int j = 0; j < qp.controls(i); ++j) {
          ASSERT_NEAR(step.control(i)[j], z[dense.control_at[i] + j], 1e-8) << where(i) << " of " << states;
          if (active.control(i)[j] != 0) {
            ASSERT_NEAR(step.control_bound(i)[j], z[bound++], 1e-7) << where(i);
          }
        }
        for (int j = 0; i > 0 && j < states; ++j) ASSERT_NEAR(step.costate(i)[j], z[costate++], 1e-7) << where(i);
      }
    }
  }
}

/// Makes the controls behind the first two, in most stages, such as process noise is: each with a cost of its own alone
/// and one entry in B, some beside each other in the same row. Its variance may be next to nothing, or large.
void make_additive(RandomQp& random, StageQp& qp) {
  const int states = qp.states(0), stride = qp.stride();
  for (int i = 0; i < qp.intervals(); ++i) {
    if (random.integer(0, 5) == 0) continue;
    const int moved = qp.states(i + 1) - qp.identity_counts()[i];
    for (int k = states + 2; k < states + qp.controls(i); ++k) {
      for (int l = 0; l < moved; ++l) qp.AB(i)[l * stride + k] = 0.0;
      qp.AB(i)[random.integer(0, moved - 1) * stride + k] = random.uniform(0.2, 1.0) * (random.integer(0, 1) * 2 - 1);
      for (int j = 0; j < states + qp.controls(i); ++j) qp.H(i)[k * stride + j] = qp.H(i)[j * stride + k] = 0.0;
      qp.H(i)[k * (stride + 1)] = std::pow(10.0, random.uniform(-3.0, 5.0));
    }
  }
}

TEST(RiccatiKernels, EliminateControlsThatAddToOneStateAsTheyDoOthers) {
  RandomQp random(21);
  int eliminated = 0, at_once = 0;
  for (int trial = 0; trial < 800; ++trial) {
    const int states = random.integer(5, 8), controls = random.integer(3, 6);
    StageQp qp = random.make(random.integer(1, 7), states, controls, true);
    if (trial % 8 > 0) random.carry(qp);
    make_additive(random, qp);
    const ActiveSet active = trial % 2 == 0 ? ActiveSet(qp.capacity()) : some_active_controls(random, qp);
    const int N = qp.intervals(), stride = qp.stride();
    const DenseQp dense(qp, active);
    const Eigen::VectorXd z = dense.solve();
    AlignedDoubles diagonal(static_cast<std::size_t>(N + 1) * stride, 0.0);
    for (int k = 0; trial % 3 == 0 && k < (N + 1) * stride; ++k) diagonal[k] = random.uniform(0.0, 2.0);
    for (const KernelSet& set : runnable_kernels()) {
      Recursion one(qp, active), other(qp, active);
      other.view.additive = nullptr;
      if (trial % 3 == 0) one.view.diagonal = other.view.diagonal = diagonal.data();
      one.solve(*set.riccati);
      other.solve(*set.riccati);
      const auto near = [&](const AlignedDoubles& a, const AlignedDoubles& b, std::ptrdiff_t at, const char* what) {
        ASSERT_NEAR(a[at], b[at], 1e-9 * (1.0 + std::abs(b[at])))
            << set.instruction_set << ", " << what << ", " << at << " of rows of " << stride;
      };
      for (int i = 0; i < N; ++i) {
        const int m = qp.controls(i), used = states + m;
        if (one.additive[i] != 0) {
          ASSERT_EQ(one.additive[i], m - 2);
          ++eliminated;
          at_once += m - 2 > 1;
        }
        for (int r = 0; r < states; ++r)
          for (int c = 0; c < states; ++c) near(one.P, other.P, (i * states + r) * stride + c, "P");
        for (int c = 0; c < m; ++c) {
          const std::ptrdiff_t row = (static_cast<std::ptrdiff_t>(i) * controls + c) * stride;
          near(one.inverse, other.inverse, static_cast<std::ptrdiff_t>(i) * controls + c, "inverse");
          for (int k = 0; k < states; ++k) near(one.V, other.V, row + k, "V");
          for (int k = 0; k < states; ++k) near(one.U, other.U, row + k, "U");
          for (int k = 0; k < c; ++k) near(one.U, other.U, row + states + k, "U");
        }
        for (int k = 0; k < used; ++k) near(one.p, other.p, static_cast<std::ptrdiff_t>(i) * stride + k, "p");
      }
      for (int i = 0; i <= N; ++i) {
        const double size = 1.0 + z.cwiseAbs().maxCoeff();
        for (int k = 0; k < states + (i < N ? qp.controls(i) : 0); ++k)
          ASSERT_NEAR(one.step.row(i)[k], other.step.row(i)[k], 1e-9 * size) << set.instruction_set << ", " << i;
        for (int j = 0; i > 0 && j < states; ++j)
          ASSERT_NEAR(one.step.costate(i)[j], other.step.costate(i)[j], 1e-8 * size) << set.instruction_set;
        for (int j = 0; trial % 3 > 0 && j < states; ++j)
          ASSERT_NEAR(one.step.state(i)[j], z[dense.state_at[i] + j], 1e-8 * size) << set.instruction_set;
        for (int j = 0; trial % 3 > 0 && i < N && j < qp.controls(i); ++j)
          ASSERT_NEAR(one.step.control(i)[j], z[dense.control_at[i] + j], 1e-8 * size) << set.instruction_set;
        // To the last digits of the numbers that are added, next states are what the dynamics make of the step.
        for (int l = 0; i < N && l < states; ++l) {
          double reached = qp.b(i)[l], largest = std::abs(reached);
          const auto add = [&](int k) {
            const double part = qp.AB(i)[l * stride + k] * one.step.row(i)[k];
            reached += part;
            largest = std::max(largest, std::abs(part));
          };
          for (int k = 0; k < states + qp.controls(i); ++k) add(k);
          ASSERT_NEAR(one.step.state(i + 1)[l], reached, 1e-14 * largest) << set.instruction_set << ", " << i;
        }
      }
    }
  }
  const int sets = static_cast<int>(runnable_kernels().size());
  EXPECT_GT(eliminated, 150 * sets);
  EXPECT_GT(at_once, 75 * sets);
}

TEST(RiccatiKernels, CarryTheCovarianceThroughControlsThatAddToOneState) {
  RandomQp random(22);
  int eliminated = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const int states = random.integer(5, 8), controls = random.integer(3, 6);
    StageQp qp = random.make(random.integer(1, 7), states, controls, false);
    random.carry(qp);
    make_additive(random, qp);
    const int stride = qp.stride(), N = qp.intervals();
    const ActiveSet none(qp.capacity());
    Eigen::MatrixXd root(states, states);
    for (double& entry : root.reshaped()) entry = random.uniform(-1.0, 1.0);
    const Eigen::MatrixXd first = root * root.transpose();
    for (const KernelSet& set : runnable_kernels()) {
      AlignedDoubles covariances[2], all[2];
      for (const bool is_plain : {false, true}) {
        Recursion recursion(qp, none);
        recursion.view.for_steps = trial % 2 == 0;
        if (is_plain) recursion.view.additive = nullptr;
        ASSERT_EQ(set.riccati->factor(recursion.view, N - 1, 1e-11), -1);
        for (int i = 0; i < N; ++i) eliminated += recursion.additive[i] != 0;
        AlignedDoubles& now = covariances[is_plain];
        now.assign(static_cast<std::size_t>(states) * stride, 0.0);
        for (int r = 0; r < states; ++r)
          for (int c = 0; c < states; ++c) now[r * stride + c] = first(r, c);
        all[is_plain].assign(static_cast<std::size_t>(N + 1) * states * states, 0.0);
        double* const every = trial % 3 == 0 ? all[is_plain].data() : nullptr;
        ASSERT_EQ(set.riccati->carry_covariance(recursion.view, 0, now.data(), every), N);
      }
      for (std::size_t k = 0; k < covariances[0].size(); ++k)
        ASSERT_NEAR(covariances[0][k], covariances[1][k], 1e-10 * (1.0 + std::abs(covariances[1][k])))
            << set.instruction_set << ", " << states << " states, " << controls << " controls";
      for (std::size_t k = 0; k < all[0].size(); ++k)
        ASSERT_NEAR(all[0][k], all[1][k], 1e-10 * (1.0 + std::abs(all[1][k]))) << set.instruction_set;
    }
  }
  EXPECT_GT(eliminated, 75 * static_cast<int>(runnable_kernels().size()));
}

/// A symmetric matrix with its eigenvalues' absolute values, by Eigen.
Eigen::Matrix2d reflected(const Eigen::Matrix2d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(matrix);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseAbs().asDiagonal() * eigen.eigenvectors().transpose();
}

TEST(RiccatiKernels, ReflectTwoControlsThatAreNotConvexWhereTheyMayWriteH) {
  RandomQp random(15);
  int reflected_stages = 0;
  for (int trial = 0; trial < 100; ++trial) {
    StageQp qp = random.make(1, random.integer(5, 8), 2, true);
    if (trial % 2 == 0) random.carry(qp);
    const int stride = qp.stride(), states = qp.states(0);
    if (qp.controls(0) != 2) continue;
    for (int j = 0; trial % 5 > 0 && j < 2; ++j) R_of(qp, 0)(j, j) -= random.uniform(0.0, 40.0);
    const ActiveSet none(qp.capacity());
    // With one interval the reduced Hessian is R + B'QB.
    Eigen::MatrixXd B(states, 2), Q(states, states);
    Eigen::Matrix2d reduced;
    for (int r = 0; r < states; ++r) {
      for (int c = 0; c < 2; ++c) B(r, c) = qp.AB(0)[r * stride + states + c];
      for (int c = 0; c < states; ++c) Q(r, c) = qp.H(1)[c * stride + r];
    }
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 2; ++c) reduced(r, c) = R_of(qp, 0)(r, c);
    const Eigen::Matrix2d known = B.transpose() * Q * B;
    reduced += known;
    const bool is_convex = reduced.determinant() > 0.0 && reduced.trace() > 0.0;
    reflected_stages += !is_convex;
    const Eigen::Matrix2d expected = (is_convex ? reduced : reflected(reduced)) - known;
    for (const KernelSet& set : runnable_kernels()) {
      StageQp own = qp;
      Recursion recursion(own, none);
      bool is_reflected = false;
      EXPECT_EQ(set.riccati->factor(recursion.view, 0, 1e-11), is_convex ? -1 : 0) << set.instruction_set;
      recursion.view.own_H = own.H(0);
      recursion.view.is_reflected = &is_reflected;
      const int left = set.riccati->factor(recursion.view, 0, 1e-11);
      // Shapes that are not compiled are left to the caller, with H as it was.
      EXPECT_EQ(is_reflected, !is_convex && left < 0) << set.instruction_set;
      const double size = 1e-11 * (1.0 + reduced.norm() + known.norm());
      for (int r = 0; r < 2; ++r)
        for (int c = 0; c < 2; ++c)
          EXPECT_NEAR(R_of(own, 0)(r, c), left < 0 ? expected(r, c) : R_of(qp, 0)(r, c), size) << set.instruction_set;
      if (left < 0) {
        EXPECT_EQ(set.riccati->factor(Recursion(own, none).view, 0, 1e-11), -1) << set.instruction_set;
      }
    }
  }
  EXPECT_GT(reflected_stages, 20);
}

TEST(RiccatiKernels, OfResponsesAreWhatAStepDiffersBy) {
  RandomQp random(13);
  for (int trial = 0; trial < 100; ++trial) {
    const int states = trial % 2 == 0 ? random.integer(5, 8) : random.integer(1, 12);
    StageQp qp = random.make(random.integer(1, 6), states, random.integer(2, 4), true);
    if (trial % 4 < 2) random.carry(qp);
    const ActiveSet active = some_active_controls(random, qp);
    const int N = qp.intervals(), stage = random.integer(0, N), place = random.integer(0, states - 1),
              number = random.integer(0, response_batch - 1);
    for (const KernelSet& set : runnable_kernels()) {
      Recursion before(qp, active);
      before.solve(*set.riccati);
      AlignedDoubles values(static_cast<std::size_t>(N + 1) * qp.stride() * response_batch, 0.0), costates = values;
      const auto at = [&](int i, int k, int lane) -> double& {
        return values[(static_cast<std::size_t>(i) * qp.stride() + k) * response_batch + lane];
      };
      at(stage, place, number) = 1.0;
      // Without gradients, their storage is not read.
      std::vector<unsigned char> has_gradient(N + 1, 0);
      has_gradient[stage] = 1;
      for (int i = 0; i <= N; ++i)
        for (int k = 0; i != stage && k < states + qp.controls(i); ++k) at(i, k, number) = 3.0;
      set.riccati->sensitivities_backward(before.view, stage, has_gradient.data(), values.data());
      for (int j = 0; j < states; ++j)
        for (int other = 0; other < response_batch; ++other) at(0, j, other) = 0.0;
      set.riccati->sensitivities_forward(before.view, stage, values.data(), costates.data());

      StageQp moved = qp;
      moved.h(stage)[place] += 1.0;
      Recursion after(moved, active);
      after.solve(*set.riccati);
      for (int i = 0; i <= N; ++i) {
        for (int k = 0; k < states + qp.controls(i); ++k) {
          const bool is_fixed = k >= states && active.row(i)[k] != 0;
          const auto of = [&](const Recursion& r) { return is_fixed ? r.step.bound_row(i)[k] : r.step.row(i)[k]; };
          ASSERT_NEAR(at(i, k, number), of(after) - of(before), 1e-8) << set.instruction_set << ", " << i << ", " << k;
        }
        for (int j = 0; i > 0 && j < states; ++j)
          ASSERT_NEAR(costates[(static_cast<std::size_t>(i) * qp.stride() + j) * response_batch + number],
                      after.step.costate(i)[j] - before.step.costate(i)[j], 1e-8)
              << set.instruction_set << ", " << i << ", " << j;
      }
    }
  }
}

TEST(RiccatiKernels, OfResponsesMayLeaveOutStatesThatKeepTheirValues) {
  RandomQp random(17);
  for (int trial = 0; trial < 60; ++trial) {
    const int states = trial % 2 == 0 ? random.integer(5, 8) : random.integer(2, 12), carried = random.integer(1, 3);
    StageQp qp = random.make(random.integer(1, 6), states, random.integer(2, 4), true);
    const int N = qp.intervals(), kept = std::min(carried, states - 1);
    for (int i = 0; i < N; ++i) {
      for (int r = states - kept; r < states; ++r) {
        std::fill_n(qp.AB(i) + r * qp.stride(), qp.stride(), 0.0);
        qp.AB(i)[r * qp.stride() + r] = 1.0;
      }
      qp.set_sizes(i, states, qp.controls(i), kept);
    }
    const ActiveSet active = some_active_controls(random, qp);
    const int stage = random.integer(0, N);
    AlignedDoubles gradients(static_cast<std::size_t>(N + 1) * qp.stride() * response_batch, 0.0);
    std::vector<unsigned char> has_gradient(N + 1, 0);
    has_gradient[stage] = 1;
    const auto row = [&](AlignedDoubles& of, int i) {
      return of.data() + static_cast<std::ptrdiff_t>(i) * qp.stride() * response_batch;
    };
    for (int k = 0; k < (states + qp.controls(stage)) * response_batch; ++k)
      row(gradients, stage)[k] = random.uniform(-1.0, 1.0);
    for (const KernelSet& set : runnable_kernels()) {
      Recursion recursion(qp, active);
      recursion.solve(*set.riccati);
      AlignedDoubles values[2] = {gradients, gradients};
      for (const bool keeps_carried : {false, true}) {
        recursion.view.keeps_carried = keeps_carried;
        AlignedDoubles& of = values[keeps_carried];
        set.riccati->sensitivities_backward(recursion.view, stage, has_gradient.data(), of.data());
        std::fill_n(of.data(), states * response_batch, 0.0);
        set.riccati->sensitivities_forward(recursion.view, stage, of.data(), nullptr);
      }
      for (int i = 0; i <= N; ++i)
        for (int k = 0; k < (states + qp.controls(i)) * response_batch; ++k)
          ASSERT_NEAR(row(values[1], i)[k], row(values[0], i)[k], 1e-10) << set.instruction_set << ", stage " << i;
    }
  }
}

TEST(RiccatiKernels, OfTheRecursionStopWhereTheReducedHessianIsNotDefinite) {
  RandomQp random(8);
  for (int trial = 0; trial < 20; ++trial) {
    StageQp qp = random.make(5, trial % 2 == 0 ? 6 : 4, 2, true);
    int bent = -1;
    for (int i = 0; i < qp.intervals(); ++i)
      if (qp.controls(i) > 0) bent = i;
    if (bent < 0) continue;
    R_of(qp, bent)(0, 0) = -1e4;
    const ActiveSet none(qp.capacity());
    for (const KernelSet& set : runnable_kernels()) {
      Recursion recursion(qp, none);
      EXPECT_EQ(set.riccati->factor(recursion.view, qp.intervals() - 1, 1e-11), bent) << set.instruction_set;
    }
  }
}

/// One by the closed loop of a factorisation, the other forwards alone, of a QP whose controls are coupled to nothing.
TEST(RiccatiKernels, BothCovariancesOfTheLastNodeAgree) {
  RandomQp random(19);
  for (int trial = 0; trial < 60; ++trial) {
    const int states = trial % 2 == 0 ? random.integer(1, 12) : random.integer(13, 40),
              controls = random.integer(1, 12);
    StageQp qp = random.make(random.integer(1, 6), states, controls, false);
    const int stride = qp.stride(), N = qp.intervals();
    for (int i = 0; i < N; ++i)
      for (int r = 0; r < states + controls; ++r)
        for (int c = 0; c < states + controls; ++c)
          if (r != c && std::max(r, c) >= states) qp.H(i)[r * stride + c] = 0.0;
    const ActiveSet none(qp.capacity());
    const auto block = [&](const double* rows) {
      return Eigen::MatrixXd(Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>(rows, states, states,
                                                                                        Eigen::OuterStride<>(stride)));
    };
    for (const KernelSet& set : runnable_kernels()) {
      Recursion recursion(qp, none);
      ASSERT_EQ(set.riccati->factor(recursion.view, N - 1, 1e-11), -1);
      AlignedDoubles carried(static_cast<std::size_t>(states * stride)), filtered(carried.size());
      const Eigen::MatrixXd from_all = 2.0 * block(recursion.P.data()).inverse(),
                            from_first = 2.0 * block(qp.H(0)).inverse();
      for (int c = 0; c < states; ++c)
        for (int r = 0; r < states; ++r) {
          carried[c * stride + r] = from_all(r, c);
          filtered[c * stride + r] = from_first(r, c);
        }
      ASSERT_EQ(set.riccati->carry_covariance(recursion.view, 0, carried.data(), nullptr), N);
      ASSERT_TRUE(set.riccati->filter_covariance(recursion.view, filtered.data())) << set.instruction_set;
      const double scale = block(carried.data()).cwiseAbs().maxCoeff();
      EXPECT_LE((block(carried.data()) - block(filtered.data())).cwiseAbs().maxCoeff(), 1e-8 * scale)
          << set.instruction_set << ", " << states << " states, " << controls << " controls";
      if (qp.controls(0) == 0) continue;
      qp.H(0)[states * stride] = 1e-3;  // a control and a state
      EXPECT_FALSE(set.riccati->filter_covariance(recursion.view, filtered.data()));
      qp.H(0)[states * stride] = 0.0;
    }
  }
}

TEST(RiccatiKernels, InvertAndSolveSymmetricSystems) {
  RandomQp random(13);
  for (int trial = 0; trial < 60; ++trial) {
    const int n = trial < 20 ? 6 : random.integer(1, 16), stride = trial % 2 == 0 && n <= 8 ? 8 : 16;
    Eigen::MatrixXd root(n, n), P = Eigen::MatrixXd::Zero(n, n);
    for (double& entry : root.reshaped()) entry = random.uniform(-1.0, 1.0);
    P = root * root.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n);
    // The padding of the rows is not part of the matrix.
    AlignedDoubles matrix(static_cast<std::size_t>(n) * stride, 7.0), inverse(matrix.size(), 0.0), p(stride, 3.0),
        x(stride, 0.0), batch(static_cast<std::size_t>(n) * response_batch);
    for (int r = 0; r < n; ++r)
      for (int c = 0; c < n; ++c) matrix[r * stride + c] = P(r, c);
    Eigen::VectorXd right(n);
    for (int j = 0; j < n; ++j) p[j] = right[j] = random.uniform(-1.0, 1.0);
    for (double& entry : batch) entry = random.uniform(-1.0, 1.0);
    const Eigen::MatrixXd expected = P.inverse();
    const Eigen::VectorXd solution = -P.ldlt().solve(right);
    for (const KernelSet& set : runnable_kernels()) {
      ASSERT_TRUE(set.riccati->invert(matrix.data(), n, stride, 1e-11, inverse.data())) << set.instruction_set;
      for (int r = 0; r < n; ++r)
        for (int c = 0; c < n; ++c)
          EXPECT_NEAR(inverse[r * stride + c], expected(r, c), 1e-9 * expected.norm()) << set.instruction_set;
      set.riccati->solve(matrix.data(), inverse.data(), n, stride, p.data(), x.data());
      for (int j = 0; j < n; ++j) EXPECT_NEAR(x[j], solution[j], 1e-11 * (1.0 + solution.norm()));
      AlignedDoubles answers = batch;
      set.riccati->answer(inverse.data(), n, stride, answers.data());
      for (int r = 0; r < n; ++r) {
        for (int k = 0; k < response_batch; ++k) {
          double sum = 0.0;
          for (int c = 0; c < n; ++c) sum -= inverse[r * stride + c] * batch[c * response_batch + k];
          EXPECT_NEAR(answers[r * response_batch + k], sum, 1e-11 * (1.0 + expected.norm())) << set.instruction_set;
        }
      }
      // Indefinite, or barely positive definite.
      AlignedDoubles bad = matrix;
      bad[0] = -1.0;
      EXPECT_FALSE(set.riccati->invert(bad.data(), n, stride, 1e-11, inverse.data())) << set.instruction_set;
      bad[0] = std::nan("");
      EXPECT_FALSE(set.riccati->invert(bad.data(), n, stride, 1e-11, inverse.data())) << set.instruction_set;
    }
  }
}

AlignedDoubles numbers(RandomQp& random, std::size_t count) {
  AlignedDoubles v(count);
  for (double& entry : v) entry = random.uniform(-2.0, 2.0);
  return v;
}

TEST(RiccatiKernels, CombineABatchByItsWeights) {
  RandomQp random(14);
  for (int trial = 0; trial < 40; ++trial) {
    const int count = random.integer(1, 20);
    const AlignedDoubles batch = numbers(random, static_cast<std::size_t>(padded(count)) * response_batch),
                         of_batch = numbers(random, response_batch);
    for (const KernelSet& set : runnable_kernels()) {
      AlignedDoubles sums(padded(count), 0.5);
      set.riccati->combine(batch.data(), of_batch.data(), sums.data(), padded(count));
      for (int j = 0; j < count; ++j) {
        double expected = 0.5;
        for (int k = 0; k < response_batch; ++k) expected += batch[j * response_batch + k] * of_batch[k];
        EXPECT_NEAR(sums[j], expected, 1e-12) << set.instruction_set;
      }
    }
  }
}

TEST(RiccatiKernels, CombineSeveralBatchesAsOneAfterTheOther) {
  RandomQp random(16);
  for (int trial = 0; trial < 40; ++trial) {
    const int count = padded(random.integer(1, 40)), number = random.integer(0, 7);
    std::vector<AlignedDoubles> batches, weights;
    std::vector<const double*> of_batches, of_weights;
    for (int k = 0; k < number; ++k) {
      batches.push_back(numbers(random, static_cast<std::size_t>(count) * response_batch));
      weights.push_back(numbers(random, response_batch));
      of_batches.push_back(batches.back().data());
      of_weights.push_back(weights.back().data());
    }
    for (const KernelSet& set : runnable_kernels()) {
      AlignedDoubles expected(count, 0.5), sums = expected;
      for (int k = 0; k < number; ++k) set.riccati->combine(of_batches[k], of_weights[k], expected.data(), count);
      set.riccati->combine_batches(of_batches.data(), of_weights.data(), number, sums.data(), count);
      for (int j = 0; j < count; ++j) EXPECT_NEAR(sums[j], expected[j], 1e-11) << set.instruction_set;
    }
  }
}

}  // namespace riccati_kernels_test
}  // namespace rhec
