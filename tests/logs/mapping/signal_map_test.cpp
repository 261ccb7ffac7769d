#include "rhec/logs/mapping/signal_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "logs/support/described.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace signal_map_test {

using testing::AllOf;
using testing::HasSubstr;

SignalMap map_of(const std::string& text) { return {parse_yaml(text, "robot.yaml"), described()}; }
std::string message_of(const std::string& text) {
  return error_of([&] { map_of(text); });
}
/// A bag with one fix.
class Bag final : public Log {
 public:
  explicit Bag(const std::string& topic) : Log("bag.mcap") {
    topics_ = {{topic, "sensor_msgs/msg/NavSatFix", 1}, {"gps/rear", "sensor_msgs/msg/NavSatFix", 1}};
  }
  std::unique_ptr<FieldReader> reader(int, const FieldRequest&) const override { return nullptr; }
  std::vector<std::string> fields_of(const Record&) const override { return {}; }
  std::optional<Damage> read(const std::vector<bool>&, const Take&) const override { return std::nullopt; }
  Damage damage_at(const Record&, const RecordError& error) const override { return {error.what()}; }
};
constexpr const char* no_others = "y_gps: none, psi_m: none, delta: none}\ninputs: {v: none, delta_rate: none}";
std::string message_in_bag(std::string text) {
  text.back() = ',';
  return error_of([&] {
    const Bag bag("/fix");
    for (const MappedSignal& each : map_of(text + no_others).resolved(bag)) bag.topic(each.from.front().topic);
  });
}
const MappedSignal& signal(const SignalMap& map, const std::string& name) {
  for (const MappedSignal& each : map.signals())
    if (each.variable.name == name) return each;
  throw Error("no such signal");
}

TEST(SignalMap, FactorsContainSignScaleUnitAndRadius) {
  const SignalMap map = map_of(R"(
outputs:
  x_gps: {from: /fix, as: east}
  delta: {from: "/joint_states:position[steer]", unit: deg, sign: -1, offset: 0.1}
  psi_m: compass
inputs:
  v: {from: [left, right], as: mean, unit: rpm, radius: 0.3}
  delta_rate: {from: steer, unit: deg, derivative: true}
)");
  EXPECT_DOUBLE_EQ(signal(map, "delta").factor, -M_PI / 180.0);
  EXPECT_EQ(signal(map, "delta").from.front().field, "position[steer]");
  EXPECT_DOUBLE_EQ(signal(map, "v").factor, 0.3 * 2.0 * M_PI / 60.0);
  EXPECT_TRUE(signal(map, "delta_rate").is_angle);
  EXPECT_EQ(signal(map, "psi_m").from.front().field, "compass");
  EXPECT_TRUE(signal(map, "y_gps").from.empty());
}

TEST(SignalMap, ASignalWithoutASourceIsThatOfItsOwnName) {
  const SignalMap map = map_of("outputs: {delta: {unit: deg, offset: 0.02}}");
  EXPECT_TRUE(signal(map, "delta").from.empty());
  EXPECT_DOUBLE_EQ(signal(map, "delta").factor, M_PI / 180.0);
  EXPECT_EQ(signal(map, "delta").options.offset, 0.02);
  EXPECT_THAT(message_of("outputs: {psi_m: {as: heading}}"), HasSubstr("expected a signal"));
}

TEST(SignalMap, TopicsMayHaveNoSlash) {
  const Bag bag("fix");
  const std::string others = std::string(",") + no_others;
  std::vector<MappedSignal> found =
      map_of("outputs: {x_gps: {from: fix, as: east, variance: 'fix:position_covariance[0]'}" + others).resolved(bag);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].from[0].topic, "fix");
  EXPECT_EQ(found[0].from[0].field, "");
  EXPECT_EQ(found[0].accuracy->of.field, "position_covariance[0]");
  found = map_of("outputs: {x_gps: 'gps/rear:altitude'" + others).resolved(bag);
  EXPECT_EQ(found[0].from[0].topic, "gps/rear");
  EXPECT_EQ(found[0].from[0].field, "altitude");
  found = map_of(
              "outputs: {x_gps: none, y_gps: none, delta: none, psi_m: {from: [gps/rear, fix], as: "
              "direction}}\ninputs: {v: none, delta_rate: none}")
              .resolved(bag);
  EXPECT_EQ(found[0].from[1].topic, "fix");
}

TEST(SignalMap, CountsBecomeRatesOfWheels) {
  const SignalMap map =
      map_of("inputs: {v: {from: [l, r], as: mean, counts: 1024, radius: 0.3, wraps: 65536, derivative: true}}");
  EXPECT_DOUBLE_EQ(signal(map, "v").factor, 0.3 * 2.0 * M_PI / 1024.0);
  EXPECT_DOUBLE_EQ(signal(map, "v").period, 65536.0 * 0.3 * 2.0 * M_PI / 1024.0 / 2.0) << "one of both begins anew";
  EXPECT_DOUBLE_EQ(signal(map_of("inputs: {delta_rate: {from: a, unit: deg, derivative: true}}"), "delta_rate").period,
                   2.0 * M_PI);
  EXPECT_EQ(signal(map_of("inputs: {delta_rate: {from: a, counts: 100, derivative: true}}"), "delta_rate").period, 0.0);
}

