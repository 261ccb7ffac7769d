// The check of a term as JSON.
#include <gmock/gmock.h>

#include "rhec/sim/check/model_check.hpp"
#include "rhec/sim/files/json.hpp"
#include "sim/support/written_term.hpp"

namespace rhec::sim {
namespace term_check_files_test {

TEST(TermCheckFiles, HaveAllOfIt) {
  TermCheck check;
  check.term = "mine";
  check.seed = 5;
  check.findings.emplace_back().check = "rows";
  check.findings.back().verdict = Verdict::fail;
  check.findings.back().where = "limit 'a'";
  check.vehicles.push_back({"cart", 2, 1, 3, {1.0, 2.0, 3.0}, {}, {}});
  const Json json = Json::parse(check_json(check));
  EXPECT_EQ(json["term"], "mine");
  EXPECT_EQ(json["seed"], 5);
  EXPECT_EQ(json["verdict"], "fail");
  EXPECT_EQ(json["findings"][0]["where"], "limit 'a'");
  EXPECT_EQ(json["vehicles"][0]["vehicle"], "cart");
  EXPECT_EQ(json["vehicles"][0]["data"], 3);
  EXPECT_EQ(json["vehicles"][0]["time_ns"]["values"]["p99"], 2.0);
  EXPECT_TRUE(json["vehicles"][0]["time_ns"]["hessians"]["median"].is_null());
  ModelCheck model;
  model.model = "cart";
  const Json both = Json::parse(check_json(model, {check, check}));
  EXPECT_EQ(both["model"], "cart");
  ASSERT_EQ(both["terms"].size(), 2u);
  EXPECT_EQ(both["terms"][1], json);
}

}  // namespace term_check_files_test
}  // namespace rhec::sim
