// The Riccati recursion, compared with dense systems, on every instruction set that this machine supports.
#include "rhec/core/kernels/riccati_kernels.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <array>
#include <utility>

#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/random_qp.hpp"

namespace rhec {
namespace riccati_kernels_test {

using testing::DenseQp;
using testing::RandomQp;

/// What the recursion stores for a QP.
struct Recursion {
  AlignedDoubles P, U, V, closed, T, inverse, drift, g, p;
  std::vector<std::uint8_t> fixes, special;
  Iterate step;
  RiccatiView view;

  Recursion(const StageQp& qp, const ActiveSet& active) : step(qp.capacity()) {
    const Capacity& capacity = qp.capacity();
    const std::size_t stages = capacity.intervals + 1, row = qp.stride();
    P.assign(stages * capacity.states * row, 0.0);
    for (auto* v : {&U, &V}) v->assign(stages * capacity.controls * row, 0.0);
    for (auto* v : {&closed, &T}) v->assign(stages * 64, 0.0);
    inverse.assign(stages * capacity.controls, 0.0);
    for (auto* v : {&drift, &g, &p}) v->assign(stages * row, 0.0);
    for (auto* v : {&fixes, &special}) v->assign(stages, 0);
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

/// The last `count` states keep their values in all intervals.
void carry_last(StageQp& qp, int count) {
  for (int i = 0; i < qp.intervals(); ++i) {
    const int states = qp.states(i);
    for (int r = states - count; r < states; ++r) {
      std::fill_n(qp.AB(i) + r * qp.stride(), qp.stride(), 0.0);
      qp.AB(i)[r * qp.stride() + r] = 1.0;
    }
    qp.set_sizes(i, states, qp.controls(i), count);
  }
}

/// A vehicle's two inputs and process noise: compiled for some numbers of states, of which some are parameters.
TEST(RiccatiKernels, TakeFurtherControlsBehindTheFirstTwo) {
  RandomQp random(21);
  constexpr std::array<std::pair<int, int>, 6> sizes{{{5, 2}, {6, 2}, {7, 2}, {7, 3}, {8, 3}, {8, 4}}};
  for (int trial = 0; trial < 240; ++trial) {
    const auto [states, carried] = sizes[static_cast<std::size_t>(trial) % sizes.size()];
    StageQp qp = random.make(random.integer(2, 5), states, random.integer(3, 16 - states), true);
    carry_last(qp, carried);
    const ActiveSet none(qp.capacity());
    AlignedDoubles diagonal(static_cast<std::size_t>(qp.intervals() + 1) * qp.stride(), 0.0);
    StageQp whole = qp;
    const bool has_diagonal = trial % 3 == 0;
    for (int i = 0; has_diagonal && i < qp.intervals(); ++i) {
      for (int k = 0; k < states + qp.controls(i); ++k) {
        const double more = diagonal[static_cast<std::size_t>(i) * qp.stride() + k] = random.uniform(0.0, 1.0);
        whole.H(i)[k * (qp.stride() + 1)] += more;
      }
    }
    const DenseQp dense(whole, none);
    const Eigen::VectorXd z = dense.solve();
    const int bent = random.integer(0, qp.intervals() - 1), control = random.integer(0, 15);
    for (const KernelSet& set : runnable_kernels()) {
      const auto where = [&](int i) {
        return fmt::format("{}, {} states, {} carried, {} controls at stage {}", set.instruction_set, states, carried,
                           qp.controls(i), i);
      };
      Recursion recursion(qp, none);
      recursion.view.diagonal = has_diagonal ? diagonal.data() : nullptr;
      recursion.solve(*set.riccati);
      for (int i = 0; i <= qp.intervals(); ++i) {
        for (int j = 0; j < states; ++j)
          ASSERT_NEAR(recursion.step.state(i)[j], z[dense.state_at[i] + j], 1e-8) << where(i);
        for (int j = 0; j < qp.controls(i); ++j)
          ASSERT_NEAR(recursion.step.control(i)[j], z[dense.control_at[i] + j], 1e-8) << where(i);
      }
      if (qp.controls(bent) == 0) continue;
      StageQp concave = qp;
      R_of(concave, bent)(control % qp.controls(bent), control % qp.controls(bent)) = -1e4;
      Recursion stopped(concave, none);
      EXPECT_EQ(set.riccati->factor(stopped.view, qp.intervals() - 1, 1e-11), bent) << where(bent);
    }
  }
}

/// A symmetric matrix with its eigenvalues' absolute values, by Eigen.
Eigen::Matrix2d reflected(const Eigen::Matrix2d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix);
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
    carry_last(qp, kept);
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
