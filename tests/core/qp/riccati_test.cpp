#include "rhec/core/qp/riccati.hpp"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "support/dense_solution.hpp"
#include "support/random_qp.hpp"

namespace rhec {
namespace riccati_test {

using testing::DenseQp;
using testing::expect_solved;
using testing::RandomQp;

TEST(ActiveSet, NamesTheBoundsThatAreHeldInTheirOrder) {
  RandomQp random(17);
  for (int trial = 0; trial < 50; ++trial) {
    const Capacity capacity{random.integer(1, 6), random.integer(1, 12), random.integer(1, 6)};
    ActiveSet active(capacity);
    std::vector<std::array<int, 3>> expected, found;
    for (int i = 0; i <= capacity.intervals; ++i)
      for (int k = 0; k < capacity.states + capacity.controls; ++k) {
        if (random.integer(0, 5) > 0) continue;
        const int side = random.integer(0, 1) == 0 ? -1 : 1;
        active.row(i)[k] = static_cast<std::int8_t>(side);
        expected.push_back({i, k, side});
      }
    active.for_each([&](int stage, int column, std::int8_t side) { found.push_back({stage, column, side}); });
    EXPECT_EQ(found, expected);
    active.clear();
    active.for_each([](int, int, std::int8_t) { ADD_FAILURE() << "nothing is held"; });
  }
}

TEST(Riccati, AgreesWithTheDenseSystemWithoutActiveBounds) {
  RandomQp random(1);
  for (int trial = 0; trial < 60; ++trial) {
    StageQp qp = random.make(random.integer(1, 8), random.integer(1, 5), random.integer(1, 4), trial % 2 == 0);
    if (trial % 3 == 0) random.carry(qp);
    expect_solved(qp, ActiveSet(qp.capacity()), 1e-9);
  }
}

/// Rows that are longer than those of the sizes that kernels are compiled for; some of their controls are held.
TEST(Riccati, AgreesWithTheDenseSystemWhateverTheSizes) {
  RandomQp random(31);
  for (int trial = 0; trial < 24; ++trial) {
    StageQp qp = random.make(random.integer(1, 4), random.integer(5, 40), random.integer(1, 20), trial % 2 == 0);
    if (trial % 3 == 0) random.carry(qp);
    ActiveSet active(qp.capacity());
    for (int i = 0; trial % 4 < 2 && i < qp.intervals(); ++i)
      for (int j = 0; j < qp.controls(i); ++j) {
        active.control(i)[j] = random.uniform(0.0, 1.0) < 0.3 ? 1 : 0;
        qp.control_upper(i)[j] = 0.3;
      }
    expect_solved(qp, active, 1e-7);
  }
}

TEST(Riccati, RespondsToAGradientAsTheSolutionChangesWithIt) {
  RandomQp random(8);
  for (int trial = 0; trial < 60; ++trial) {
    StageQp qp = random.make(random.integer(1, 8), random.integer(1, 7), random.integer(1, 11), trial % 2 == 0);
    const int N = qp.intervals(), ns = qp.capacity().states, stride = qp.stride();
    ActiveSet active(qp.capacity());
    std::vector<Riccati::Entry> places;
    for (int i = 0; i <= N; ++i) {
      for (int j = 0; j < qp.states(i); ++j) places.push_back({i, j});
      for (int j = 0; j < qp.controls(i); ++j) {
        active.control(i)[j] = random.uniform(0.0, 1.0) < 0.3 ? -1 : 0;
        qp.control_lower(i)[j] = -0.2;
        if (active.control(i)[j] == 0) places.push_back({i, ns + j});
      }
    }
    Riccati riccati(qp.capacity());
    riccati.factor(qp, active);
    Iterate before(qp.capacity()), after(qp.capacity());
    ASSERT_EQ(riccati.solve(qp, active, before), Riccati::Outcome::done);
    std::vector<Riccati::Entry> gradients;
    for (int c = random.integer(1, Riccati::Sensitivities::size); c > 0; --c)
      gradients.push_back(places[random.integer(0, static_cast<int>(places.size()) - 1)]);
    const int count = static_cast<int>(gradients.size());
    Riccati::Sensitivities sensitivities(qp.capacity());
    ASSERT_TRUE(riccati.find_sensitivities(qp, active, gradients.data(), count, sensitivities));
    for (int c = 0; c < count; ++c) {
      StageQp changed = qp;
      changed.h(gradients[c].stage)[gradients[c].place] += 1.0;
      ASSERT_EQ(riccati.solve(changed, active, after), Riccati::Outcome::done);
      for (int i = 0; i <= N; ++i) {
        const auto expect_response = [&](int place, double difference) {
          ASSERT_NEAR(sensitivities.values[(i * stride + place) * Riccati::Sensitivities::size + c], difference, 1e-9)
              << "trial " << trial << ", stage " << i << ", place " << place;
        };
        for (int j = 0; j < qp.states(i); ++j) expect_response(j, after.state(i)[j] - before.state(i)[j]);
        for (int j = 0; j < qp.controls(i); ++j)
          expect_response(ns + j, active.control(i)[j] ? after.control_bound(i)[j] - before.control_bound(i)[j]
                                                       : after.control(i)[j] - before.control(i)[j]);
      }
    }
  }
}

TEST(Riccati, CombinesResponsesToTheSolutionWithTheirGradients) {
  RandomQp random(10);
  for (int trial = 0; trial < 60; ++trial) {
    StageQp qp = random.make(random.integer(1, 8), random.integer(1, 7), random.integer(1, 11), trial % 2 == 0);
    if (trial % 4 < 2) random.carry(qp);
    ActiveSet active(qp.capacity());
    for (int i = 0; i < qp.intervals(); ++i) {
      for (int j = 0; j < qp.controls(i); ++j) {
        active.control(i)[j] = random.uniform(0.0, 1.0) < 0.3 ? 1 : 0;
        qp.control_upper(i)[j] = 0.3;
      }
    }
    Riccati riccati(qp.capacity());
    riccati.factor(qp, active);
    Riccati::Sensitivities sensitivities(qp.capacity());
    alignas(64) double weights[Riccati::Sensitivities::size] = {};
    StageQp changed = qp;
    std::vector<Riccati::Entry> gradients;
    for (int c = 0; c < trial % (Riccati::Sensitivities::size + 1); ++c) {
      const int stage = random.integer(0, qp.intervals());
      gradients.push_back({stage, random.integer(0, qp.states(stage) - 1)});
      weights[c] = random.uniform(-2.0, 2.0);
      changed.h(stage)[gradients[c].place] += weights[c];
    }
    ASSERT_TRUE(
        riccati.find_sensitivities(qp, active, gradients.data(), static_cast<int>(gradients.size()), sensitivities));
    Iterate expected(qp.capacity()), step(qp.capacity());
    ASSERT_EQ(riccati.solve(qp, active, step), Riccati::Outcome::done);
    std::vector<double> values(step.row(0),
                               step.row(0) + static_cast<std::ptrdiff_t>(qp.intervals() + 1) * qp.stride());
    riccati.add_values(sensitivities, weights, static_cast<int>(values.size()), values.data());
    riccati.combine(qp, active, sensitivities, weights, step);
    ASSERT_EQ(riccati.solve(changed, active, expected), Riccati::Outcome::done);
    for (int i = 0; i <= qp.intervals(); ++i) {
      for (int j = 0; j < qp.states(i); ++j) {
        ASSERT_NEAR(step.state(i)[j], expected.state(i)[j], 1e-9);
        ASSERT_EQ(values[i * qp.stride() + j], step.state(i)[j]);
        ASSERT_NEAR(step.costate(i)[j], expected.costate(i)[j], 1e-9) << "trial " << trial << ", node " << i;
        ASSERT_EQ(step.state_bound(i)[j], 0.0);
      }
      for (int j = 0; j < qp.controls(i); ++j) {
        ASSERT_NEAR(step.control(i)[j], expected.control(i)[j], 1e-9);
        ASSERT_NEAR(step.control_bound(i)[j], expected.control_bound(i)[j], 1e-9);
      }
    }
  }
}

TEST(Riccati, TheCovarianceIsThatOfTheDenseInverse) {
  RandomQp random(4);
  for (int trial = 0; trial < 60; ++trial) {
    // There are special kernels for six states with two to four controls.
    const bool is_usual = trial % 2 == 0;
    StageQp qp = random.make(random.integer(1, 9), is_usual ? 6 : random.integer(1, 4),
                             is_usual ? random.integer(2, 4) : random.integer(1, 3), false);
    if (trial % 3 != 0) random.carry(qp);
    const int ns = qp.capacity().states;
    Riccati riccati(qp.capacity());
    const ActiveSet none(qp.capacity());
    riccati.factor(qp, none);
    std::vector<double> blocks(static_cast<std::size_t>(qp.intervals() + 1) * ns * ns), last(ns * ns);
    riccati.covariances(qp, blocks.data(), last.data());
    const DenseQp dense(qp, none);
    const Eigen::MatrixXd null_space = dense.E.fullPivLu().kernel();
    const Eigen::MatrixXd covariance =
        2.0 * null_space * (null_space.transpose() * dense.H * null_space).inverse() * null_space.transpose();
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int c = 0; c < ns; ++c)
        for (int r = 0; r < ns; ++r)
          ASSERT_NEAR(blocks[(i * ns + c) * ns + r], covariance(dense.state_at[i] + r, dense.state_at[i] + c), 1e-8);
    EXPECT_EQ(last[0], blocks[static_cast<std::size_t>(qp.intervals()) * ns * ns]);
    // The last one alone, from as much of the factorisation as it takes; a step is found all the same.
    Iterate step(qp.capacity()), after(qp.capacity());
    ASSERT_EQ(riccati.solve(qp, none, step), Riccati::Outcome::done);
    std::vector<double> alone(ns * ns);
    riccati.factor_for_covariances(qp, none);
    riccati.covariances(qp, nullptr, alone.data());
    for (int k = 0; k < ns * ns; ++k) ASSERT_NEAR(alone[k], last[k], 1e-12 * (1.0 + std::abs(last[k])));
    ASSERT_EQ(riccati.solve(qp, none, after), Riccati::Outcome::done);
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int k = 0; k < qp.stride(); ++k) ASSERT_EQ(after.row(i)[k], step.row(i)[k]);
  }
}

