// The kernels of banks of filters: every instruction set that this machine supports, compared with plain matrices.
#include "rhec/core/kernels/bank_kernels.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <numbers>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "support/largest.hpp"
#include "support/random_qp.hpp"

namespace rhec {
namespace bank_kernels_test {

using testing::largest;
using testing::RandomQp;

/// A bank with random moments, in both forms.
struct RandomBank {
  int members, nx, n;
  std::vector<int> first, count;
  std::vector<Eigen::VectorXd> means;
  std::vector<Eigen::MatrixXd> covariances;
  AlignedDoubles mean, covariance, work;

  explicit RandomBank(RandomQp& random) : members(8 * random.integer(1, 3)), nx(random.integer(1, 5)), n(nx) {
    for (int j = random.integer(0, 3); j > 0; --j) {
      first.push_back(n);
      count.push_back(random.integer(1, 4));
      n += count.back();
    }
    mean.assign(static_cast<std::size_t>(n) * members, 0.0);
    covariance.assign(static_cast<std::size_t>(n) * n * members, 0.0);
    work.assign(static_cast<std::size_t>(2 * n * n + 3 * n) * members, 0.0);
    for (int m = 0; m < members; ++m) {
      means.push_back(matrix(random, n, 1));
      const Eigen::MatrixXd root = matrix(random, n, n + 1);
      covariances.emplace_back(root * root.transpose());
      put(means.back(), mean, m);
      put(covariances.back(), covariance, m);
    }
  }
  static Eigen::MatrixXd matrix(RandomQp& random, int rows, int columns) {
    Eigen::MatrixXd entries(rows, columns);
    for (double& entry : entries.reshaped()) entry = random.uniform(-1.0, 1.0);
    return entries;
  }
  void put(const Eigen::MatrixXd& from, AlignedDoubles& to, int member) const {
    for (Eigen::Index e = 0; e < from.size(); ++e) to[e * members + member] = from.data()[e];
  }
  Eigen::MatrixXd taken(const AlignedDoubles& from, int member, int rows, int columns) const {
    Eigen::MatrixXd entries(rows, columns);
    for (Eigen::Index e = 0; e < entries.size(); ++e) entries.data()[e] = from[e * members + member];
    return entries;
  }
  BankView view() { return {members, nx, n, mean.data(), covariance.data(), work.data()}; }
  void expect_equal(const char* set) const {
    for (int m = 0; m < members; ++m) {
      EXPECT_LT(largest(taken(mean, m, n, 1) - means[m]), 1e-12) << set;
      EXPECT_LT(largest(taken(covariance, m, n, n) - covariances[m]), 1e-11) << set;
      EXPECT_EQ(largest(taken(covariance, m, n, n) - taken(covariance, m, n, n).transpose()), 0.0) << set;
    }
  }
};

class BankKernelsTest : public ::testing::TestWithParam<int> {};

TEST_P(BankKernelsTest, PredictByTheWholeTransition) {
  for (const KernelSet& set : runnable_kernels()) {
    RandomQp random(GetParam());
    RandomBank bank(random);
    const int np = static_cast<int>(bank.first.size()), nu = random.integer(0, 3), nx = bank.nx, n = bank.n;
    const int columns = nx + nu + 2 * np;
    AlignedDoubles next(static_cast<std::size_t>(nx) * bank.members), jacobian(next.size() * columns);
    std::vector<AlignedDoubles> F(np), Q(np), ramp(np);
    std::vector<BankProcess> processes;
    std::vector<double> variances(nu);
    for (double& variance : variances) variance = random.uniform(0.0, 1.0);
    for (int j = 0; j < np; ++j) {
      F[j].assign(static_cast<std::size_t>(bank.count[j]) * bank.count[j] * bank.members, 0.0);
      Q[j] = F[j];
      ramp[j].assign(bank.members, 0.0);
      processes.push_back({bank.first[j], bank.count[j], F[j].data(), Q[j].data(), ramp[j].data()});
    }
    for (int m = 0; m < bank.members; ++m) {
      const Eigen::MatrixXd J = RandomBank::matrix(random, nx, columns), x = RandomBank::matrix(random, nx, 1);
      bank.put(J, jacobian, m);
      bank.put(x, next, m);
      // The transition of [x; z], and the matrix through which the noise of z enters.
      Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n), G = Eigen::MatrixXd::Identity(n, n),
                      N = Eigen::MatrixXd::Zero(n, n);
      A.topLeftCorner(nx, nx) = J.leftCols(nx);
      for (int j = 0; j < np; ++j) {
        const int first = bank.first[j], count = bank.count[j];
        const Eigen::MatrixXd own = RandomBank::matrix(random, count, count),
                              root = RandomBank::matrix(random, count, count);
        const Eigen::MatrixXd noise = root * root.transpose();
        bank.put(own, F[j], m);
        bank.put(noise, Q[j], m);
        const bool runs = random.integer(0, 1) == 1;
        ramp[j][m] = runs ? 1.0 : 0.0;
        A.block(first, first, count, count) = own;
        N.block(first, first, count, count) = noise;
        const Eigen::VectorXd start = J.col(nx + nu + j), end = J.col(nx + nu + np + j);
        A.block(0, first, nx, 1) += start;
        if (runs) {
          A.block(0, first, nx, count) += end * own.row(0);
          G.block(0, first, nx, 1) = end;
        } else {
          A.block(0, first, nx, 1) += end;
        }
      }
      Eigen::MatrixXd after = A * bank.covariances[m] * A.transpose() + G * N * G.transpose();
      for (int j = 0; j < nu; ++j)
        after.topLeftCorner(nx, nx) += J.col(nx + j) * variances[j] * J.col(nx + j).transpose();
      bank.covariances[m] = after;
      Eigen::VectorXd moved = A * bank.means[m];
      moved.head(nx) = x;
      bank.means[m] = moved;
    }
    set.bank->predict(bank.view(), {nu, np, processes.data(), next.data(), jacobian.data(), variances.data()});
    bank.expect_equal(set.instruction_set);
  }
}

TEST_P(BankKernelsTest, UpdateAsTheTextbookDoes) {
  for (const KernelSet& set : runnable_kernels()) {
    RandomQp random(GetParam());
    RandomBank bank(random);
    const int count = random.integer(1, 4), n = bank.n;
    std::vector<AlignedDoubles> predicted(count), gradients(count), noises(count);
    AlignedDoubles surprises(static_cast<std::size_t>(count) * bank.members), expected_surprises = surprises;
    std::vector<BankOutput> outputs;
    AlignedDoubles squares(bank.members, 0.5), expected_squares = squares,
                                               variances(static_cast<std::size_t>(count) * bank.members),
                                               expected_variances = variances;
    const std::vector<Eigen::MatrixXd> before = bank.covariances;
    std::vector<Eigen::VectorXd> corrections(bank.members, Eigen::VectorXd::Zero(n));
    for (int j = 0; j < count; ++j) {
      predicted[j].assign(bank.members, 0.0);
      gradients[j].assign(static_cast<std::size_t>(bank.nx) * bank.members, 0.0);
      // An angle that was measured some turns away is as near as the same one without.
      const bool is_angle = random.integer(0, 1) == 1;
      const double turns = is_angle ? 2.0 * std::numbers::pi * random.integer(-3, 3) : 0.0;
      const double measured = random.uniform(-1.0, 1.0);
      noises[j].assign(bank.members, 0.0);
      outputs.push_back({predicted[j].data(), gradients[j].data(), noises[j].data(), measured + turns,
                         is_angle ? 2.0 * std::numbers::pi : 0.0});
      for (int m = 0; m < bank.members; ++m) {
        predicted[j][m] = random.uniform(-1.0, 1.0);
        Eigen::VectorXd h = Eigen::VectorXd::Zero(n);
        h.head(bank.nx) = RandomBank::matrix(random, bank.nx, 1);
        bank.put(h.head(bank.nx), gradients[j], m);
        const double variance = noises[j][m] = random.uniform(0.01, 1.0);
        const double alone = measured - predicted[j][m];
        expected_surprises[j * bank.members + m] = alone * alone / (h.dot(before[m] * h) + variance);
        const double innovation = alone - h.dot(corrections[m]);
        const double S = h.dot(bank.covariances[m] * h) + variance;
        const Eigen::VectorXd gain = bank.covariances[m] * h / S;
        corrections[m] += gain * innovation;
        bank.covariances[m] -= Eigen::MatrixXd(gain * S * gain.transpose());
        expected_squares[m] += std::min(innovation * innovation / S, 1.5);
        expected_variances[j * bank.members + m] = S;
      }
    }
    for (int m = 0; m < bank.members; ++m) bank.means[m] += corrections[m];
    set.bank->surprise(bank.view(), outputs.data(), count, surprises.data());
    set.bank->update(bank.view(), outputs.data(), count, 1.5, squares.data(), variances.data());
    bank.expect_equal(set.instruction_set);
    for (int m = 0; m < bank.members; ++m) {
      EXPECT_NEAR(squares[m], expected_squares[m], 1e-11);
    }
    for (std::size_t k = 0; k < variances.size(); ++k) {
      EXPECT_NEAR(variances[k] / expected_variances[k], 1.0, 1e-12);
      EXPECT_NEAR(surprises[k], expected_surprises[k], 1e-11 * (1.0 + expected_surprises[k]));
    }
  }
}

TEST_P(BankKernelsTest, MovePointsToTheMeanGivenTheOutputs) {
  constexpr double gate = 1.5;
  for (const KernelSet& set : runnable_kernels()) {
    RandomQp random(GetParam());
    RandomBank bank(random);
    const int n = bank.n, count = random.integer(1, std::min(3, n));
    AlignedDoubles point(static_cast<std::size_t>(n) * bank.members), moved(bank.members, -1.0);
    std::vector<Eigen::VectorXd> points;
    for (int m = 0; m < bank.members; ++m) {
      points.emplace_back(RandomBank::matrix(random, n, 1));
      bank.put(points.back(), point, m);
    }
    std::vector<AlignedDoubles> predicted(count), gradients(count), noises(count);
    std::vector<BankOutput> outputs;
    std::vector<Eigen::MatrixXd> H(bank.members, Eigen::MatrixXd::Zero(count, n));
    std::vector<Eigen::VectorXd> innovations(bank.members, Eigen::VectorXd::Zero(count)), noise = innovations;
    for (int j = 0; j < count; ++j) {
      predicted[j].assign(bank.members, 0.0);
      noises[j].assign(bank.members, 0.0);
      gradients[j].assign(static_cast<std::size_t>(bank.nx) * bank.members, 0.0);
      const double measured = random.uniform(-1.0, 1.0);
      outputs.push_back({predicted[j].data(), gradients[j].data(), noises[j].data(), measured, 0.0});
      for (int m = 0; m < bank.members; ++m) {
        predicted[j][m] = random.uniform(-1.0, 1.0);
        noise[m][j] = noises[j][m] = random.uniform(0.01, 1.0);
        H[m].row(j).head(bank.nx) = RandomBank::matrix(random, 1, bank.nx);
        bank.put(H[m].row(j).head(bank.nx).transpose(), gradients[j], m);
        innovations[m][j] = measured - predicted[j][m] - H[m].row(j).dot(bank.means[m] - points[m]);
      }
    }
    const AlignedDoubles mean = bank.mean, covariance = bank.covariance;
    const int judged = std::max(1, n - 1);
    set.bank->move_point(bank.view(), outputs.data(), count, judged, gate, point.data(), moved.data());
    EXPECT_EQ(bank.mean, mean) << set.instruction_set;
    EXPECT_EQ(bank.covariance, covariance) << set.instruction_set;
    for (int m = 0; m < bank.members; ++m) {
      const Eigen::MatrixXd& P = bank.covariances[m];
      Eigen::MatrixXd S = H[m] * P * H[m].transpose();
      S.diagonal() = (S.diagonal() + noise[m]).cwiseMax(innovations[m].cwiseAbs2() / gate);
      const Eigen::VectorXd next = bank.means[m] + P * H[m].transpose() * S.inverse() * innovations[m];
      EXPECT_LT(largest(bank.taken(point, m, n, 1) - next), 1e-9) << set.instruction_set;
      const double farthest = ((next - points[m]).array().square() / P.diagonal().array()).head(judged).maxCoeff();
      EXPECT_NEAR(moved[m] / farthest, 1.0, 1e-9) << set.instruction_set;
    }
  }
}

TEST_P(BankKernelsTest, MixMomentsAsMixturesDo) {
  for (const KernelSet& set : runnable_kernels()) {
    RandomQp random(GetParam());
    RandomBank bank(random);
    AlignedDoubles weights(bank.members), keep(bank.members), take(bank.members);
    double total = 0.0;
    for (double& weight : weights) total += weight = random.uniform(0.0, 1.0);
    const int n = bank.n;
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(n), found(n);
    Eigen::MatrixXd second = Eigen::MatrixXd::Zero(n, n), spread(n, n);
    for (int m = 0; m < bank.members; ++m) {
      weights[m] /= total;
      take[m] = random.uniform(0.0, 1.0);
      keep[m] = 1.0 - take[m];
      mean += weights[m] * bank.means[m];
      second += weights[m] * (bank.covariances[m] + bank.means[m] * bank.means[m].transpose());
    }
    const Eigen::MatrixXd covariance = second - mean * mean.transpose();
    set.bank->moments(bank.view(), weights.data(), found.data(), spread.data());
    EXPECT_LT(largest(found - mean), 1e-13) << set.instruction_set;
    EXPECT_LT(largest(spread - covariance), 1e-12) << set.instruction_set;
    for (int m = 0; m < bank.members; ++m) {
      const Eigen::VectorXd own = bank.means[m];
      bank.means[m] = keep[m] * own + take[m] * mean;
      const Eigen::MatrixXd both =
          keep[m] * (bank.covariances[m] + own * own.transpose()) + take[m] * (covariance + mean * mean.transpose());
      bank.covariances[m] = both - bank.means[m] * bank.means[m].transpose();
    }
    set.bank->mix(bank.view(), weights.data(), keep.data(), take.data());
    bank.expect_equal(set.instruction_set);
  }
}

/// One member in a thousand may go wrong; it stays as it was, and no other notices.
TEST(BankKernels, MoveAPointToTheMeanWhereNoNumberComesOut) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  for (const KernelSet& set : runnable_kernels()) {
    AlignedDoubles mean(16, 2.0), covariance(32, 0.0), work(14 * 8, 0.0), point(16, 7.0), moved(8, 0.0);
    std::fill_n(covariance.begin(), 8, 1.0);
    std::fill_n(covariance.begin() + 24, 8, 4.0);
    AlignedDoubles predicted(8, nan), gradient(16, 1.0), noise(8, 1.0);
    const BankOutput output{predicted.data(), gradient.data(), noise.data(), 3.0, 0.0};
    set.bank->move_point({8, 2, 2, mean.data(), covariance.data(), work.data()}, &output, 1, 2, 16.0, point.data(),
                         moved.data());
    for (const double each : point) EXPECT_EQ(each, 2.0) << set.instruction_set;
    for (const double each : moved) EXPECT_EQ(each, 25.0) << set.instruction_set;
  }
}

