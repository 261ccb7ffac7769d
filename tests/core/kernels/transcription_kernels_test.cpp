// The kernels for costs and dynamics: every instruction set that this machine supports, compared with plain sums and
// with the narrowest.
#include "rhec/core/kernels/transcription_kernels.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "rhec/core/kernels/kernel_sets.hpp"
#include "support/random_qp.hpp"

namespace rhec {
namespace transcription_kernels_test {

using testing::RandomQp;

constexpr double infinity = std::numeric_limits<double>::infinity();

void expect_same_rows(const double* a, const double* b, std::ptrdiff_t count, double tolerance, const char* set) {
  for (std::ptrdiff_t k = 0; k < count; ++k)
    ASSERT_NEAR(a[k], b[k], tolerance * (1.0 + std::abs(a[k]))) << set << ", " << k;
}

/// The costs of an estimator or a controller over random rows, once for each set.
struct RandomCosts {
  int N, states, controls, vehicle_states, outputs, inputs, stride;
  std::vector<int> control_counts;
  AlignedDoubles H, h, values, references, weights, turns, inverse_turns, y, predicted, jacobians;
  AlignedDoubles u, input_weights;
  AlignedDoubles node_weights;       ///< rows of outputs
  bool has_node_weights;             ///< else all nodes have `weights`
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
    has_node_weights = random.integer(0, 1) == 1;
    node_weights = rows(nodes, seen);
    for (double& weight : node_weights) weight = std::abs(weight);
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
  double weight(int node, int output) const {
    return has_node_weights ? node_weights[node * padded(outputs) + output] : weights[output];
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
  double measure(const TranscriptionKernels& kernels, bool matrices, bool vectors) {
    return kernels.write_measurements(
        view(matrices, vectors, false),
        {vehicle_states, outputs, inputs, y.data(), u.data(), predicted.data(), jacobians.data(),
         has_node_weights ? node_weights.data() : weights.data(), has_node_weights ? padded(outputs) : 0,
         input_weights.data(), turns.data(), inverse_turns.data(), values.data(), room.data(),
         pulls.empty() ? nullptr : pulls.data(), clean.empty() ? nullptr : clean.data()},
        0, N);
  }
  double track(const TranscriptionKernels& kernels, bool matrices, bool vectors, bool bends) {
    return kernels.write_tracking(
        view(matrices, vectors, bends),
        {values.data(), references.data(), weights.data(), weights.data(), turns.data(), inverse_turns.data()}, 0, N);
  }
};

/// The used part of H and all of h must agree.
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

TEST(TranscriptionKernels, OfCostsAgree) {
  RandomQp random(10);
  for (int trial = 0; trial < 150; ++trial) {
    const RandomCosts start(random);
    const bool matrices = trial % 3 != 0, vectors = trial % 3 != 1, tracks = trial % 2 == 0, bends = trial % 5 == 0;
    const auto evaluate = [&](RandomCosts& costs, const TranscriptionKernels& kernels) {
      return tracks ? costs.track(kernels, matrices, vectors, bends) : costs.measure(kernels, matrices, vectors);
    };
    RandomCosts generic = start;
    const double total = evaluate(generic, *runnable_kernels().front().transcription);
    for (const KernelSet& set : runnable_kernels()) {
      RandomCosts wide = start;
      const double same = evaluate(wide, *set.transcription);
      if (vectors) {
        EXPECT_NEAR(same, total, 1e-10 * (1.0 + total)) << set.instruction_set;
      }
      expect_same_costs(generic, wide, matrices, set.instruction_set);
      if (tracks) continue;
      // If H is already zero except where measurements write, the result is the same.
      RandomCosts again = wide;
      again.clean.assign(again.N + 1, matrices ? 1 : 0);
      evaluate(again, *set.transcription);
      expect_same_costs(generic, again, matrices, set.instruction_set);
    }
  }
}

TEST(TranscriptionKernels, OfMeasurementsAreTheSumOfSquares) {
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
        expected += costs.weight(i, j) * error * error;
        for (int c = 0; c < costs.vehicle_states; ++c)
          gradient[i * costs.stride + c] +=
              2.0 * costs.weight(i, j) * error * costs.jacobians[(i * costs.outputs + j) * wide + c];
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
      EXPECT_NEAR(costs.measure(*set.transcription, false, true), expected, 1e-10 * (1.0 + expected))
          << set.instruction_set;
      expect_same_rows(gradient.data(), costs.h.data(), static_cast<std::ptrdiff_t>(gradient.size()), 1e-11,
                       set.instruction_set);
    }
  }
}

TEST(TranscriptionKernels, SquaresOfMeasurementsAreAddedToWhatBends) {
  RandomQp random(15);
  for (int trial = 0; trial < 60; ++trial) {
    const RandomCosts start(random);
    const int seen = padded(start.outputs);
    for (const KernelSet& set : runnable_kernels()) {
      RandomCosts alone = start, added = start;
      const double total = alone.measure(*set.transcription, true, true);
      added.pulls.assign((added.N + 1) * seen, 0.0);
      EXPECT_NEAR(added.measure(*set.transcription, true, true), total, 1e-12 * (1.0 + total)) << set.instruction_set;
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
          EXPECT_NEAR(added.pulls[i * seen + j], 2.0 * start.weight(i, j) * error, 1e-12) << set.instruction_set;
        }
    }
  }
}

