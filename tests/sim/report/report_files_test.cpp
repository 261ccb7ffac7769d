// What a report is made with: numbers as they are seen, and thinning.
#include "sim/report/report_files.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace rhec::sim {
namespace report_files_test {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(Seen, KeepsSevenDigitsAndFourDecimals) {
  EXPECT_EQ(seen(0.123456789).dump(), "0.1234568");
  EXPECT_EQ(seen(-123.456789).dump(), "-123.4568");
  EXPECT_EQ(seen(512345.678912).dump(), "512345.6789");
  EXPECT_EQ(seen(0.0).dump(), "0.0");
  EXPECT_TRUE(seen(nan).is_null());
  EXPECT_EQ(counted(7), "7");
  EXPECT_EQ(counted(158944), "158,944");
  EXPECT_EQ(counted(-1234567), "-1,234,567");
}

TEST(Thin, KeepsEveryRowWhereThereIsRoom) {
  const std::vector<double> values(100, 1.0);
  const Thinned thinned = thin({&values}, values.size(), 100);
  EXPECT_EQ(thinned.rows.size(), 100U);
  EXPECT_EQ(thinned.stretch, 1U);
}

TEST(Thin, KeepsExtremesOfEachColumnAndBothEnds) {
  std::vector<double> one(5000), other(5000, nan);
  for (std::size_t i = 0; i < one.size(); ++i) one[i] = std::sin(0.01 * static_cast<double>(i));
  one[2345] = 7.0;
  other[1234] = -3.0;
  other[1236] = 4.0;
  const Thinned thinned = thin({&one, &other}, one.size(), 400);
  const auto has = [&](std::size_t row) {
    return std::find(thinned.rows.begin(), thinned.rows.end(), row) != thinned.rows.end();
  };
  EXPECT_LE(thinned.rows.size(), 400U);
  EXPECT_GT(thinned.rows.size(), 100U);
  for (const std::size_t row : {0, 4999, 2345, 1234, 1236}) EXPECT_TRUE(has(row)) << row;
  EXPECT_TRUE(std::is_sorted(thinned.rows.begin(), thinned.rows.end()));
  EXPECT_EQ(std::adjacent_find(thinned.rows.begin(), thinned.rows.end()), thinned.rows.end());
  // Of each stretch, not only of the whole.
  for (std::size_t first = 0; first < one.size(); first += thinned.stretch) {
    const auto begin = one.begin() + static_cast<std::ptrdiff_t>(first),
               end = one.begin() + static_cast<std::ptrdiff_t>(std::min(one.size(), first + thinned.stretch));
    EXPECT_TRUE(has(static_cast<std::size_t>(std::max_element(begin, end) - one.begin())));
  }
}

TEST(Histogram, CountsEverySolveThatTookTime) {
  const std::vector<double> times = {0.0, 1.0, 1.2, 9.99, 10.0, 1e4, nan};
  const Json histogram = times_histogram(times);
  EXPECT_EQ(histogram.at("count"), 5);
  EXPECT_EQ(histogram.at("edges").size(), histogram.at("counts").size() + 1);
  std::int64_t sum = 0;
  for (const Json& count : histogram.at("counts")) sum += count.get<std::int64_t>();
  EXPECT_EQ(sum, 5);
  EXPECT_DOUBLE_EQ(histogram.at("edges").front().get<double>(), 1.0);
  EXPECT_EQ(histogram.at("counts").front(), 2);
  EXPECT_GT(histogram.at("edges").back().get<double>(), 1e4);
  EXPECT_TRUE(times_histogram({0.0, 0.0}).is_null());
}

}  // namespace report_files_test
}  // namespace rhec::sim