TEST(BankKernels, LeaveAMemberAsItWasWhereNoNumberComesOut) {
  for (const KernelSet& set : runnable_kernels()) {
    RandomQp random(11);
    RandomBank bank(random);
    AlignedDoubles predicted(bank.members, 0.0), gradient(static_cast<std::size_t>(bank.nx) * bank.members, 1.0),
        squares(bank.members, 0.0), variances(bank.members, 0.0);
    predicted[3] = std::nan("");
    const AlignedDoubles noise(bank.members, 0.1);
    const BankOutput output{predicted.data(), gradient.data(), noise.data(), 0.5, 0.0};
    set.bank->update(bank.view(), &output, 1, 16.0, squares.data(), variances.data());
    EXPECT_EQ(largest(bank.taken(bank.mean, 3, bank.n, 1) - bank.means[3]), 0.0);
    EXPECT_EQ(largest(bank.taken(bank.covariance, 3, bank.n, bank.n) - bank.covariances[3]), 0.0);
    EXPECT_EQ(squares[3], 16.0) << "as if it were an outlier";
    EXPECT_EQ(variances[3], 1.0);
    for (int m = 0; m < bank.members; ++m) {
      EXPECT_TRUE(bank.taken(bank.mean, m, bank.n, 1).allFinite());
      if (m == 3) continue;
      EXPECT_GT(largest(bank.taken(bank.mean, m, bank.n, 1) - bank.means[m]), 0.0);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, BankKernelsTest, ::testing::Range(1, 25));

}  // namespace bank_kernels_test
}  // namespace rhec