/// A QP whose controls are coupled to nothing in H, and with few measured states behind the first node.
void decouple(RandomQp& random, StageQp& qp) {
  const int ns = qp.capacity().states, stride = qp.stride();
  for (int i = 0; i <= qp.intervals(); ++i) {
    double* const H = qp.H(i);
    const auto controls_end = ns + (i < qp.intervals() ? qp.controls(i) : 0);
    for (int r = 0; r < controls_end; ++r)
      for (int c = 0; c < controls_end; ++c)
        if (r != c && (r >= ns || c >= ns)) H[r * stride + c] = 0.0;
    if (i == 0) continue;
    std::vector<double> gradient(ns, 0.0);
    for (int k = 0; k < 3; ++k) gradient[random.integer(0, qp.states(i) - 1)] = random.uniform(-3.0, 3.0);
    for (int r = 0; r < qp.states(i); ++r)
      for (int c = 0; c < qp.states(i); ++c) H[r * stride + c] = i % 3 == 0 ? 0.0 : gradient[r] * gradient[c];
  }
}

TEST(Riccati, TheCovarianceOfTheFilterIsThatOfTheFactorisation) {
  RandomQp random(41);
  for (int trial = 0; trial < 40; ++trial) {
    StageQp qp = random.make(random.integer(1, 12), random.integer(1, 34), random.integer(1, 14), false);
    if (trial % 3 == 0) random.carry(qp);
    const int ns = qp.capacity().states;
    Riccati riccati(qp.capacity());
    std::vector<double> expected(ns * ns), found(ns * ns, 7.0);
    EXPECT_FALSE(riccati.filter_covariance(qp, found.data())) << "its controls are coupled";
    for (const double each : found) ASSERT_EQ(each, 7.0);
    decouple(random, qp);
    riccati.factor_for_covariances(qp, ActiveSet(qp.capacity()));
    ASSERT_FALSE(riccati.was_convexified());
    riccati.covariances(qp, nullptr, expected.data());
    if (qp.states(0) > 16) {
      EXPECT_FALSE(riccati.filter_covariance(qp, found.data()));
      continue;
    }
    ASSERT_TRUE(riccati.filter_covariance(qp, found.data())) << "trial " << trial;
    for (int k = 0; k < ns * ns; ++k)
      ASSERT_NEAR(found[k], expected[k], 1e-9 * (1.0 + std::abs(expected[k]))) << "trial " << trial;
    // One that is not semidefinite is none of a log-likelihood.
    qp.H(1)[0] = -1e9;
    EXPECT_FALSE(riccati.filter_covariance(qp, found.data()));
  }
}

}  // namespace riccati_test
}  // namespace rhec
