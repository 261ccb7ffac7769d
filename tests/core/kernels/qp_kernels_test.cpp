// The QP kernels: every instruction set that this machine supports, compared with the narrowest.
#include "rhec/core/kernels/qp_kernels.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "core/qp/qp_view.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "support/random_qp.hpp"

namespace rhec {
namespace qp_kernels_test {

using testing::RandomQp;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Random rows of an iterate and a QP, where some bounds are infinite.
struct RandomRows {
  StageQp qp;
  Iterate point;
  QpView view;

  /// With sizes that kernels are compiled for, or arbitrary ones.
  explicit RandomRows(RandomQp& random, bool is_usual = false)
      : qp(random.make(random.integer(1, 9), is_usual ? random.integer(5, 8) : random.integer(1, 11),
                       is_usual ? 2 : random.integer(1, 9), random.integer(0, 1) == 0)),
        point(qp.capacity()) {
    if (is_usual) random.carry(qp);
    for (int i = 0; i <= qp.intervals(); ++i) {
      for (int j = 0; j < qp.states(i); ++j) {
        point.state(i)[j] = random.uniform(-1.0, 1.0);
        point.costate(i)[j] = random.uniform(-1.0, 1.0);
        set_bounds(random, qp.state_lower(i)[j], qp.state_upper(i)[j], point.state_bound(i)[j]);
      }
      for (int j = 0; j < qp.controls(i); ++j) {
        point.control(i)[j] = random.uniform(-1.0, 1.0);
        set_bounds(random, qp.control_lower(i)[j], qp.control_upper(i)[j], point.control_bound(i)[j]);
      }
    }
    view = view_of(qp, point);
  }

  static void set_bounds(RandomQp& random, double& lower, double& upper, double& multiplier) {
    lower = random.integer(0, 2) == 0 ? -infinity : random.uniform(-1.5, -0.2);
    upper = random.integer(0, 2) == 0 ? infinity : random.uniform(0.2, 1.5);
    if (random.integer(0, 9) == 0) multiplier = random.uniform(-1.0, 1.0);
  }
};

TEST(QpKernels, AgreeOnRandomRows) {
  RandomQp random(9);
  for (int trial = 0; trial < 150; ++trial) {
    RandomRows rows(random, trial % 3 == 0);
    if (trial % 10 == 3) rows.qp.state_lower(1)[0] = std::nan("");
    if (trial % 10 == 5) rows.point.state(1)[0] = infinity;
    std::vector<unsigned char> marks(rows.qp.intervals() + 1), same_marks(marks.size());
    const QpKernels& generic = *runnable_kernels().front().qp;
    const KktParts kkt = generic.kkt(rows.view);
    const StepParts check = generic.check_step(rows.view, 1e-10);
    const bool crosses = generic.mark_bounds(rows.view, 1e-10, marks.data());
    if (trial % 10 == 5) {
      EXPECT_FALSE(check.is_finite);
    }
    for (const KernelSet& set : runnable_kernels()) {
      const KktParts same = set.qp->kkt(rows.view);
      EXPECT_NEAR(same.stationarity, kkt.stationarity, 1e-12) << set.instruction_set;
      EXPECT_EQ(same.defect, kkt.defect);
      EXPECT_EQ(same.bound_violation, kkt.bound_violation);
      EXPECT_EQ(same.complementarity, kkt.complementarity);
      EXPECT_EQ(same.largest_term, kkt.largest_term);
      const StepParts same_check = set.qp->check_step(rows.view, 1e-10);
      EXPECT_EQ(same_check.is_finite, check.is_finite) << set.instruction_set << ", " << trial;
      if (check.is_finite) {
        EXPECT_EQ(same_check.violates, check.violates);
      }
      if (check.is_finite) {
        EXPECT_EQ(same_check.largest_costate, check.largest_costate);
      }
      EXPECT_EQ(set.qp->mark_bounds(rows.view, 1e-10, same_marks.data()), crosses) << set.instruction_set;
      EXPECT_EQ(same_marks, marks) << set.instruction_set;
    }
  }
}

AlignedDoubles numbers(RandomQp& random, std::size_t count) {
  AlignedDoubles v(count);
  for (double& entry : v) entry = random.uniform(-2.0, 2.0);
  return v;
}

TEST(QpKernels, ComputeWhatTheySay) {
  RandomQp random(14);
  for (int trial = 0; trial < 40; ++trial) {
    const int width = padded(random.integer(1, 20));
    const AlignedDoubles a = numbers(random, width), b = numbers(random, width), h = numbers(random, width);
    for (const KernelSet& set : runnable_kernels()) {
      AlignedDoubles out(width), sum_h(width);
      std::copy_n(b.data(), width, out.data());
      set.qp->add(a.data(), out.data(), width);
      for (int k = 0; k < width; ++k) EXPECT_EQ(out[k], a[k] + b[k]) << set.instruction_set;
      AlignedDoubles lower = a, upper = b;
      lower[0] = -infinity;
      upper[0] = infinity;
      set.qp->widen_bounds(lower.data(), upper.data(), 1e-3, width, out.data(), sum_h.data());
      for (int k = 0; k < width; ++k) {
        EXPECT_DOUBLE_EQ(out[k], lower[k] - 1e-3 * (1.0 + std::abs(lower[k]))) << set.instruction_set;
        EXPECT_DOUBLE_EQ(sum_h[k], upper[k] + 1e-3 * (1.0 + std::abs(upper[k]))) << set.instruction_set;
      }
      std::copy_n(h.data(), width, sum_h.data());
      const ViolationParts found = set.qp->find_violations(a.data(), b.data(), sum_h.data(), width, out.data());
      int violated = 0;
      double worst = 0.0;
      for (int k = 0; k < width; ++k) {
        EXPECT_EQ(out[k], std::max(b[k] - a[k], a[k] - sum_h[k])) << set.instruction_set;
        violated += out[k] > 0.0;
        worst = std::max(worst, out[k]);
      }
      EXPECT_EQ(found.count, violated) << set.instruction_set;
      EXPECT_EQ(found.largest, worst) << set.instruction_set;
    }
  }
}

}  // namespace qp_kernels_test
}  // namespace rhec
