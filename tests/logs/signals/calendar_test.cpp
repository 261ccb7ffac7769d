#include "rhec/logs/signals/calendar.hpp"

#include <gtest/gtest.h>

namespace rhec::logs {
namespace calendar_test {

// `date -d 2024-05-01T12:34:56Z +%s`
constexpr Stamp noon = 1'714'566'896'000'000'000;

TEST(Calendar, ReadsTimesAsPeopleAndLoggersWriteThem) {
  for (const char* text : {"2024-05-01T12:34:56Z", "2024-05-01 12:34:56", "2024-05-01_12:34:56 UTC",
                           "2024/05/01 12:34:56", "01.05.2024 12:34:56", "1.5.2024 12:34:56",
                           "2024-05-01T14:34:56+02:00", "2024-05-01T07:04:56-0530", "2024-05-01T14:34:56+02"})
    EXPECT_EQ(calendar_stamp(text), noon) << text;
  EXPECT_EQ(calendar_stamp("2024-05-01T12:34:56.123456789Z"), noon + 123'456'789);
  EXPECT_EQ(calendar_stamp("2024-05-01T12:34:56,5"), noon + 500'000'000);
  EXPECT_EQ(calendar_stamp("2024-05-01T12:34:56.1234567899Z"), noon + 123'456'789);
  EXPECT_EQ(calendar_stamp("1970-01-01"), 0);
  EXPECT_EQ(calendar_stamp("2024-02-29T00:00Z"), 1'709'164'800'000'000'000);
  EXPECT_EQ(calendar_stamp("00:00:01.25"), 1'250'000'000);
}

TEST(Calendar, RefusesWhatIsNone) {
  for (const char* text : {"", "12", "12.5", "2024", "2024-13-01", "2023-02-29", "2024-05-01T25:00", "2024-05-01T12:61",
                           "05/01/2024 12:00", "2024-05-01T12:34:56X", "2024-05-01T12:34:56+2", "2024-05", "1.2.3",
                           "2024-05-01T", "::", "12:3", "-1:00:00"})
    EXPECT_FALSE(calendar_stamp(text)) << text;
}

}  // namespace calendar_test
}  // namespace rhec::logs