AlignedDoubles numbers(RandomQp& random, std::size_t count) {
  AlignedDoubles v(count);
  for (double& entry : v) entry = random.uniform(-2.0, 2.0);
  return v;
}

TEST(TranscriptionKernels, ComputeWhatTheySay) {
  RandomQp random(14);
  for (int trial = 0; trial < 40; ++trial) {
    const int columns = random.integer(1, 20), count = random.integer(1, 20), width = padded(columns);
    const AlignedDoubles J = numbers(random, static_cast<std::size_t>(count) * width), weights = numbers(random, count),
                         pulls = numbers(random, count), a = numbers(random, width), b = numbers(random, width);
    const AlignedDoubles H = numbers(random, static_cast<std::size_t>(width) * width), h = numbers(random, width);
    for (const KernelSet& set : runnable_kernels()) {
      AlignedDoubles sum_H = H, sum_h = h, out(width);
      set.transcription->add_products(J.data(), weights.data(), pulls.data(), count, columns, width, sum_H.data(),
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
      set.transcription->write_bounds(a.data(), h.data(), b.data(), out.data(), sum_h.data(), width);
      for (int k = 0; k < width; ++k) {
        EXPECT_EQ(out[k], a[k] - b[k]) << set.instruction_set;
        EXPECT_EQ(sum_h[k], h[k] - b[k]) << set.instruction_set;
      }
    }
  }
}

TEST(TranscriptionKernels, MultiplyRowsAndAddSums) {
  RandomQp random(15);
  for (int trial = 0; trial < 40; ++trial) {
    const int rows = random.integer(1, 9), inner = random.integer(1, 12), columns = random.integer(1, 20),
              width = padded(columns), c_step = inner + random.integer(0, 3), j_step = width + random.integer(0, 3);
    AlignedDoubles C = numbers(random, static_cast<std::size_t>(rows) * c_step),
                   J = numbers(random, static_cast<std::size_t>(inner) * j_step + 8),
                   W = numbers(random, static_cast<std::size_t>(rows) * rows), v = numbers(random, rows),
                   H = numbers(random, static_cast<std::size_t>(width) * width), h = numbers(random, width);
    for (const KernelSet& set : runnable_kernels()) {
      AlignedDoubles G(static_cast<std::size_t>(rows) * width, 7.0), sum_H = H, sum_h = h;
      set.transcription->multiply_rows(C.data(), c_step, J.data(), j_step, {rows, inner, columns}, width, G.data());
      for (int r = 0; r < rows; ++r)
        for (int k = 0; k < width; ++k) {
          double expected = 0.0;
          for (int l = 0; k < columns && l < inner; ++l) expected += C[r * c_step + l] * J[l * j_step + k];
          ASSERT_NEAR(G[r * width + k], expected, 1e-12) << set.instruction_set;
        }
      set.transcription->add_sums({G.data(), width, rows, W.data(), rows, v.data()}, columns, width, sum_H.data(),
                                  sum_h.data());
      for (int c = 0; c < columns; ++c) {
        double gradient = h[c];
        for (int p = 0; p < rows; ++p) gradient += G[p * width + c] * v[p];
        ASSERT_NEAR(sum_h[c], gradient, 1e-10) << set.instruction_set;
        for (int r = 0; r < columns; ++r) {
          double entry = H[c * width + r];
          for (int p = 0; p < rows; ++p)
            for (int q = 0; q < rows; ++q) entry += G[p * width + c] * W[p * rows + q] * G[q * width + r];
          ASSERT_NEAR(sum_H[c * width + r], entry, 1e-8) << set.instruction_set;
        }
      }
    }
  }
}

TEST(TranscriptionKernels, CompleteDynamicsWithCarriedChannels) {
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
      view.lifted = channels;
      view.control_of = control_of.data();
      view.values = point.row(0);
      view.AB = qp.AB(0);
      view.b = qp.b(0);
      set.transcription->complete_dynamics(view);
      for (int i = 0; i < N; ++i) {
        for (int j = 0; j < vehicle; ++j) EXPECT_EQ(qp.b(i)[j], start.b(i)[j] - point.state(i + 1)[j]);
        for (int c = 0; c < channels; ++c) {
          const int control = control_of[i * channels + c], row = vehicle + c;
          const int column = control >= 0 ? states + control : row;
          EXPECT_EQ(qp.b(i)[row], point.row(i)[column] - point.state(i + 1)[row]) << set.instruction_set;
          for (int k = 0; k < qp.stride(); ++k) EXPECT_EQ(qp.AB(i)[row * qp.stride() + k], k == column ? 1.0 : 0.0);
        }
      }
    }
  }
}

TEST(TranscriptionKernels, AdoptWhatBoundsAllowAndMatchRows) {
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
      set.transcription->adopt(from, to.data(), to_multipliers.data());
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
      set.transcription->match(values.data(), kept.data(), kept.data(), rows, stride, states, marks.data());
      for (int i = 0; i < rows; ++i)
        EXPECT_EQ(marks[i], i != changed ? 2 : changed_column < states ? 0 : 1) << set.instruction_set;
      EXPECT_EQ(kept, values) << set.instruction_set;
    }
  }
}

}  // namespace transcription_kernels_test
}  // namespace rhec
