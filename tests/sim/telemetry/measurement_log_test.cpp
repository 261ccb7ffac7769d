#include "rhec/sim/telemetry/measurement_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "sim/support/driven_log.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace measurement_log_test {

using MeasurementLogTest = DrivenLogTest;

ModelDescription about() {
  ModelDescription made;
  made.outputs = {{.name = "a", .unit = "m", .meaning = ""}, {.name = "b", .unit = "m", .meaning = ""}};
  made.inputs = {{.name = "u", .unit = "m/s", .meaning = ""}};
  return made;
}

TEST_F(MeasurementLogTest, NumbersAndTimesComeBackAsTheyWere) {
  const double third = 1.0 / 3.0, tiny = 5e-324;
  for (const char* name : {"x.csv", "x.mcap"}) {
    MeasurementLog log(file(name), about());
    log.take_outputs(0.3, 0.2, std::array{third, std::nan("")}.data());
    log.take_inputs(0.4, std::array{tiny}.data());
    log.take_outputs(0.5, std::numeric_limits<double>::infinity(), std::array{1.0, 1.0}.data());  // no time
    log.close();
    const logs::Drive known =
        logs::read_drive(*logs::open_log(file(name)), logs::SignalMap(parse_yaml("outputs: {b: none}", "x"), about()));
    ASSERT_EQ(known.events.size(), 2u) << name;
    EXPECT_EQ(known.events[0].time, 0.2);
    EXPECT_EQ(known.events[0].arrival, 0.3);
    EXPECT_EQ(known.values_of(known.events[0])[0], third);
    EXPECT_TRUE(std::isnan(known.values_of(known.events[0])[1]));
    EXPECT_EQ(known.values_of(known.events[1])[0], tiny);
  }
}

TEST_F(MeasurementLogTest, TheNameSaysWhatKindOfFile) {
  EXPECT_THAT(error_of([&] { MeasurementLog log(file("x.bag"), about()); }), testing::HasSubstr(".csv or .mcap"));
}

}  // namespace measurement_log_test
}  // namespace rhec::sim
