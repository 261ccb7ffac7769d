// The kernels of the core for every instruction set that this machine can run: the recursion against dense systems, the
// loops over programs against the narrowest set.
#include "kernels/kernels.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "kernels/program_kernels.hpp"
#include "kernels/riccati_kernels.hpp"
#include "program_view.hpp"
#include "random_qp.hpp"

namespace rhec {
namespace {

using testing::DenseQp;
using testing::RandomQp;

constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(Kernels, AreThereForEverySetThatThisMachineRuns) {
  ASSERT_FALSE(runnable_kernels().empty());
  EXPECT_STREQ(runnable_kernels().front().instruction_set, "generic");
#if defined(__x86_64__)
  EXPECT_EQ(runnable_kernels().size() > 1, __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"));
#endif
}

/// What the recursion keeps of a program.
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
    view.carried_counts = qp.carried_counts();
    view.F = qp.F(0);
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

/// Holds some controls at bounds of their own.
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

TEST(Kernels, OfTheRecursionAgreeWithTheDenseSystem) {
  RandomQp random(7);
  for (int trial = 0; trial < 300; ++trial) {
    // Five to eight states have kernels of their own, with two to four controls; long rows take several registers.
    const int states = trial % 3 == 0 ? random.integer(1, 14) : random.integer(5, 8);
    const int controls = trial % 3 == 0 ? random.integer(1, 12) : random.integer(2, 4);
    StageQp qp = random.make(random.integer(1, 7), states, controls, true);
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

TEST(Kernels, OfResponsesAreWhatAStepDiffersBy) {
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
      // Where there are no gradients, what is in their place is not looked at.
      std::vector<unsigned char> has_gradient(N + 1, 0);
      has_gradient[stage] = 1;
      for (int i = 0; i <= N; ++i)
        for (int k = 0; i != stage && k < states + qp.controls(i); ++k) at(i, k, number) = 3.0;
      set.riccati->respond_backward(before.view, stage, has_gradient.data(), values.data());
      for (int j = 0; j < states; ++j)
        for (int other = 0; other < response_batch; ++other) at(0, j, other) = 0.0;
      set.riccati->respond_forward(before.view, stage, values.data(), costates.data());

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

TEST(Kernels, OfTheRecursionStopWhereTheReducedHessianIsNotDefinite) {
  RandomQp random(8);
  for (int trial = 0; trial < 20; ++trial) {
    StageQp qp = random.make(5, trial % 2 == 0 ? 6 : 4, 2, true);
    int bent = -1;
    for (int i = 0; i < qp.intervals(); ++i)
      if (qp.controls(i) > 0) bent = i;
    if (bent < 0) continue;
    qp.R_of(bent)(0, 0) = -1e4;
    const ActiveSet none(qp.capacity());
    for (const KernelSet& set : runnable_kernels()) {
      Recursion recursion(qp, none);
      EXPECT_EQ(set.riccati->factor(recursion.view, qp.intervals() - 1, 1e-11), bent) << set.instruction_set;
    }
  }
}

/// Random rows of an iterate and a program, where some bounds are infinite.
struct RandomProgram {
  StageQp qp;
  Iterate point;
  ProgramView view;

  /// Of sizes that kernels are compiled for, or of any.
  explicit RandomProgram(RandomQp& random, bool is_usual = false)
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

void expect_same_rows(const double* a, const double* b, std::ptrdiff_t count, double tolerance, const char* set) {
  for (std::ptrdiff_t k = 0; k < count; ++k)
    ASSERT_NEAR(a[k], b[k], tolerance * (1.0 + std::abs(a[k]))) << set << ", " << k;
}

TEST(Kernels, OverProgramsAgree) {
  RandomQp random(9);
  for (int trial = 0; trial < 150; ++trial) {
    RandomProgram program(random, trial % 3 == 0);
    if (trial % 10 == 3) program.qp.state_lower(1)[0] = std::nan("");
    if (trial % 10 == 5) program.point.state(1)[0] = infinity;
    std::vector<unsigned char> marks(program.qp.intervals() + 1), same_marks(marks.size());
    const ProgramKernels& generic = *runnable_kernels().front().program;
    const KktParts kkt = generic.kkt(program.view);
    const StepParts check = generic.check_step(program.view, 1e-10);
    const bool crosses = generic.mark_bounds(program.view, 1e-10, marks.data());
    if (trial % 10 == 5) {
      EXPECT_FALSE(check.is_finite);
    }
    for (const KernelSet& set : runnable_kernels()) {
      const KktParts same = set.program->kkt(program.view);
      EXPECT_NEAR(same.stationarity, kkt.stationarity, 1e-12) << set.instruction_set;
      EXPECT_EQ(same.defect, kkt.defect);
      EXPECT_EQ(same.bound_violation, kkt.bound_violation);
      EXPECT_EQ(same.complementarity, kkt.complementarity);
      EXPECT_EQ(same.largest_term, kkt.largest_term);
      const StepParts same_check = set.program->check_step(program.view, 1e-10);
      EXPECT_EQ(same_check.is_finite, check.is_finite) << set.instruction_set << ", " << trial;
      if (check.is_finite) {
        EXPECT_EQ(same_check.violates, check.violates);
      }
      if (check.is_finite) {
        EXPECT_EQ(same_check.largest_costate, check.largest_costate);
      }
      EXPECT_EQ(set.program->mark_bounds(program.view, 1e-10, same_marks.data()), crosses) << set.instruction_set;
      EXPECT_EQ(same_marks, marks) << set.instruction_set;
    }
  }
}

/// The costs of an estimator or a controller over random rows, once for each set.
struct RandomCosts {
  int N, states, controls, vehicle_states, outputs, inputs, stride;
  std::vector<int> control_counts;
  AlignedDoubles H, h, values, references, weights, turns, inverse_turns, y, predicted, jacobians;
  AlignedDoubles u, input_weights;
  std::vector<double> room, pulls;   ///< of the latter none: H holds nothing yet
  std::vector<unsigned char> clean;  ///< empty: of no stage

  explicit RandomCosts(RandomQp& random)
      : N(random.integer(1, 8)),
        vehicle_states(random.integer(1, 10)),
        outputs(random.integer(1, 10)),
        inputs(random.integer(1, 3)) {
    states = vehicle_states + random.integer(0, 3);
    controls = inputs + random.integer(0, 2);
    stride = Capacity{N, states, controls}.row();
    const auto rows = [&](std::size_t count, std::size_t width) {
      AlignedDoubles v(count * width);
      for (double& entry : v) entry = random.uniform(-4.0, 4.0);
      return v;
    };
    const std::size_t nodes = N + 1, wide = padded(vehicle_states), seen = padded(outputs);
    for (int i = 0; i <= N; ++i) control_counts.push_back(random.integer(inputs, controls));
    H = rows(nodes * (states + controls), stride);
    h = rows(nodes, stride);
    values = rows(nodes, stride);
    references = rows(nodes, stride);
    const std::size_t longest = std::max<std::size_t>(stride, seen);
    for (auto* v : {&weights, &turns, &inverse_turns}) v->assign(longest, 0.0);
    for (std::size_t k = 0; k < longest; ++k) {
      weights[k] = k % 3 == 2 ? 0.0 : random.uniform(0.1, 2.0);
      if (k % 4 == 1) turns[k] = 6.25, inverse_turns[k] = 1.0 / 6.25;
    }
    y = rows(nodes, seen);
    for (std::size_t k = 0; k < y.size(); ++k)
      if (static_cast<int>(k % seen) >= outputs || random.integer(0, 5) == 0) y[k] = std::nan("");
    predicted = rows(nodes, seen);
    jacobians = rows(nodes * outputs, wide);
    for (std::size_t k = 0; k < jacobians.size(); ++k)
      if (static_cast<int>(k % wide) >= vehicle_states) jacobians[k] = 0.0;
    u.assign(nodes * stride, std::nan(""));
    input_weights.assign(stride, 0.0);
    for (int j = 0; j < inputs; ++j) {
      input_weights[states + j] = 0.7;
      for (int i = 0; i < N; ++i)
        if (random.integer(0, 4) > 0) u[i * stride + states + j] = random.uniform(-1., 1.);
    }
    room.assign(2 * seen, 0.0);
  }
  CostView view(bool matrices, bool vectors, bool bends) {
    return {N,
            states,
            controls,
            stride,
            control_counts.data(),
            matrices ? H.data() : nullptr,
            vectors ? h.data() : nullptr,
            bends};
  }
  double measure(const ProgramKernels& kernels, bool matrices, bool vectors) {
    return kernels.write_measurements(
        view(matrices, vectors, false),
        {vehicle_states, outputs, inputs, y.data(), u.data(), predicted.data(), jacobians.data(), weights.data(),
         input_weights.data(), turns.data(), inverse_turns.data(), values.data(), room.data(),
         pulls.empty() ? nullptr : pulls.data(), clean.empty() ? nullptr : clean.data()},
        0, N);
  }
  double track(const ProgramKernels& kernels, bool matrices, bool vectors, bool bends) {
    return kernels.write_tracking(
        view(matrices, vectors, bends),
        {values.data(), references.data(), weights.data(), weights.data(), turns.data(), inverse_turns.data()}, 0, N);
  }
};

/// What is used of H and all of h must agree.
void expect_same_costs(const RandomCosts& a, const RandomCosts& b, bool matrices, const char* set) {
  expect_same_rows(a.h.data(), b.h.data(), static_cast<std::ptrdiff_t>(a.h.size()), 1e-12, set);
  for (int i = 0; matrices && i <= a.N; ++i) {
    const int used = a.states + (i < a.N ? a.control_counts[i] : 0);
    for (int c = 0; c < used; ++c) {
      const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(i * (a.states + a.controls) + c) * a.stride;
      expect_same_rows(a.H.data() + row, b.H.data() + row, used, 1e-12, set);
    }
  }
}

TEST(Kernels, OfCostsAgree) {
  RandomQp random(10);
  for (int trial = 0; trial < 150; ++trial) {
    const RandomCosts start(random);
    const bool matrices = trial % 3 != 0, vectors = trial % 3 != 1, tracks = trial % 2 == 0, bends = trial % 5 == 0;
    const auto evaluate = [&](RandomCosts& costs, const ProgramKernels& kernels) {
      return tracks ? costs.track(kernels, matrices, vectors, bends) : costs.measure(kernels, matrices, vectors);
    };
    RandomCosts generic = start;
    const double total = evaluate(generic, *runnable_kernels().front().program);
    for (const KernelSet& set : runnable_kernels()) {
      RandomCosts wide = start;
      const double same = evaluate(wide, *set.program);
      if (vectors) {
        EXPECT_NEAR(same, total, 1e-10 * (1.0 + total)) << set.instruction_set;
      }
      expect_same_costs(generic, wide, matrices, set.instruction_set);
      if (tracks) continue;
      // Where H is zero already, but for what measurements write to, it comes to the same.
      RandomCosts again = wide;
      again.clean.assign(again.N + 1, matrices ? 1 : 0);
      evaluate(again, *set.program);
      expect_same_costs(generic, again, matrices, set.instruction_set);
    }
  }
}

TEST(Kernels, OfMeasurementsAreTheSumOfSquares) {
  RandomQp random(11);
  for (int trial = 0; trial < 60; ++trial) {
    RandomCosts costs(random);
    double expected = 0.0;
    std::vector<double> gradient(costs.h.size(), 0.0);
    const int seen = padded(costs.outputs), wide = padded(costs.vehicle_states);
    for (int i = 0; i <= costs.N; ++i) {
      for (int j = 0; j < costs.outputs; ++j) {
        const double y = costs.y[i * seen + j];
        if (std::isnan(y)) continue;
        double error = costs.predicted[i * seen + j] - y;
        if (costs.turns[j] > 0.0) error = std::remainder(error, costs.turns[j]);
        expected += costs.weights[j] * error * error;
        for (int c = 0; c < costs.vehicle_states; ++c)
          gradient[i * costs.stride + c] +=
              2.0 * costs.weights[j] * error * costs.jacobians[(i * costs.outputs + j) * wide + c];
      }
      for (int j = 0; i < costs.N && j < costs.inputs; ++j) {
        const int at = i * costs.stride + costs.states + j;
        const double measured = costs.u[at];
        if (std::isnan(measured)) continue;
        const double error = costs.values[at] - measured;
        expected += costs.input_weights[costs.states + j] * error * error;
        gradient[at] += 2.0 * costs.input_weights[costs.states + j] * error;
      }
    }
    for (const KernelSet& set : runnable_kernels()) {
      EXPECT_NEAR(costs.measure(*set.program, false, true), expected, 1e-10 * (1.0 + expected)) << set.instruction_set;
      expect_same_rows(gradient.data(), costs.h.data(), static_cast<std::ptrdiff_t>(gradient.size()), 1e-11,
                       set.instruction_set);
    }
  }
}

TEST(Kernels, SquaresOfMeasurementsAreAddedToWhatBends) {
  RandomQp random(15);
  for (int trial = 0; trial < 60; ++trial) {
    const RandomCosts start(random);
    const int seen = padded(start.outputs);
    for (const KernelSet& set : runnable_kernels()) {
      RandomCosts alone = start, added = start;
      const double total = alone.measure(*set.program, true, true);
      added.pulls.assign((added.N + 1) * seen, 0.0);
      EXPECT_NEAR(added.measure(*set.program, true, true), total, 1e-12 * (1.0 + total)) << set.instruction_set;
      // Of the squares alone, what is not used of H is not written.
      for (int i = 0; i <= start.N; ++i) {
        const int used = start.states + (i < start.N ? start.control_counts[i] : 0);
        for (int c = 0; c < used; ++c)
          for (int r = 0; r < used; ++r) {
            const std::ptrdiff_t at = (i * (start.states + start.controls) + c) * start.stride + r;
            alone.H[at] += start.H[at];
          }
      }
      expect_same_costs(alone, added, true, set.instruction_set);
      for (int i = 0; i <= start.N; ++i)
        for (int j = 0; j < start.outputs; ++j) {
          const double y = start.y[i * seen + j];
          double error = std::isnan(y) ? 0.0 : start.predicted[i * seen + j] - y;
          if (start.turns[j] > 0.0) error = std::remainder(error, start.turns[j]);
          EXPECT_NEAR(added.pulls[i * seen + j], 2.0 * start.weights[j] * error, 1e-12) << set.instruction_set;
        }
    }
  }
}

TEST(Kernels, OfPlainSumsAgree) {
  RandomQp random(14);
  const auto numbers = [&](std::size_t count) {
    AlignedDoubles v(count);
    for (double& entry : v) entry = random.uniform(-2.0, 2.0);
    return v;
  };
  for (int trial = 0; trial < 40; ++trial) {
    const int columns = random.integer(1, 20), count = random.integer(1, 20), width = padded(columns);
    const AlignedDoubles J = numbers(static_cast<std::size_t>(count) * width), weights = numbers(count),
                         pulls = numbers(count),
                         batch = numbers(static_cast<std::size_t>(padded(count)) * response_batch),
                         of_batch = numbers(response_batch), a = numbers(width), b = numbers(width);
    const AlignedDoubles H = numbers(static_cast<std::size_t>(width) * width), h = numbers(width);
    for (const KernelSet& set : runnable_kernels()) {
      AlignedDoubles sum_H = H, sum_h = h, out(width), sums(padded(count), 0.5);
      set.program->add_products(J.data(), weights.data(), pulls.data(), count, columns, width, sum_H.data(),
                                sum_h.data());
      for (int c = 0; c < columns; ++c) {
        double gradient = h[c];
        for (int j = 0; j < count; ++j) gradient += pulls[j] * J[j * width + c];
        EXPECT_NEAR(sum_h[c], gradient, 1e-12) << set.instruction_set;
        for (int r = 0; r < columns; ++r) {
          double entry = H[c * width + r];
          for (int j = 0; j < count; ++j) entry += weights[j] * J[j * width + c] * J[j * width + r];
          EXPECT_NEAR(sum_H[c * width + r], entry, 1e-12) << set.instruction_set;
        }
      }
      std::copy_n(b.data(), width, out.data());
      set.program->add(a.data(), out.data(), width);
      for (int k = 0; k < width; ++k) EXPECT_EQ(out[k], a[k] + b[k]) << set.instruction_set;
      set.program->write_bounds(a.data(), h.data(), b.data(), out.data(), sum_h.data(), width);
      for (int k = 0; k < width; ++k) {
        EXPECT_EQ(out[k], a[k] - b[k]) << set.instruction_set;
        EXPECT_EQ(sum_h[k], h[k] - b[k]) << set.instruction_set;
      }
      AlignedDoubles lower = a, upper = b;
      lower[0] = -infinity;
      upper[0] = infinity;
      set.program->widen_bounds(lower.data(), upper.data(), 1e-3, width, out.data(), sum_h.data());
      for (int k = 0; k < width; ++k) {
        EXPECT_DOUBLE_EQ(out[k], lower[k] - 1e-3 * (1.0 + std::abs(lower[k]))) << set.instruction_set;
        EXPECT_DOUBLE_EQ(sum_h[k], upper[k] + 1e-3 * (1.0 + std::abs(upper[k]))) << set.instruction_set;
      }
      std::copy_n(h.data(), width, sum_h.data());
      const ViolationParts found = set.program->find_violations(a.data(), b.data(), sum_h.data(), width, out.data());
      int violated = 0;
      double worst = 0.0;
      for (int k = 0; k < width; ++k) {
        EXPECT_EQ(out[k], std::max(b[k] - a[k], a[k] - sum_h[k])) << set.instruction_set;
        violated += out[k] > 0.0;
        worst = std::max(worst, out[k]);
      }
      EXPECT_EQ(found.count, violated) << set.instruction_set;
      EXPECT_EQ(found.largest, worst) << set.instruction_set;
      set.riccati->combine(batch.data(), of_batch.data(), sums.data(), padded(count));
      for (int j = 0; j < count; ++j) {
        double expected = 0.5;
        for (int k = 0; k < response_batch; ++k) expected += batch[j * response_batch + k] * of_batch[k];
        EXPECT_NEAR(sums[j], expected, 1e-12) << set.instruction_set;
      }
    }
  }
}

TEST(Kernels, CompleteDynamicsWithCarriedChannels) {
  RandomQp random(12);
  for (int trial = 0; trial < 60; ++trial) {
    const int N = random.integer(1, 6), vehicle = random.integer(1, 9), channels = random.integer(1, 4);
    const int states = vehicle + channels, controls = 2 + channels;
    const Capacity capacity{N, states, controls};
    StageQp qp(capacity);
    Iterate point(capacity);
    std::vector<int> control_of(static_cast<std::size_t>(N) * channels, -1);
    for (int i = 0; i <= N; ++i) {
      for (int j = 0; j < states + controls; ++j) point.row(i)[j] = random.uniform(-1.0, 1.0);
      for (int j = 0; j < vehicle; ++j) qp.b(i)[j] = random.uniform(-1.0, 1.0);
      int next = 2;
      for (int c = 0; i < N && c < channels; ++c)
        if (random.integer(0, 2) == 0) control_of[i * channels + c] = next++;
    }
    const StageQp start = qp;
    for (const KernelSet& set : runnable_kernels()) {
      qp = start;
      DynamicsView view{};
      view.last = N - 1;
      view.states = states;
      view.stride = qp.stride();
      view.vehicle_states = vehicle;
      view.channels = channels;
      view.control_of = control_of.data();
      view.values = point.row(0);
      view.F = qp.F(0);
      view.b = qp.b(0);
      set.program->complete_dynamics(view);
      for (int i = 0; i < N; ++i) {
        for (int j = 0; j < vehicle; ++j) EXPECT_EQ(qp.b(i)[j], start.b(i)[j] - point.state(i + 1)[j]);
        for (int c = 0; c < channels; ++c) {
          const int control = control_of[i * channels + c], row = vehicle + c;
          const int column = control >= 0 ? states + control : row;
          EXPECT_EQ(qp.b(i)[row], point.row(i)[column] - point.state(i + 1)[row]) << set.instruction_set;
          for (int k = 0; k < qp.stride(); ++k) EXPECT_EQ(qp.F(i)[row * qp.stride() + k], k == column ? 1.0 : 0.0);
        }
      }
    }
  }
}

TEST(Kernels, InvertAndSolveSymmetricSystems) {
  RandomQp random(13);
  for (int trial = 0; trial < 60; ++trial) {
    const int n = trial < 20 ? 6 : random.integer(1, 16), stride = trial % 2 == 0 && n <= 8 ? 8 : 16;
    Eigen::MatrixXd root(n, n), P = Eigen::MatrixXd::Zero(n, n);
    for (double& entry : root.reshaped()) entry = random.uniform(-1.0, 1.0);
    P = root * root.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n);
    // What rows have beyond the matrix is not theirs.
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
      // Not positive definite, or hardly so.
      AlignedDoubles bad = matrix;
      bad[0] = -1.0;
      EXPECT_FALSE(set.riccati->invert(bad.data(), n, stride, 1e-11, inverse.data())) << set.instruction_set;
      bad[0] = std::nan("");
      EXPECT_FALSE(set.riccati->invert(bad.data(), n, stride, 1e-11, inverse.data())) << set.instruction_set;
    }
  }
}

TEST(Kernels, AdoptWhatBoundsAllowAndMatchRows) {
  RandomQp random(14);
  for (int trial = 0; trial < 100; ++trial) {
    const int rows = random.integer(1, 7), vehicle = random.integer(1, 6), states = vehicle + random.integer(0, 3),
              used = states + random.integer(0, 4), stride = padded(used + random.integer(0, 3));
    const std::size_t count = static_cast<std::size_t>(rows) * stride;
    AlignedDoubles values(count), multipliers(count), lower(count), upper(count), to(count), to_multipliers(count);
    for (std::size_t k = 0; k < count; ++k) {
      values[k] = random.uniform(-2.0, 2.0);
      multipliers[k] = random.integer(0, 1) * random.uniform(-1.0, 1.0);
      lower[k] = random.integer(0, 1) == 0 ? -infinity : random.uniform(-1.5, -0.2);
      upper[k] = random.integer(0, 1) == 0 ? infinity : random.uniform(0.2, 1.5);
    }
    const GuessView from{rows,         stride,      vehicle, states, used, values.data(), multipliers.data(),
                         lower.data(), upper.data()};
    AlignedDoubles other = values;
    const int changed = random.integer(0, rows - 1), changed_column = random.integer(0, stride - 1);
    other[static_cast<std::size_t>(changed) * stride + changed_column] += 1e-9;
    for (const KernelSet& set : runnable_kernels()) {
      set.program->adopt(from, to.data(), to_multipliers.data());
      for (std::size_t k = 0; k < count; ++k) {
        const int column = static_cast<int>(k % stride);
        const bool is_used = column < used, is_control = is_used && column >= states;
        const bool has_bound = std::isfinite(multipliers[k] > 0.0 ? upper[k] : lower[k]);
        const bool is_carried = column >= vehicle && column < states;
        const double clipped = std::min(std::max(values[k], lower[k]), upper[k]);
        EXPECT_EQ(to[k], is_control ? clipped : is_used ? values[k] : 0.0) << set.instruction_set << ", " << column;
        EXPECT_EQ(to_multipliers[k], is_used && !is_carried && has_bound ? multipliers[k] : 0.0) << set.instruction_set;
      }
      std::vector<unsigned char> marks(rows, 9);
      AlignedDoubles kept = other;  // what is compared with is what is kept before
      set.program->match(values.data(), kept.data(), kept.data(), rows, stride, states, marks.data());
      for (int i = 0; i < rows; ++i)
        EXPECT_EQ(marks[i], i != changed ? 2 : changed_column < states ? 0 : 1) << set.instruction_set;
      EXPECT_EQ(kept, values) << set.instruction_set;
    }
  }
}

}  // namespace
}  // namespace rhec