TEST(SignalMap, MistakesNameTheirPlaceAndARemedy) {
  EXPECT_THAT(message_of("outputs: {x_pgs: a}"), AllOf(HasSubstr("robot.yaml:1"), HasSubstr("x_gps")));
  EXPECT_THAT(message_of("outputs:\n  delta: {from: a, unit: degrees}"),
              AllOf(HasSubstr("robot.yaml:2"), HasSubstr("'degrees'"), HasSubstr("deg")));
  EXPECT_THAT(message_of("outputs: {delta: {from: a, unit: m}}"), HasSubstr("gives [m], but delta is in [rad]"));
  EXPECT_THAT(message_of("inputs: {v: {from: a, unit: rpm}}"), HasSubstr("`radius`"));
  EXPECT_THAT(message_of("inputs: {v: {from: [a, b]}}"), HasSubstr("found 2 signals"));
  EXPECT_THAT(message_in_bag("outputs: {x_gps: /fix}"), HasSubstr("'/fix' is a topic; expected one of its fields"));
  EXPECT_THAT(message_in_bag("outputs: {x_gps: fix}"), HasSubstr("did you mean '/fix'"));
  EXPECT_THAT(message_of("outputs: {psi_m: {from: [a, b], as: heading}}"), HasSubstr("x, y, z, w"));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: a, derivative: true}}"),
              HasSubstr("is for rates, but x_gps is in [m]"));
  EXPECT_THAT(message_of("outputs: {delta: {from: a, rpy: [0, 0, 1]}}"), HasSubstr("`as: yaw_rate`"));
  EXPECT_THAT(message_of("outputs: {psi_m: {from: /imu:q, as: heading, rpy: [0, 0]}}"),
              HasSubstr("roll, pitch and yaw"));
  EXPECT_THAT(message_of("inputs: {v: {from: a, wraps: 256}}"), HasSubstr("`derivative: true`"));
  EXPECT_THAT(message_of("inputs: {v: {from: a, counts: 1024, radius: 0.3}}"),
              HasSubstr("gives [m], but v is in [m/s]; expected another unit or form, or `derivative: true`"));
  EXPECT_THAT(message_of("inputs: {v: {from: a, counts: 1024, unit: deg, derivative: true}}"),
              HasSubstr("leave one of them out"));
  EXPECT_THAT(message_of("outputs: {psi_m: {from: [a, b, c], as: direction}}"), HasSubstr("two topics of fixes"));
  EXPECT_THAT(message_of("inputs: {delta_rate: {from: [a, b], as: yaw_rate}}"), HasSubstr("three columns x, y, z"));
  EXPECT_THAT(message_of("inputs: {v: {form: a}}"), HasSubstr("did you mean 'from'"));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: a, when: {of: b}}}"), HasSubstr("at_least: 2"));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: a, when: {of: b, at_least: 2, at_most: 1}}}"),
              HasSubstr("at_least up to at_most"));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: a, when: {off: b}}}"), HasSubstr("did you mean 'of'"));
  EXPECT_THAT(message_of("outputs:\n  x_gps: {from: /a:x, when: {of: '/b:y', at_most: 1}}"),
              AllOf(HasSubstr("robot.yaml:2"), HasSubstr("'/b:y' is in other records"), HasSubstr("of /a")));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: a, sigma: b, variance: c}}"), HasSubstr("beside `sigma`"));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: a, sigma: [b]}}"), HasSubstr("or the name of a column"));
  EXPECT_THAT(message_of("inputs: {v: {from: a, sigma: b}}"), HasSubstr("is for outputs"));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: /fix, as: east, variance: /fix}}"),
              HasSubstr("'/fix:position_covariance[0]'"));
  EXPECT_THAT(message_of("outputs:\n  x_gps: {from: /a:x, variance: '/b:y'}"),
              AllOf(HasSubstr("robot.yaml:2"), HasSubstr("variance"), HasSubstr("'/b:y' is in other records")));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: a, sigma: b, sigma_scale: 0}}"), HasSubstr("sigma_scale"));
  EXPECT_THAT(message_of("outputs: {x_gps: {from: a, least_sigma: 1}}"),
              AllOf(HasSubstr("least_sigma"), HasSubstr("`sigma` or `variance`")));
  EXPECT_THAT(message_of("origin: [1]"), HasSubstr("latitude, longitude and height"));
  EXPECT_THAT(message_of("origin: [100, 0, 0]"), HasSubstr("within 90 degrees"));
  EXPECT_THAT(message_of("inputs: {delta_rate: {from: [a, b], as: turn, unit: m/s}}"), HasSubstr("`track`"));
  EXPECT_EQ(message_of("inputs: {delta_rate: {from: [a, b], as: turn, unit: m/s, track: 0.5}}"), "");
}

}  // namespace signal_map_test
}  // namespace rhec::logs
