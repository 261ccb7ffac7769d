#include "rhec/core/prior/matern.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

namespace rhec {
namespace matern_test {

struct Moments {
  Eigen::MatrixXd F, Q, P;
  Moments(const Matern& matern, double d) : F(Eigen::MatrixXd::Zero(matern.states, matern.states)), Q(F), P(F) {
    matern.transition(d, F.data(), Q.data(), matern.states);
    matern.stationary(P.data(), matern.states);
  }
};

TEST(Matern, IsStationary) {
  for (int states = 1; states <= 3; ++states) {
    for (const double d : {1e-3, 0.5, 4.0, 60.0, 1e6}) {
      const Moments m({states, 3.0, 0.7}, d);
      const Eigen::VectorXd sigma = m.P.diagonal().cwiseSqrt();
      const Eigen::MatrixXd after = m.F * m.P * m.F.transpose() + m.Q;
      for (int r = 0; r < states; ++r)
        for (int c = 0; c < states; ++c)
          EXPECT_NEAR(after(r, c), m.P(r, c), 1e-13 * sigma[r] * sigma[c]) << states << " " << d;
    }
  }
}

/// For a short advance the noise is that of an integrated white noise, power by power: P - F P F' has none of these
/// digits left.
TEST(Matern, KeepsItsDigitsForShortAdvances) {
  const double d = 1e-6, l3 = std::sqrt(3.0) / 2.0, l5 = std::sqrt(5.0) / 2.0;
  const double q3 = 4.0 * std::pow(l3, 3), q5 = 16.0 / 3.0 * std::pow(l5, 5);
  const Moments half({1, 2.0, 1.0}, d), three({2, 2.0, 1.0}, d), five({3, 2.0, 1.0}, d);
  const auto near = [](double value, double expected) { EXPECT_NEAR(value / expected, 1.0, 1e-5); };
  near(half.Q(0, 0), d);  // 2 lambda d, lambda = 1/2
  near(three.Q(0, 0), q3 * std::pow(d, 3) / 3.0);
  near(three.Q(0, 1), q3 * std::pow(d, 2) / 2.0);
  near(three.Q(1, 1), q3 * d);
  near(five.Q(0, 0), q5 * std::pow(d, 5) / 20.0);
  near(five.Q(0, 1), q5 * std::pow(d, 4) / 8.0);
  near(five.Q(0, 2), q5 * std::pow(d, 3) / 6.0);
  near(five.Q(1, 1), q5 * std::pow(d, 3) / 3.0);
  near(five.Q(1, 2), q5 * std::pow(d, 2) / 2.0);
  near(five.Q(2, 2), q5 * d);
}

TEST(Matern, LeavesOtherRowsAlone) {
  Eigen::Matrix3d F = Eigen::Matrix3d::Constant(7.0), Q = F;
  Matern{2, 1.0, 1.0}.transition(0.5, F.data(), Q.data(), 3);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(F(2, k), 7.0);
    EXPECT_EQ(F(k, 2), 7.0);
    EXPECT_EQ(Q(2, k), 7.0);
    EXPECT_EQ(Q(k, 2), 7.0);
  }
}

}  // namespace matern_test
}  // namespace rhec
