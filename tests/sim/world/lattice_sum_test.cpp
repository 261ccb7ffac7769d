#include "sim/world/lattice_sum.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {
namespace lattice_sum_test {

TEST(LatticeSum, IsTheSameToTheBitWithWhateverInstructions) {
  constexpr int stride = lattice_taps + 5;
  RandomStream random(1, "lattice");
  const std::vector<LatticeSum> sums = available_lattice_sums();
  ASSERT_FALSE(sums.empty());
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> noise(stride * lattice_taps);
    std::array<double, lattice_taps> rows{}, columns{};
    for (double& value : noise) value = random.normal();
    for (double& value : rows) value = random.uniform();
    for (double& value : columns) value = random.uniform();
    double expected = 0.0, size = 0.0;
    for (int r = 0; r < lattice_taps; ++r) {
      for (int c = 0; c < lattice_taps; ++c) {
        const double part = rows[r] * columns[c] * noise[r * stride + c];
        expected += part;
        size += std::abs(part);
      }
    }
    const double first = sums.front()(noise.data(), stride, rows.data(), columns.data());
    EXPECT_NEAR(first, expected, 1e-15 * size);
    for (const LatticeSum sum : sums) EXPECT_EQ(sum(noise.data(), stride, rows.data(), columns.data()), first);
  }
}

}  // namespace lattice_sum_test
}  // namespace rhec::sim
