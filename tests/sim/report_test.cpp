// What a report is made with: numbers as text, thinning, statistics, and a loop that is looked at.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/closed_loop.hpp"
#include "rhec/sim/horizon_log.hpp"
#include "rhec/sim/report.hpp"
#include "sim/src/number_text.hpp"
#include "sim/src/report_files.hpp"
#include "sim/src/report_statistics.hpp"

namespace rhec::sim {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::string text_of(double value, int decimals) {
  std::string text;
  append_number(value, decimals, text);
  return text;
}

TEST(NumberText, HasTheDecimalsAskedForAndNoMore) {
  EXPECT_EQ(text_of(0.0, 4), "0");
  EXPECT_EQ(text_of(-0.00001, 4), "0");
  EXPECT_EQ(text_of(0.5, 4), "0.5");
  EXPECT_EQ(text_of(-0.05, 4), "-0.05");
  EXPECT_EQ(text_of(100.0, 4), "100");
  EXPECT_EQ(text_of(99.99996, 4), "100");
  EXPECT_EQ(text_of(1234.56789, 0), "1235");
  EXPECT_EQ(text_of(-12.3456, 3), "-12.346");
  EXPECT_EQ(text_of(nan, 3), "null");
  EXPECT_EQ(text_of(-std::numeric_limits<double>::infinity(), 3), "null");
}

TEST(NumberText, IsTheNumberToItsDecimals) {
  for (int decimals = 0; decimals <= 12; ++decimals)
    for (double value = 1e-9; value < 1e18; value *= -7.3) {
      const double read = nlohmann::json::parse(text_of(value, decimals)).get<double>();
      EXPECT_NEAR(read, value, 0.51 * std::pow(10.0, -decimals) + 1e-15 * std::abs(value)) << value << ", " << decimals;
    }
}

TEST(NumberText, SeesAHundredThousandthOfTheMagnitude) {
  EXPECT_EQ(decimals_for(1.0), 5);
  EXPECT_EQ(decimals_for(10.0), 4);
  EXPECT_EQ(decimals_for(0.3), 6);
  EXPECT_EQ(decimals_for(1e9), 0);
}

TEST(NumberText, QuotesWhatIsNoText) {
  std::string text;
  append_quoted("a \"b\"\n\xff", text);
  EXPECT_EQ(nlohmann::json::parse(text).get<std::string>(), "a \"b\"\n\xEF\xBF\xBD");
}

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

TEST(Student, IsThatOfTheTables) {
  EXPECT_NEAR(student_975(1), 12.7062047364, 1e-8);
  EXPECT_NEAR(student_975(2), 4.3026527297, 1e-9);
  EXPECT_NEAR(student_975(19), 2.0930240544, 1e-9);
  EXPECT_NEAR(student_975(100000), 1.9599877075, 1e-7);
}

TEST(Moments, AreThoseOfTheNumbers) {
  StudentQuantiles quantiles;
  Moments moments;
  EXPECT_TRUE(std::isnan(moments.mean()));
  moments.add(1.0);
  EXPECT_TRUE(std::isnan(moments.half_width(quantiles)));
  moments.add(3.0);
  moments.add(8.0);
  EXPECT_DOUBLE_EQ(moments.mean(), 4.0);
  EXPECT_NEAR(moments.half_width(quantiles), 4.3026527297 * std::sqrt(13.0 / 3.0), 1e-8);
}

Scenario scenario_with(const std::vector<std::string>& assignments) {
  Settings settings = load_yaml(SCENARIO);
  apply_assignment(settings, "path.laps=1");
  apply_assignment(settings, "speed=10");
  for (const std::string& assignment : assignments) apply_assignment(settings, assignment);
  return {Host(), settings};
}

class HorizonLogOf : public testing::TestWithParam<const char*> {};

TEST_P(HorizonLogOf, LooksOnOnly) {
  const Scenario scenario = scenario_with({GetParam()});
  HorizonLog horizons(scenario.robot(), 1);
  const RunLog log = run_closed_loop(scenario, {.sampled = [&](const LoopSample& sample) { horizons.take(sample); }});
  EXPECT_EQ(steps_csv(log, scenario), steps_csv(run_closed_loop(scenario), scenario));
  EXPECT_EQ(horizons.kept(), std::ssize(log.samples));
}
INSTANTIATE_TEST_SUITE_P(Estimators, HorizonLogOf,
                         testing::Values("estimator.name=rhe", "estimator.name=ekf", "estimator.name=truth",
                                         "estimator.solver={name: gn_rti, mode: converge}",
                                         "blocking.kappa={name: structured, size: 5, overlap: 2, transition: ramp}"));

TEST(HorizonLog, KeepsFewOfManySamples) {
  const Scenario scenario = scenario_with({});
  HorizonLog horizons(scenario.robot(), 10000, 100);
  EXPECT_EQ(horizons.every(), 100);
  const RunLog log = run_closed_loop(scenario, {.sampled = [&](const LoopSample& sample) { horizons.take(sample); }});
  EXPECT_EQ(horizons.kept(), (std::ssize(log.samples) + 99) / 100);
  // What was measured is kept of every node nevertheless.
  const Json nodes = Json::parse(horizons.nodes_line(0));
  EXPECT_EQ(nodes.at("node_time").size(), log.samples.size());
  EXPECT_EQ(nodes.at("output").at(0).size(), log.samples.size());
  EXPECT_EQ(nodes.at("input").at(0).size(), log.samples.size() - 1);
}

/// The windows of a run, record by record.
std::vector<Json> windows_of(const std::vector<std::string>& assignments) {
  const Scenario scenario = scenario_with(assignments);
  HorizonLog horizons(scenario.robot(), 1);
  run_closed_loop(scenario, {.sampled = [&](const LoopSample& sample) { horizons.take(sample); }});
  std::vector<Json> windows;
  std::istringstream lines(horizons.records());
  for (std::string line; std::getline(lines, line);) windows.push_back(Json::parse(line).at("rhe"));
  return windows;
}

TEST(HorizonLog, ShowsNoSuppressedStartsWhereThereIsNoOverlap) {
  for (const char* blocking : {"blocking.kappa={name: structured, size: 4}", "blocking.kappa={name: unblocked}",
                               "blocking.kappa={name: pattern, lengths: [8, 4, 3]}"}) {
    for (const Json& window : windows_of({blocking})) {
      if (window.at("intervals") == 0) continue;
      EXPECT_TRUE(window.at("blocks").at(0).at("suppressed").empty()) << blocking;
    }
  }
}

TEST(HorizonLog, ShowsWhereTheWindowsEdgeCutsABlock) {
  const std::vector<Json> windows = windows_of({"blocking.kappa={name: structured, size: 4}"});
  const Json& block = windows.at(22).at("blocks").at(0);  // intervals 7 .. 21
  EXPECT_EQ(block.at("starts"), Json({7, 8, 12, 16, 20}));
  EXPECT_EQ(block.at("first_start"), 4);
  EXPECT_EQ(block.at("next_start"), 24);
}

TEST(ReportDocument, RefusesWhatIsNotThere) {
  try {
    report_document("no/such/folder", "test");
    FAIL() << "was accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("no/such/folder"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("rhec run"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace rhec::sim
