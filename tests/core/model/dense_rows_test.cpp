#include "rhec/core/model/dense_rows.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "rhec/plugins/host/host.hpp"
#include "support/random_interval.hpp"

namespace rhec {
namespace dense_rows_test {

TEST(DenseRows, LieOneBehindTheOther) {
  const Host host;
  const auto vehicle = host.make_model("bicycle_slip");  // n_x = 4, n_u = 2, n_p = 2
  EXPECT_EQ(DenseRows::size(*vehicle), 4U + 2U + 2U + 2U + 4U + 4U + 4U * 10U + 10U * 10U);
  std::vector<double> memory(3 * DenseRows::size(*vehicle));
  const DenseRows rows(memory.data(), 3, *vehicle);
  EXPECT_EQ(rows.x, memory.data());
  EXPECT_EQ(rows.u, rows.x + 12);
  EXPECT_EQ(rows.p_end, rows.p + 6);
  EXPECT_EQ(rows.hessians + 300, memory.data() + memory.size());
  EXPECT_EQ(rows.data, memory.data() + memory.size());
}

TEST(ObserveFirstStates, LeavesOutThoseBehind) {
  const Host host;
  const auto vehicle = host.make_model("bicycle_slip");
  const int nx = 4, ny = vehicle->output_count(), more = 3, n = nx + more;
  const RandomInterval at(*vehicle, 2);
  std::vector<double> states, weights, outputs(2 * ny), J(2 * ny * n, 9.0), H(2 * n * n, 9.0), memory(nx * nx);
  for (int i = 0; i < 2; ++i) {
    states.insert(states.end(), at.x.begin(), at.x.end());
    states.insert(states.end(), more, 7.0);
    weights.insert(weights.end(), at.weights.begin(), at.weights.end());
  }
  observe_first_states(*vehicle, more,
                       {.count = 2,
                        .states = states.data(),
                        .outputs = outputs.data(),
                        .jacobians = J.data(),
                        .multipliers = weights.data(),
                        .hessians = H.data()},
                       memory.data());
  std::vector<double> y(ny), of_vehicle(ny * nx), curvature(nx * nx);
  vehicle->observe({.count = 1,
                    .states = at.x.data(),
                    .outputs = y.data(),
                    .jacobians = of_vehicle.data(),
                    .multipliers = at.weights.data(),
                    .hessians = curvature.data()});
  for (int i = 0; i < 2; ++i) {
    for (int r = 0; r < ny; ++r) {
      EXPECT_EQ(outputs[i * ny + r], y[r]);
      for (int c = 0; c < n; ++c) EXPECT_EQ(J[(i * n + c) * ny + r], c < nx ? of_vehicle[c * ny + r] : 0.0);
    }
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n; ++r) EXPECT_EQ(H[(i * n + c) * n + r], c < nx && r < nx ? curvature[c * nx + r] : 0.0);
  }
}

}  // namespace dense_rows_test
}  // namespace rhec
