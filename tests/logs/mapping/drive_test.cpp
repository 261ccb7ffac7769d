#include "rhec/logs/mapping/drive.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "logs/support/described.hpp"
#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/csv/csv_log.hpp"
#include "rhec/logs/mcap/mcap_log.hpp"
#include "rhec/logs/mcap/mcap_writer.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace drive_test {

using testing::HasSubstr;

class DriveTest : public FolderTest {
 protected:
  Drive drive(const std::string& table, const std::string& signals) {
    return read_drive(*open_csv(put("d.csv", table)), SignalMap(parse_yaml(signals, "robot.yaml"), described()));
  }
  static std::vector<double> values(const Drive& drive, std::size_t event) {
    const double* begin = drive.values_of(drive.events[event]);
    return {begin, begin + (drive.events[event].is_output ? drive.outputs : drive.inputs)};
  }
};

TEST_F(DriveTest, ALineIsOneMeasurementOfAllThatItHas) {
  const Drive found =
      drive("time,x_gps,y_gps,psi_m,delta,v,delta_rate\n1,2,3,,0.1,,\n2,,,,,5,0.5\n", "{outputs: {psi_m: none}}");
  ASSERT_EQ(found.events.size(), 2u);
  EXPECT_TRUE(found.events[0].is_output);
  EXPECT_EQ(found.events[0].time, 1.0);
  EXPECT_EQ(values(found, 0)[1], 3.0);
  EXPECT_TRUE(std::isnan(values(found, 0)[2]));
  EXPECT_EQ(values(found, 1), (std::vector<double>{5.0, 0.5}));
}

TEST_F(DriveTest, DelaysGoIntoStampsAndArrivalsStay) {
  const Drive found =
      drive("time,x,y,steer,speed\n10,1,2,90,36\n10.5,2,3,100,72\n",
            "{outputs: {x_gps: {from: x, delay: 0.2}, y_gps: {from: y, delay: 0.2}, psi_m: none, delta: {from: steer, "
            "unit: deg, sign: -1}}, inputs: {v: {from: speed, unit: km/h}, delta_rate: {from: steer, unit: deg, "
            "sign: -1, derivative: true}}}");
  // Of the first line: fixes, steering, speed; of the second also the rate, from the first line on and from there.
  ASSERT_EQ(found.events.size(), 7u);
  EXPECT_NEAR(found.events[0].time, 9.8, 1e-12);
  EXPECT_EQ(found.events[0].arrival, 10.0);
  int rates = 0;
  for (std::size_t i = 0; i < found.events.size(); ++i) {
    if (found.events[i].is_output || std::isnan(values(found, i)[1])) continue;
    EXPECT_NEAR(values(found, i)[1], -20.0 * M_PI / 180.0, 1e-12);
    EXPECT_NEAR(values(found, i)[0], found.events[i].time < 10.4 ? 10.0 : 20.0, 1e-12);  // the other input holds
    ++rates;
  }
  EXPECT_EQ(rates, 2);
}

TEST_F(DriveTest, StampsSince1970BeginAtTheFirst) {
  const Drive found = drive("time,x_gps,y_gps,delta,v\n1700000000.25,1,2,0,1\n1700000000.5,1,2,0,1\n",
                            "{outputs: {psi_m: none}, inputs: {delta_rate: none}}");
  EXPECT_EQ(found.start, 1700000000250000000);
  EXPECT_EQ(found.events.back().time, 0.25);
  EXPECT_EQ(found.stamp_of(0.25), 1700000000500000000);
}

TEST_F(DriveTest, SidesMayComeOneByOne) {
  const Drive found = drive(
      "time,left,right\n1,2,\n1.1,,4\n1.5,4,\n1.6,,6\n",
      "{outputs: {x_gps: {from: left}, y_gps: none, psi_m: none, delta: none}, inputs: {v: {from: [left, right], as: "
      "mean}, delta_rate: none}}");
  std::vector<double> means;
  for (std::size_t i = 0; i < found.events.size(); ++i)
    if (!found.events[i].is_output) means.push_back(values(found, i)[0]);
  EXPECT_EQ(means, (std::vector<double>{3.0, 5.0}));
}

