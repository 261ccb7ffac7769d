// The linearisation of an estimator's horizon evaluates the output function only at new nodes.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "rhec/core/ocp/linearisation.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"
#include "support/cart.hpp"
#include "support/other_model.hpp"

namespace rhec {
namespace rhe_linearisation_test {

using testing::cart;
using testing::cart_estimation;
using testing::scattered_point;

constexpr int intervals = 5;

/// Counts the nodes at which its outputs are evaluated.
class Watched final : public OtherModel {
 public:
  Watched() : OtherModel(cart()) {}
  void observe(const Nodes& request) const noexcept override {
    nodes += request.count;
    OtherModel::observe(request);
  }
  void observe_rows(const NodeRows& request) const noexcept override {
    nodes += request.count;
    OtherModel::observe_rows(request);
  }
  mutable int nodes = 0;
};

class RheLinearisationTest : public ::testing::Test {
 protected:
  RheLinearisationTest() : problem(model, cart_estimation(intervals)->setup()) {
    problem.take_data(*cart_estimation(intervals));
    linearisation = problem.make_linearisation();
    point = scattered_point(problem);
  }
  /// How many nodes a preparation evaluates.
  int observed() {
    const int before = model->nodes;
    linearisation->prepare(point, Hessian::gauss_newton);
    const int found = model->nodes - before;
    linearisation->refresh(point);
    EXPECT_EQ(model->nodes - before, found) << "new data need no look";
    return found;
  }
  /// As the problem itself linearises.
  void expect_as_anew() {
    StageQp expected(problem.capacity());
    std::vector<double> scratch(problem.scratch_size());
    problem.linearise(all_stages(problem), point, Hessian::gauss_newton, expected, scratch);
    const StageQp& qp = linearisation->qp();
    for (int i = 0; i <= intervals; ++i) {
      for (int j = 0; j < qp.states(i); ++j) EXPECT_NEAR(qp.q(i)[j], expected.q(i)[j], 1e-13) << i;
      for (int j = 0; j < qp.controls(i); ++j) EXPECT_NEAR(qp.r(i)[j], expected.r(i)[j], 1e-13) << i;
      EXPECT_LT((Q_of(qp, i) - Q_of(expected, i)).cwiseAbs().maxCoeff(), 1e-13) << i;
    }
  }
  /// The window slides: the oldest node leaves, and a new one enters.
  void slide() {
    problem.drop_first_interval();
    problem.output(intervals)[0] = 1.5;
    problem.output(intervals)[1] = 0.75;
    problem.measured_input(intervals - 1)[0] = 0.2;
    Iterate next(problem.capacity());
    for (int i = 0; i <= intervals; ++i) {
      const int from = std::min(i + 1, intervals);
      std::copy_n(point.row(from), problem.capacity().row(), next.row(i));
      std::copy_n(point.costate(from), problem.capacity().row(), next.costate(i));
    }
    next.state(intervals)[0] += 0.1;
    point = next;
  }

  std::shared_ptr<Watched> model = std::make_shared<Watched>();
  RheProblem problem;
  std::unique_ptr<Linearisation> linearisation;
  Iterate point;
};

TEST_F(RheLinearisationTest, LooksAtEveryNodeOnce) {
  EXPECT_EQ(observed(), intervals + 1);
  expect_as_anew();
  EXPECT_EQ(observed(), 0) << "nothing is new";
  expect_as_anew();
}

TEST_F(RheLinearisationTest, LooksAtTheNodesThatHaveMovedOnly) {
  observed();
  point.state(2)[0] += 0.01;
  point.state(4)[1] -= 0.01;
  EXPECT_EQ(observed(), 2);
  expect_as_anew();
}

TEST_F(RheLinearisationTest, RemembersNodesThatTheWindowHasMovedOver) {
  observed();
  for (int k = 0; k < 3 * intervals; ++k) {
    slide();
    EXPECT_LE(observed(), 2) << k << ": of the new node, and of the last one if that has moved";
    expect_as_anew();
  }
}

TEST_F(RheLinearisationTest, TakesNewMeasurementsWithoutALook) {
  linearisation->prepare(point, Hessian::gauss_newton);
  const int before = model->nodes;
  problem.output(intervals)[0] = 2.5;
  linearisation->refresh(point);
  EXPECT_EQ(model->nodes, before);
  expect_as_anew();
}

TEST_F(RheLinearisationTest, ForgetsAll) {
  observed();
  linearisation->forget();
  EXPECT_EQ(observed(), intervals + 1);
  expect_as_anew();
}

}  // namespace rhe_linearisation_test
}  // namespace rhec
