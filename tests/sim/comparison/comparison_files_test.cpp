// The files of a comparison: the same bytes for the same solvers and seeds, and a picture of each kind of problem.
#include <gmock/gmock.h>

#include "rhec/sim/files/json.hpp"
#include "sim/support/comparisons.hpp"

namespace rhec::sim {
namespace comparison_files_test {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

Json without_times(const Json& node) {
  if (node.is_array()) {
    Json list = Json::array();
    for (const Json& value : node) list.push_back(without_times(value));
    return list;
  }
  if (!node.is_object()) return node;
  Json object = Json::object();
  for (const auto& [key, value] : node.items())
    if (key != "time_us") object[key] = without_times(value);
  return object;
}

TEST(ComparisonFiles, ASecondRunGivesTheSameBytesButForTimes) {
  ComparisonOptions options = comparing(all_backends());
  options.closed_loop = true;
  options.seeds = 2;
  options.every = 25;
  options.accuracy = 1e-5;
  const Json first = without_times(Json::parse(comparison_json(compare(host(), short_scenario(), options))));
  const Json second = without_times(Json::parse(comparison_json(compare(host(), short_scenario(), options))));
  EXPECT_EQ(first.dump(1), second.dump(1));
}

TEST(ComparisonFiles, ThePictureShowsTheKindsOfProblemThatThereAre) {
  Settings settings = short_scenario();
  const ComparisonOptions options = comparing({converged()});
  EXPECT_THAT(comparison_svg(compare(host(), settings, options)), AllOf(HasSubstr("Estimation"), HasSubstr("Control")));
  apply_assignment(settings, "estimator.name=ekf");
  EXPECT_THAT(comparison_svg(compare(host(), settings, options)),
              AllOf(HasSubstr("Control"), Not(HasSubstr("Estimation"))));
}

}  // namespace comparison_files_test
}  // namespace rhec::sim
