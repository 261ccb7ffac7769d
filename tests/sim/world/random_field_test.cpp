// Random ground: the fields of slip_field.hpp that are made of noise.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "rhec/sim/numbers/random.hpp"
#include "rhec/sim/world/slip_field.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace random_field_test {

// The inverse of the normal distribution function, by bisection.
double normal_quantile(double share) {
  double low = -10.0, high = 10.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle / std::sqrt(2.0)) < share ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

TEST(GaussianRandomField, HasTheStatisticsAskedForOverSeeds) {
  // One pair of points per seed, at places that differ from seed to seed: independent samples over the lattice's
  // phases.
  constexpr int seeds = 4000, bins = 10;
  constexpr double length = 10.0;
  double mean = 0.0, variance = 0.0, along = 0.0, across = 0.0, far = 0.0, channels = 0.0;
  std::array<int, bins> histogram{};
  RandomStream places(1, "places");
  for (int seed = 0; seed < seeds; ++seed) {
    const auto field = gaussian_random_field(
        {.seed = static_cast<std::uint64_t>(seed), .correlation_length = length, .period = 100.0});
    const double x = places.uniform(-300.0, 300.0), y = places.uniform(-300.0, 300.0);
    std::array<double, 2> here{}, right{}, up{}, there{};
    field->sample(x, y, here.data());
    field->sample(x + length, y, right.data());
    field->sample(x + 0.5 * length * std::sqrt(0.5), y + 0.5 * length * std::sqrt(0.5), up.data());
    field->sample(x + 4.5 * length, y, there.data());
    for (double value : here) {
      ASSERT_GE(value, 0.5);
      ASSERT_LE(value, 1.0);
    }
    ++histogram[std::min<std::size_t>(bins - 1, static_cast<std::size_t>((here[0] - 0.5) / 0.5 * bins))];
    const auto normal = [](double value) { return normal_quantile((value - 0.5) / 0.5); };
    const double g = normal(here[0]);
    mean += g / seeds;
    variance += g * g / seeds;
    along += g * normal(right[0]) / seeds;
    across += g * normal(up[0]) / seeds;
    far += g * normal(there[0]) / seeds;
    channels += g * normal(here[1]) / seeds;
  }
  const double tolerance = 4.0 / std::sqrt(seeds);
  EXPECT_NEAR(mean, 0.0, tolerance);
  EXPECT_NEAR(variance, 1.0, std::sqrt(2.0) * tolerance);
  EXPECT_NEAR(along, std::exp(-0.5), 1.2 * tolerance);
  EXPECT_NEAR(across, std::exp(-0.125), 1.4 * tolerance);
  EXPECT_NEAR(far, 0.0, tolerance);
  EXPECT_NEAR(channels, 0.0, tolerance) << "channels are independent";
  double chi_square = 0.0;
  for (int n : histogram) chi_square += std::pow(n - seeds / bins, 2) / (seeds / bins);
  EXPECT_LT(chi_square, 27.9) << "uniform; 9 degrees of freedom, 0.1 %";
}

TEST(GaussianRandomField, OneRealisationIsUniformInTheMean) {
  const auto field = gaussian_random_field({.seed = 5, .channels = {{0.2, 0.6}}, .correlation_length = 2.0});
  double mean = 0.0, square = 0.0;
  constexpr int side = 200;
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      double value = 0.0;
      field->sample(2.3 * i, 2.3 * j, &value);
      mean += value / (side * side);
      square += value * value / (side * side);
    }
  }
  EXPECT_NEAR(mean, 0.4, 0.005);
  EXPECT_NEAR(square - mean * mean, 0.4 * 0.4 / 12.0, 0.0007);
}

TEST(GaussianRandomField, IsSmoothAcrossLatticeLinesAndSameForTheSameSeed) {
  const GaussianField options{.seed = 9, .channels = {{0.0, 1.0}}, .correlation_length = 5.0, .period = 200.0};
  const auto field = gaussian_random_field(options), again = gaussian_random_field(options);
  double before = 0.0, value = 0.0, same = 0.0;
  field->sample(-40.0, 3.0, &before);
  for (double x = -40.0; x < 40.0; x += 0.001) {
    field->sample(x, 3.0, &value);
    again->sample(x, 3.0, &same);
    ASSERT_EQ(value, same);
    ASSERT_LT(std::abs(value - before), 6e-4) << "a jump at x = " << x;
    before = value;
  }
}

