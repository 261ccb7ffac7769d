// The QP kernels: every instruction set that this machine supports, compared with the narrowest.
#include "rhec/core/kernels/qp_kernels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

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
      std::vector<double> largest(width / 8, 0.0);
      set.qp->largest_of_eight(a.data(), width, largest.data());
      for (int k = 0; k < width; k += 8)
        EXPECT_EQ(largest[k / 8], *std::max_element(a.data() + k, a.data() + k + 8)) << set.instruction_set;
    }
  }
}

/// Random limits, some of them without a bound on one side.
StageQp with_limits(RandomQp& random) {
  const int intervals = random.integer(1, 6), states = random.integer(1, 9), controls = random.integer(1, 3);
  StageQp qp({intervals, states, controls, random.integer(1, 11)});
  qp.set_intervals(intervals);
  for (int i = 0; i <= intervals; ++i) {
    qp.set_sizes(i, states, i < intervals ? controls : 0);
    qp.set_limits(i, random.integer(0, qp.capacity().limits));
    for (int r = 0; r < qp.limits(i); ++r) {
      for (int j = 0; j < states + qp.controls(i); ++j)
        if (random.integer(0, 2) > 0) qp.G(i)[r * qp.stride() + j] = random.uniform(-1.0, 1.0);
      double multiplier = 0.0;
      RandomRows::set_bounds(random, qp.limit_lower(i)[r], qp.limit_upper(i)[r], multiplier);
      qp.limit_linear(i)[r] = random.integer(0, 1) == 0 ? infinity : 1.0;
      qp.limit_quadratic(i)[r] = random.integer(0, 1);
    }
  }
  return qp;
}

double value_of(const StageQp& qp, const double* z, int i, int r, const std::int8_t* held = nullptr) {
  double sum = 0.0;
  for (int j = 0; j < qp.capacity().states + qp.controls(i); ++j)
    if (!held || held[i * qp.stride() + j] == 0) sum += qp.G(i)[r * qp.stride() + j] * z[i * qp.stride() + j];
  return sum;
}

TEST(QpKernels, LimitsHaveTheValuesOfTheirRows) {
  RandomQp random(23);
  int violated = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const StageQp qp = with_limits(random);
    const int N = qp.intervals(), row = qp.capacity().limit_row(), stride = qp.stride();
    const LimitView view = view_of_limits(qp);
    Iterate z(qp.capacity());
    const double size = trial % 2 == 0 ? 0.05 : 1.0;
    for (int i = 0; i <= N; ++i)
      for (int j = 0; j < qp.capacity().states + qp.controls(i); ++j) z.row(i)[j] = size * random.uniform(-1.0, 1.0);
    bool violates = false;
    for (int i = 0; i <= N; ++i)
      for (int r = 0; r < qp.limits(i); ++r) {
        const double value = value_of(qp, z.row(0), i, r);
        violates |= value < qp.limit_lower(i)[r] - 1e-10 || value > qp.limit_upper(i)[r] + 1e-10;
      }
    violated += violates;
    std::vector<std::int8_t> held(static_cast<std::size_t>(N + 1) * stride, 0);
    for (int i = 0; i < N; ++i)
      held[i * stride + qp.capacity().states] = static_cast<std::int8_t>(random.integer(-1, 1));
    const AlignedDoubles steps = numbers(random, static_cast<std::size_t>(N + 1) * stride * 8);
    for (const KernelSet& set : runnable_kernels()) {
      AlignedDoubles values(static_cast<std::size_t>(N + 1) * row, 7.0), many(values.size() * 8, 7.0);
      EXPECT_EQ(set.qp->limit_values(view, z.row(0), 1e-10, values.data()), violates) << set.instruction_set;
      set.qp->limit_sensitivities(view, qp.control_counts(), qp.capacity().states, held.data(), steps.data(),
                                  many.data());
      AlignedDoubles one(static_cast<std::size_t>(N + 1) * stride);
      for (int c = 0; c < 8; ++c) {
        for (std::size_t k = 0; k < one.size(); ++k) one[k] = steps[k * 8 + c];
        for (int i = 0; i <= N; ++i)
          for (int r = 0; r < row; ++r) {
            const bool is_there = r < qp.limits(i);
            const int at = i * row + r;
            EXPECT_NEAR(values[at], is_there ? value_of(qp, z.row(0), i, r) : 0.0, 1e-14) << set.instruction_set;
            EXPECT_NEAR(many[at * 8 + c], is_there ? value_of(qp, one.data(), i, r, held.data()) : 0.0, 1e-14)
                << set.instruction_set;
          }
      }
    }
  }
  EXPECT_GT(violated, 10);
  EXPECT_LT(violated, 50);
}

TEST(QpKernels, SeeLimitsThatMakeNoSense) {
  RandomQp random(29);
  const double nan = std::nan("");
  for (int trial = 0; trial < 20; ++trial) {
    StageQp qp = with_limits(random);
    qp.set_limits(0, qp.capacity().limits);
    const int r = random.integer(0, qp.limits(0) - 1);
    for (int k = 0; k < qp.limits(0); ++k) {
      qp.limit_linear(0)[k] = 1.0;
      qp.limit_lower(0)[k] = -1.0;
      qp.limit_upper(0)[k] = 1.0;
    }
    const auto are_sound = [&](bool expected, const char* what) {
      for (const KernelSet& set : runnable_kernels())
        EXPECT_EQ(set.qp->limits_are_sound(view_of_limits(qp), 1e-10), expected) << set.instruction_set << ": " << what;
    };
    are_sound(true, "all");
    const auto with = [&](double& entry, double value, bool expected, const char* what) {
      const double before = std::exchange(entry, value);
      are_sound(expected, what);
      entry = before;
    };
    with(qp.G(0)[r * qp.stride()], nan, false, "a slope that is no number");
    with(qp.G(0)[r * qp.stride()], infinity, false, "an infinite slope");
    with(qp.limit_lower(0)[r], nan, false, "no number as a lower bound");
    with(qp.limit_upper(0)[r], nan, false, "no number as an upper bound");
    with(qp.limit_lower(0)[r], infinity, false, "out of reach");
    with(qp.limit_upper(0)[r], -infinity, false, "out of reach");
    with(qp.limit_lower(0)[r], -infinity, true, "one side");
    with(qp.limit_lower(0)[r], 1.0, true, "an equality");
    with(qp.limit_lower(0)[r], 1.01, false, "bounds that cross");
    with(qp.limit_linear(0)[r], infinity, true, "hard");
    with(qp.limit_linear(0)[r], nan, false, "no number as a price");
    with(qp.limit_linear(0)[r], -1.0, false, "a negative price");
    qp.limit_quadratic(0)[r] = 0.0;
    with(qp.limit_linear(0)[r], 0.0, false, "no price");
  }
}

}  // namespace qp_kernels_test
}  // namespace rhec
