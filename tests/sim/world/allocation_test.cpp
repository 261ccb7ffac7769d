// What runs inside a loop allocates nothing: every allocation of this program is counted.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "rhec/core/control/path.hpp"
#include "rhec/core/control/path_follower.hpp"
#include "rhec/sim/world/paths.hpp"
#include "rhec/sim/world/truth.hpp"
#include "sim/support/bicycle.hpp"
#include "support/allocations.hpp"

namespace rhec::sim {
namespace allocation_test {

TEST(Allocation, IsCounted) {
  const long before = allocation_count();
  const auto memory = std::make_unique<std::vector<double>>(100);
  EXPECT_EQ(allocation_count() - before, 2);
}

TEST(Allocation, NoneInALoopOfTruthSensorsFieldsAndFollower) {
  const Bicycle model;
  const Path path(figure_eight());
  std::vector<std::unique_ptr<const SlipField>> fields;
  fields.push_back(gaussian_random_field({}));
  fields.push_back(patch_field({}));
  fields.push_back(constant_field({0.8, 0.9}));
  fields.push_back(split_field({.border = 2.0, .below = patch_field({}), .above = gaussian_random_field({})}));
  for (const auto& field : fields) {
    TruthVehicle vehicle(model, *field, Eigen::Vector4d(0, 0, 0, 0.1));
    Sensors sensors(model, {.outputs = {0.03, 0.03, 0.02}, .inputs = {0.1, 0.1}}, 1);
    PathFollower follower(path);
    std::array<double, 2> inputs{};
    std::array<double, 3> outputs{};
    const long before = allocation_count();
    for (int i = 0; i < 20; ++i) {
      inputs[0] = path.point_at(follower.advance(vehicle.state()[0], vehicle.state()[1])).speed;
      vehicle.advance(inputs.data(), 0.2);
      sensors.observe(vehicle.state().data(), outputs.data());
      sensors.measure_inputs(inputs.data(), inputs.data());
    }
    EXPECT_EQ(allocation_count() - before, 0);
    EXPECT_GT(follower.arc_length(), 3.0);
  }
}

}  // namespace allocation_test
}  // namespace rhec::sim
