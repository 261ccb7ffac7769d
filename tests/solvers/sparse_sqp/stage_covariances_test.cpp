#include "solvers/sparse_sqp/stage_covariances.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "rhec/core/qp/stage_qp_views.hpp"
#include "test_qps.hpp"

namespace rhec::sparse_sqp {
namespace stage_covariances_test {

using namespace testing;

TEST(StageCovariances, AreThoseOfTheDenseInverse) {
  RandomQp random(5);
  for (int trial = 0; trial < 40; ++trial) {
    const TestQp test(random_stages(random));
    const int stride = test.qp.capacity().states, N = test.qp.intervals();
    std::vector<double> blocks(static_cast<std::size_t>(N + 1) * stride * stride, -7.0);
    ASSERT_TRUE(stage_covariances(test.qp, blocks)) << trial;
    const Eigen::MatrixXd K = dense_kkt(test, Eigen::VectorXd::Zero(test.n), Eigen::VectorXd::Zero(test.m),
                                        std::vector<std::uint8_t>(test.n, 0)),
                          inverse = K.fullPivLu().inverse();
    for (int i = 0; i <= N; ++i) {
      const int start = test.nlp.state_start(i);
      for (int c = 0; c < stride; ++c)
        for (int r = 0; r < stride; ++r) {
          const double expected = start < 0 ? 0.0 : 2.0 * inverse(start + r, start + c);
          ASSERT_NEAR(blocks[(i * stride + c) * stride + r], expected, 1e-9 * (1.0 + std::abs(expected)))
              << trial << ", node " << i;
        }
    }
  }
}

TEST(StageCovariances, ThereAreNoneWithoutAnInverse) {
  RandomQp random(5);
  StageQp qp = random.make(4, 2, 1, false);
  for (int i = 0; i <= 4; ++i) Q_of(qp, i)(0, 0) -= 10.0;
  std::vector<double> blocks(20, -7.0);
  EXPECT_FALSE(stage_covariances(qp, blocks));
  EXPECT_THAT(blocks, ::testing::Each(-7.0));
}

}  // namespace stage_covariances_test
}  // namespace rhec::sparse_sqp
