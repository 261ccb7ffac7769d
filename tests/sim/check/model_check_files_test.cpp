// A check as JSON, of findings that are made up here.
#include <gmock/gmock.h>

#include <limits>

#include "rhec/sim/check/model_check.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace model_check_files_test {

constexpr double infinity = std::numeric_limits<double>::infinity();

ModelCheck made_up() {
  ModelCheck check;
  check.model = "cart";
  check.seed = 7;
  check.parameters = {"grip", "drag"};
  check.states = {"pos", "lean"};
  Finding good, bad;
  good.check = "description";
  bad.check = "derivatives";
  bad.verdict = Verdict::warn;
  bad.where = "d next pos / d lean";
  bad.found = "0.5 and not 0.25";
  bad.advice = "mend it";
  bad.numbers = {{"given", 0.5}, {"expected", infinity}};
  check.findings = {good, bad};
  DriveInformation drive;
  drive.name = "turn";
  drive.unknowns = 4;
  drive.rank = 3;
  drive.condition = 12.5;
  drive.parameter_sigma = {0.25, infinity};
  drive.state_determined = {true, false};
  drive.undetermined = {"0.71 lean - 0.71 drag"};
  check.drives = {drive};
  check.times.emplace_back();
  check.times.front().instruction_set = "generic";
  check.times.front().values = {1.0, 2.0, 3.0};
  return check;
}

TEST(CheckJson, HasAllThatWasFound) {
  const Json json = Json::parse(check_json(made_up()));
  EXPECT_EQ(json.at("model"), "cart");
  EXPECT_EQ(json.at("seed"), 7);
  EXPECT_EQ(json.at("verdict"), "warn");
  EXPECT_EQ(json.at("rank_threshold"), rank_threshold);
  ASSERT_EQ(json.at("findings").size(), 2U);
  const Json& finding = json.at("findings").at(1);
  EXPECT_EQ(finding.at("check"), "derivatives");
  EXPECT_EQ(finding.at("verdict"), "warn");
  EXPECT_EQ(finding.at("where"), "d next pos / d lean");
  EXPECT_EQ(finding.at("found"), "0.5 and not 0.25");
  EXPECT_EQ(finding.at("advice"), "mend it");
  EXPECT_EQ(finding.at("numbers").at("given"), 0.5);
  ASSERT_EQ(json.at("drives").size(), 1U);
  const Json& drive = json.at("drives").at(0);
  EXPECT_EQ(drive.at("rank"), 3);
  EXPECT_EQ(drive.at("parameter_sigma").at("grip"), 0.25);
  EXPECT_EQ(drive.at("state_determined").at("pos"), true);
  EXPECT_EQ(drive.at("state_determined").at("lean"), false);
  EXPECT_EQ(drive.at("undetermined").at(0), "0.71 lean - 0.71 drag");
  ASSERT_EQ(json.at("time_ns").size(), 1U);
  EXPECT_EQ(json.at("time_ns").at(0).at("instruction_set"), "generic");
  EXPECT_EQ(json.at("time_ns").at(0).at("values").at("p99"), 2.0);
}

TEST(CheckJson, WhatIsNotFiniteIsNull) {
  const Json json = Json::parse(check_json(made_up()));
  EXPECT_TRUE(json.at("findings").at(1).at("numbers").at("expected").is_null());
  EXPECT_TRUE(json.at("drives").at(0).at("parameter_sigma").at("drag").is_null());
  EXPECT_TRUE(json.at("time_ns").at(0).at("hessians").at("max").is_null()) << "a model without second derivatives";
}

TEST(CheckJson, TheVerdictIsThatOfTheWorstFinding) {
  ModelCheck check = made_up();
  check.findings[0].verdict = Verdict::fail;
  EXPECT_EQ(Json::parse(check_json(check)).at("verdict"), "fail");
  check.findings.clear();
  EXPECT_EQ(Json::parse(check_json(check)).at("verdict"), "pass");
}

}  // namespace model_check_files_test
}  // namespace rhec::sim