TEST(GaussianRandomField, IsTheSmoothedNoiseThatItsHeaderDescribes) {
  // Written down as it is defined: kernels about every lattice point, twelve lines each way, on a lattice of 40 lines.
  constexpr int side = 40, taps = 12;
  constexpr double length = 5.0, step = 0.7, spacing = step * length;
  const auto field = gaussian_random_field(
      {.seed = 3, .channels = {{0.5, 1.0}}, .correlation_length = length, .period = spacing * side});
  RandomStream random(3, "gaussian slip field, channel 0");
  std::vector<double> noise(side * side);
  for (double& value : noise) value = step * std::sqrt(2.0 / std::numbers::pi) * random.normal();
  const auto wrapped = [](double line) { return static_cast<int>(line - side * std::floor(line / side)); };
  RandomStream places(1, "places");
  for (int i = 0; i < 2000; ++i) {
    const double x = places.uniform(-500.0, 500.0), y = places.uniform(-500.0, 500.0);
    const double column = std::floor(x / spacing), row = std::floor(y / spacing);
    double g = 0.0, value = 0.0;
    for (int r = 1 - taps / 2; r <= taps / 2; ++r) {
      for (int c = 1 - taps / 2; c <= taps / 2; ++c) {
        const double dx = x / spacing - (column + c), dy = y / spacing - (row + r);
        g += std::exp(-step * step * (dx * dx + dy * dy)) * noise[wrapped(row + r) * side + wrapped(column + c)];
      }
    }
    field->sample(x, y, &value);
    ASSERT_NEAR(value, 0.5 + 0.25 * std::erfc(-g / std::numbers::sqrt2), 1e-14) << x << ", " << y;
  }
}

TEST(GaussianRandomField, AnotherChannelLeavesTheFirstAsItWas) {
  const auto one = gaussian_random_field({.channels = {{}}}), two = gaussian_random_field({.channels = {{}, {}}});
  std::array<double, 2> a{}, b{};
  one->sample(12.0, -7.0, a.data());
  two->sample(12.0, -7.0, b.data());
  EXPECT_EQ(a[0], b[0]);
  EXPECT_NE(b[0], b[1]);
}

TEST(RandomFields, RefuseNonsense) {
  EXPECT_CONTAINS(error_of([] { gaussian_random_field({.channels = {}}); }), "no channels");
  EXPECT_CONTAINS(error_of([] { gaussian_random_field({.channels = {{1.0, 0.5}}}); }), "lower <= upper");
  EXPECT_CONTAINS(error_of([] { gaussian_random_field({.correlation_length = 0.0}); }), "correlation_length");
  EXPECT_CONTAINS(error_of([] { gaussian_random_field({.correlation_length = 0.01}); }), "lattice points");
  EXPECT_CONTAINS(error_of([] { patch_field({.patch_size = -1.0}); }), "patch_size");
}

TEST(PatchField, HasConstantPatchesWithSharpEdges) {
  const auto field = patch_field({.seed = 4, .channels = {{0.5, 1.0}}, .patch_size = 10.0});
  int edges = 0, patches = 0;
  double before = 0.0, mean = 0.0, value = 0.0;
  constexpr int count = 100000;
  field->sample(-500.0, 1.0, &before);
  for (int i = 0; i < count; ++i) {
    field->sample(-500.0 + 0.01 * i, 1.0, &value);
    if (value != before) ++edges;
    before = value;
  }
  EXPECT_GT(edges, 70);
  EXPECT_LT(edges, 200);
  for (int i = 0; i < 100; ++i) {
    for (int j = 0; j < 100; ++j, ++patches) {
      field->sample(10.0 * i - 500.0, 10.0 * j - 500.0, &value);
      ASSERT_GE(value, 0.5);
      ASSERT_LE(value, 1.0);
      mean += value;
    }
  }
  EXPECT_NEAR(mean / patches, 0.75, 0.008);
}

TEST(PatchField, SeedsDiffer) {
  const auto a = patch_field({.seed = 1}), b = patch_field({.seed = 2}), again = patch_field({.seed = 1});
  std::array<double, 2> u{}, v{}, w{};
  a->sample(3.0, 3.0, u.data());
  b->sample(3.0, 3.0, v.data());
  again->sample(3.0, 3.0, w.data());
  EXPECT_NE(u[0], v[0]);
  EXPECT_NE(u[0], u[1]);
  EXPECT_EQ(u, w);
}

}  // namespace random_field_test
}  // namespace rhec::sim
