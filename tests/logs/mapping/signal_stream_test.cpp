#include "rhec/logs/mapping/signal_stream.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "logs/support/described.hpp"
#include "rhec/logs/csv/csv_log.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace signal_stream_test {

// What rows are made of is tested with drives (drive_test.cpp); here is what a stream has of its own.
class SignalStreamTest : public FolderTest {
 protected:
  SignalMap map(const std::string& signals) const { return SignalMap(parse_yaml(signals, "robot.yaml"), described()); }
};

TEST_F(SignalStreamTest, RowsComeRecordByRecordOutputsFirst) {
  const auto log = open_csv(put("d.csv", "time,x_gps,y_gps,delta,v\n1,2,3,0.1,5\n2,,4,,\n3,,,,\n"));
  SignalStream stream(*log, map("{outputs: {psi_m: none}, inputs: {delta_rate: none}}"));
  EXPECT_EQ(stream.wanted(), (std::vector<bool>{true}));
  std::vector<std::vector<SignalRow>> found;
  log->read(stream.wanted(), [&](const Record& record) {
    const auto rows = stream.take(record);
    found.emplace_back(rows.begin(), rows.end());
    return true;
  });
  ASSERT_EQ(found.size(), 3u);
  ASSERT_EQ(found[0].size(), 2u);
  EXPECT_TRUE(found[0][0].is_output);
  EXPECT_EQ(found[0][0].values[1], 3.0);
  EXPECT_FALSE(found[0][1].is_output);
  EXPECT_EQ(found[0][1].values[0], 5.0);
  ASSERT_EQ(found[1].size(), 1u);
  EXPECT_TRUE(std::isnan(found[1][0].values[0]));
  EXPECT_EQ(found[1][0].stamp, 2'000'000'000);
  EXPECT_TRUE(found[2].empty());
  EXPECT_EQ(stream.missing(), 3 + 4);
  for (const SignalCount& count : stream.counts()) EXPECT_EQ(count.values + count.missing, 3) << count.variable;
  EXPECT_FALSE(stream.origin());
}

TEST_F(SignalStreamTest, AConditionLeavesValuesOut) {
  const auto log =
      open_csv(put("d.csv", "time,e,status,var,v\n1,10,2,0.01,5\n2,20,1,0.01,5\n3,30,2,4,5\n4,40,,0.01,5\n"));
  SignalStream stream(*log, map("outputs: {psi_m: none, delta: none, y_gps: none, x_gps: {from: e, when: [{of: status, "
                                "at_least: 2}, {of: var, at_most: 1}]}}\ninputs: {delta_rate: none}"));
  std::vector<double> found;
  log->read(stream.wanted(), [&](const Record& record) {
    for (const SignalRow& row : stream.take(record))
      if (row.is_output) found.push_back(row.values[0]);
    return true;
  });
  EXPECT_EQ(found, (std::vector<double>{10.0}));
  EXPECT_EQ(stream.missing(), 0);
  for (const SignalCount& count : stream.counts()) EXPECT_EQ(count.left_out, count.is_output ? 3 : 0) << count.variable;
}

/// In the variable's unit; what is not above 0 is not known.
TEST_F(SignalStreamTest, RecordsSayHowAccurateTheyAre) {
  const auto log = open_csv(put("d.csv",
                                "time,e,var,psi,sd,v\n1,10,0.04,90,2,5\n2,20,0,90,,5\n3,30,-1,90,1,5\n"
                                "4,40,1e-8,,3,5\n"));
  SignalStream stream(*log, map("outputs: {delta: none, y_gps: none, x_gps: {from: e, variance: var, sigma_scale: 1.5, "
                                "least_sigma: 0.01}, psi_m: {from: psi, unit: deg, sign: -1, sigma: sd}}\n"
                                "inputs: {delta_rate: none}"));
  std::vector<SignalRow> found;
  log->read(stream.wanted(), [&](const Record& record) {
    for (const SignalRow& row : stream.take(record))
      if (row.is_output) found.push_back(row);
    return true;
  });
  ASSERT_EQ(found.size(), 4u);
  const std::size_t x = 0, psi = 2;
  EXPECT_NEAR(found[0].sigmas[x], 0.3, 1e-12);
  EXPECT_NEAR(found[0].sigmas[psi], 2.0 * M_PI / 180.0, 1e-12);
  EXPECT_TRUE(found[1].sigmas.empty());
  EXPECT_TRUE(std::isnan(found[2].sigmas[x]));
  EXPECT_NEAR(found[2].sigmas[psi], M_PI / 180.0, 1e-12);
  EXPECT_EQ(found[3].sigmas[x], 0.01);
  EXPECT_TRUE(std::isnan(found[3].sigmas[psi])) << "of a value that is missing";
  const SignalCount count = stream.counts()[0];
  EXPECT_EQ(count.stated, 2);
  EXPECT_EQ(count.least_sigma, 0.01);
  EXPECT_NEAR(count.most_sigma, 0.3, 1e-12);
}

TEST_F(SignalStreamTest, ACounterpartTakesWhatAnotherLeavesOut) {
  const auto log = open_csv(put("d.csv", "time,e,status,v\n1,10,2,5\n2,20,1,5\n3,30,2,5\n"));
  SignalStream stream(*log,
                      map("outputs: {psi_m: none, delta: none, x_gps: {from: e, when: {of: status, at_least: 2}}, "
                          "y_gps: {from: e, when: {of: status, at_most: 1}}}\ninputs: {delta_rate: none}"));
  std::vector<bool> is_first;
  log->read(stream.wanted(), [&](const Record& record) {
    for (const SignalRow& row : stream.take(record))
      if (row.is_output) is_first.push_back(!std::isnan(row.values[0]) && std::isnan(row.values[1]));
    return true;
  });
  EXPECT_EQ(is_first, (std::vector<bool>{true, false, true}));
}

TEST_F(SignalStreamTest, RatesOfCountersThatBeginAnew) {
  const std::string table = "time,a,x_gps\n0,65530,0\n1,4,0\n2,65534,0\n3,24,0\n";
  const auto rates_of = [&](const std::string& how) {
    const auto log = open_csv(put("d.csv", table));
    SignalStream stream(*log,
                        map("{outputs: {y_gps: none, psi_m: none, delta: none}, inputs: {v: {from: a, counts: 100, "
                            "radius: 0.5, derivative: true" +
                            how + "}, delta_rate: none}}"));
    std::vector<double> rates;
    log->read(stream.wanted(), [&](const Record& record) {
      for (const SignalRow& row : stream.take(record))
        if (!row.is_output && row.stamp == record.received) rates.push_back(row.values[0] / (M_PI / 100.0));
      return true;
    });
    return rates;
  };
  const std::vector<double> found = rates_of(", wraps: 65536");
  ASSERT_EQ(found.size(), 3u);
  EXPECT_NEAR(found[0], 10.0, 1e-9);
  EXPECT_NEAR(found[1], -6.0, 1e-9);
  EXPECT_NEAR(found[2], 26.0, 1e-9);
  EXPECT_NEAR(rates_of("")[0], -65526.0, 1e-6);
}

/// A wheel at 0.2 s a record that turns by more than half a turn in each.
TEST_F(SignalStreamTest, AnAngleBeyondATurnCountsTurns) {
  for (const auto& [how, table, expected] :
       {std::tuple("", "time,a,x_gps\n0,10,0\n1,14,0\n2,18,0\n", 4.0),
        std::tuple("", "time,a,x_gps\n0,3,0\n1,-3,0\n2,-2.5,0\n", 2.0 * M_PI - 6.0),
        std::tuple(", wraps: 0", "time,a,x_gps\n0,0,0\n1,4,0\n2,8,0\n", 4.0)}) {
    const auto log = open_csv(put("d.csv", table));
    SignalStream stream(*log, map(std::string("{outputs: {y_gps: none, psi_m: none, delta: none}, inputs: {v: none, "
                                              "delta_rate: {from: a, derivative: true") +
                                  how + "}}}"));
    std::vector<double> rates;
    log->read(stream.wanted(), [&](const Record& record) {
      for (const SignalRow& row : stream.take(record))
        if (!row.is_output) rates.push_back(row.values[1]);
      return true;
    });
    EXPECT_NEAR(rates.front(), expected, 1e-9) << table;
  }
}

/// Of an output it is the mean since the last record, measured halfway.
TEST_F(SignalStreamTest, AnOutputMayBeARate) {
  ModelDescription about = described();
  about.outputs[3] = {.name = "ground_speed", .unit = "m/s", .meaning = "speed over ground"};
  const auto log = open_csv(put("d.csv", "time,odometer\n10,5\n11,7\n13,7\n"));
  SignalStream stream(*log, SignalMap(parse_yaml("{outputs: {x_gps: none, y_gps: none, psi_m: none, ground_speed: "
                                                 "{from: odometer, unit: m, derivative: true}}, "
                                                 "inputs: {v: none, delta_rate: none}}",
                                                 "robot.yaml"),
                                      about));
  std::vector<std::pair<Stamp, double>> found;
  log->read(stream.wanted(), [&](const Record& record) {
    for (const SignalRow& row : stream.take(record)) found.emplace_back(row.stamp, row.values[3]);
    return true;
  });
  EXPECT_EQ(found, (std::vector<std::pair<Stamp, double>>{{10'500'000'000, 2.0}, {12'000'000'000, 0.0}}));
}

TEST_F(SignalStreamTest, TheHeadOfAColumnSaysItsUnit) {
  const auto value_of = [&](const std::string& table, const std::string& delta) {
    const auto log = open_csv(put("d.csv", table));
    SignalStream stream(*log, map("{outputs: {x_gps: none, y_gps: none, psi_m: none, delta: " + delta +
                                  "}, inputs: {v: none, delta_rate: none}}"));
    double value = 0.0;
    log->read(stream.wanted(), [&](const Record& record) {
      for (const SignalRow& row : stream.take(record)) value = row.values[3];
      return true;
    });
    return value;
  };
  EXPECT_NEAR(value_of("time,steer [deg]\n0,90\n", "steer"), M_PI / 2, 1e-12);
  EXPECT_NEAR(value_of("time,delta (\xC2\xB0)\n0,90\n", "{sign: -1}"), -M_PI / 2, 1e-12);
  EXPECT_NEAR(value_of("time,steer\ns,deg\n0,90\n", "steer"), M_PI / 2, 1e-12);
  EXPECT_EQ(value_of("time,steer [deg]\n0,2\n", "{from: steer, unit: rad}"), 2.0) << "who says it, knows";
  EXPECT_EQ(value_of("time,steer [volt]\n0,2\n", "{from: steer, scale: 0.5}"), 1.0);
  EXPECT_THAT(error_of([&] { value_of("time,steer [m]\n0,2\n", "steer"); }),
              testing::AllOf(testing::HasSubstr("gives [m], but delta is in [rad]"),
                             testing::HasSubstr("the head of the column 'steer'")));
}

/// As PlotJuggler names them.
TEST_F(SignalStreamTest, ColumnsMayHaveNamesOfTopics) {
  const auto log = open_csv(put("d.csv", "__time,/fix/altitude,/a:b\n1,2,3\n"));
  SignalStream stream(*log, map("{outputs: {x_gps: /fix/altitude, y_gps: {from: '/a:b', when: {of: /fix/altitude, "
                                "at_most: 2}}, psi_m: none, delta: none}, inputs: {v: none, delta_rate: none}}"));
  log->read(stream.wanted(), [&](const Record& record) {
    for (const SignalRow& row : stream.take(record)) {
      EXPECT_EQ(row.values[0], 2.0);
      EXPECT_EQ(row.values[1], 3.0);
    }
    return true;
  });
  EXPECT_EQ(stream.counts()[1].values, 1);
}

TEST_F(SignalStreamTest, BegunAnewItForgetsWhatDerivativesHaveInHand) {
  const auto log = open_csv(put("d.csv", "time,delta\n10,0.1\n11,0.3\n1,0.5\n2,0.6\n"));
  for (const bool begins_anew : {false, true}) {
    SignalStream stream(*log, map("{outputs: {x_gps: none, y_gps: none, psi_m: none, delta: none}, "
                                  "inputs: {v: none, delta_rate: {from: delta, derivative: true}}}"));
    std::vector<double> rates;
    int records = 0;
    log->read(stream.wanted(), [&](const Record& record) {
      if (++records == 3 && begins_anew) stream.begin_anew();
      for (const SignalRow& row : stream.take(record)) rates.push_back(row.values[1]);
      return true;
    });
    ASSERT_EQ(rates.size(), begins_anew ? 4u : 2u);  // each rate holds at both ends
    EXPECT_NEAR(rates.front(), 0.2, 1e-12);
    EXPECT_NEAR(rates.back(), begins_anew ? 0.1 : 0.2, 1e-12);
  }
}

TEST_F(SignalStreamTest, TheFirstGoodFixIsTheOrigin) {
  const auto log = open_csv(put("d.csv", "time,lat,lon\n1,95,7\n2,51,7\n3,52,7\n"));
  SignalStream stream(*log, map("{outputs: {x_gps: {from: [lat, lon], as: east}, y_gps: {from: [lat, lon], as: north}, "
                                "psi_m: none, delta: none}, inputs: {v: none, delta_rate: none}}"));
  std::vector<double> north;
  log->read(stream.wanted(), [&](const Record& record) {
    for (const SignalRow& row : stream.take(record)) north.push_back(row.values[1]);
    return true;
  });
  ASSERT_TRUE(stream.origin());
  EXPECT_EQ(stream.origin()->latitude, 51.0);
  ASSERT_EQ(north.size(), 2u);
  EXPECT_NEAR(north[0], 0.0, 1e-9);
  EXPECT_NEAR(north[1], 111e3, 1e3);
}

}  // namespace signal_stream_test
}  // namespace rhec::logs
