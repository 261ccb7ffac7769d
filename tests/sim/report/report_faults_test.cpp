// The document of a fault campaign: what the campaign wrote, and what is not reached as notes.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/report/report.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace report_faults_test {

struct FaultsReport : FolderTest {
  Json spread{{"median", 3}, {"p99", nullptr}};
  Json measures{{"rides", 7},     {"recovered", spread},   {"ok_again", spread},
                {"never", 1},     {"unsaid", 0},           {"followed", 0},
                {"honest", 0.97}, {"honest_heading", 1.0}, {"longest_dishonest", 4},
                {"volume", 1.0},  {"wide", nullptr},       {"curve", Json::parse("[[0, 0.1, 2.0], [10, 0.05, 0.3]]")}};

  Json campaign() const {
    Json kind{{"name", "spike"}, {"group", "transient"}, {"estimators", Json{{"ekf", measures}}}};
    Json all{{"form", "rhec faults"}, {"version", 2}, {"steps", 4200},
             {"drives", 1234},        {"window", 15}, {"figures", 6}};
    all["samples"] = Json::parse("[0, 10]");
    all["vehicles"] = Json::parse(R"(["bicycle_slip"])");
    all["estimators"] = Json::parse(R"(["ekf"])");
    all["missed"] = Json::parse(R"(["spike: not reached: this"])");
    all["wanted"] = Json{{"honest", 0.95}};
    all["kinds"] = Json::array();
    all["kinds"].push_back(kind);
    return all;
  }
  std::filesystem::path written(const char* name) const { return put(name, campaign().dump()); }
};

TEST_F(FaultsReport, HasTheCampaignAndWhatIsNotReached) {
  const Json document = Json::parse(report_document(written("faults.json"), "test"));
  EXPECT_EQ(document.at("kind").get<std::string>(), "faults");
  EXPECT_EQ(document.at("campaign").dump(), campaign().dump());
  EXPECT_EQ(document.at("notes")[0].at("text").get<std::string>(), "spike: not reached: this");
  EXPECT_NE(document.at("subtitle").get<std::string>().find("1,234 drives"), std::string::npos);
}

TEST_F(FaultsReport, AnotherFileIsNoCampaign) {
  const std::filesystem::path file = written("another.json");
  EXPECT_CONTAINS(error_of([&] { report_document(file, "test"); }), "compare.json");
}

}  // namespace report_faults_test
}  // namespace rhec::sim