TEST_F(DriveTest, SaysWhatIsMissing) {
  EXPECT_THAT(error_of([&] { drive("time,x_gps,y_gps,delta,v\n0,1,2,0,1\n", "{}"); }), HasSubstr("no column 'psi_m'"));
  EXPECT_THAT(error_of([&] {
                drive("time,x_gps,y_gps,delta,v\n0,1,2,,1\n", "{outputs: {psi_m: none}, inputs: {delta_rate: none}}");
              }),
              HasSubstr("delta has no value"));
}

/// Odometry by one clock and wheels by another.
class BagTest : public DriveTest {
 protected:
  Drive bag(Stamp wheel_clock, Stamp odometry_clock, const std::string& more = "") {
    {
      McapWriter writer(file("b.mcap"));
      const auto channel = [&](const char* topic, const char* type) {
        return writer.add_channel(topic, type, ros2msg_text(type, builtin_definitions()));
      };
      const auto fix = channel("/fix", "sensor_msgs/msg/NavSatFix"),
                 wheels = channel("/wheels", "sensor_msgs/msg/JointState");
      for (int i = 0; i < 10; ++i) {
        const Stamp now = 1'700'000'000'000'000'000 + 100'000'000 * i;
        CdrWriter message;
        message.header(now - wheel_clock, "");
        message.length(2);
        for (const char* name : {"left", "right"}) message.text(name);
        message.length(0);
        message.length(2);
        message.numbers(std::vector<double>{10.0, 20.0});
        message.length(0);
        writer.write(wheels, now, message.bytes());
        message.clear();
        message.header(now - odometry_clock, "gps");
        message.i8(static_cast<std::int8_t>(i < 2 ? -1 : 0));  // no fix at first
        message.u16(1);
        message.numbers(std::vector<double>{48.0 + 1e-6 * i, 11.0, 500.0});
        message.numbers(std::vector<double>(9, 0.0));
        message.u8(0);
        writer.write(fix, now, message.bytes());
      }
      writer.close();
    }
    return read_drive(
        *open_mcap(file("b.mcap")),
        SignalMap(
            parse_yaml(
                "{outputs: {x_gps: {from: /fix, as: east}, y_gps: {from: /fix, as: north}, psi_m: none, delta: "
                "none}, inputs: {v: {from: [\"/wheels:velocity[left]\", \"/wheels:velocity[right]\"], as: mean, unit: "
                "rad/s, radius: 0.5}, delta_rate: none}" +
                    more + "}",
                "robot.yaml"),
            described()));
  }
};

TEST_F(BagTest, FixesAreInAPlaneAndWheelsAreOneSpeed) {
  const Drive found = bag(0, 50'000'000);
  ASSERT_TRUE(found.origin);
  EXPECT_NEAR(found.origin->latitude, 48.000002, 1e-12);
  EXPECT_EQ(found.signals[0].missing, 2);
  EXPECT_EQ(found.signals[0].values, 8);
  const auto last =
      std::find_if(found.events.rbegin(), found.events.rend(), [](const DriveEvent& e) { return e.is_output; });
  EXPECT_NEAR(found.values_of(*last)[1], 7e-6 * 111200.0, 1e-3);
  EXPECT_NEAR(last->arrival - last->time, 0.05, 1e-9);
  EXPECT_DOUBLE_EQ(found.values_of(found.events.front())[0], 7.5);
}

TEST_F(BagTest, ClocksOfBothStampAndArrivalMayDiffer) {
  const Drive found = bag(-3'600'000'000'000, -3'600'000'000'000 + 50'000'000);  // stamps an hour ahead of the recorder
  for (const DriveEvent& event : found.events)
    EXPECT_NEAR(event.arrival - event.time, event.is_output ? 0.05 : 0.0, 1e-6);
}

TEST_F(BagTest, ClocksOfTwoTopicsMayNot) {
  EXPECT_THAT(error_of([&] { bag(0, 18'000'000'000); }),
              testing::AllOf(HasSubstr("differ by 18 s"), HasSubstr("clock: received")));
  EXPECT_EQ(error_of([&] { bag(0, 18'000'000'000, ", clock: received"); }), "");
}

}  // namespace drive_test
}  // namespace rhec::logs
