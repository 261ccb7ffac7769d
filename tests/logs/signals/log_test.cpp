#include "rhec/logs/signals/log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/error_of.hpp"

namespace rhec::logs {
namespace log_test {

using testing::AllOf;
using testing::HasSubstr;

class TwoTopics final : public Log {
 public:
  TwoTopics() : Log("bag.mcap") {
    topics_ = {{"/odom", "nav_msgs/msg/Odometry", 3}, {"/fix", "sensor_msgs/msg/NavSatFix", 1}};
  }
  std::unique_ptr<FieldReader> reader(int, const FieldRequest&) const override { return nullptr; }
  std::vector<std::string> fields_of(const Record&) const override { return {}; }
  std::optional<Damage> read(const std::vector<bool>&, const Take&) const override { return std::nullopt; }
  Damage damage_at(const Record&, const RecordError& error) const override { return {error.what()}; }
};

TEST(Log, FindsTopicsAndSuggestsTheNearest) {
  const TwoTopics log;
  EXPECT_EQ(log.topic("/fix"), 1);
  EXPECT_THAT(error_of([&] { log.topic("/odmo"); }), AllOf(HasSubstr("bag.mcap"), HasSubstr("did you mean '/odom'")));
  EXPECT_THAT(error_of([&] { log.topic("/camera/image"); }), HasSubstr("expected one of /odom, /fix"));
  EXPECT_THAT(error_of([&] { log.topic(""); }), HasSubstr("expected 'topic:field'"));
}

TEST(Log, NamesOfSignalsAreTopicsWithFieldsOrColumns) {
  EXPECT_EQ(parse_signal_name("/odom:twist.twist.linear.x").topic, "/odom");
  EXPECT_EQ(parse_signal_name("/odom:twist.twist.linear.x").field, "twist.twist.linear.x");
  EXPECT_EQ(parse_signal_name("/fix").topic, "/fix");
  EXPECT_EQ(parse_signal_name("speed: left").topic, "");
  EXPECT_EQ(parse_signal_name("speed: left").field, "speed: left");
}

TEST(Log, SecondsBetweenStampsDoNotOverflow) {
  EXPECT_DOUBLE_EQ(seconds_between(1700000000000000000, 1700000000200000000), 0.2);
  EXPECT_GT(seconds_between(no_stamp, INT64_MAX), 1.8e10);
}

TEST(Log, TextsOfFilesAreShownShortAndPrintable) {
  EXPECT_EQ(in_quotes("a\x01z"), "'a?z'");
  EXPECT_EQ(in_quotes(std::string(100, 'a')).size(), 65u);
}

}  // namespace log_test
}  // namespace rhec::logs
