// What `rhec report` says where rhec was built without its page.
#include <gmock/gmock.h>

#include <string>

#include "apps/report/report_page.hpp"
#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"

namespace rhec::apps {
namespace no_report_page_test {

using testing::AllOf;
using testing::HasSubstr;

TEST(NoReportPage, SaysHowToBuildRhecWithIt) {
  EXPECT_FALSE(has_report_page());
  const auto remedy = AllOf(HasSubstr("built without the report's page"), HasSubstr("-DRHEC_REPORT=ON"));
  EXPECT_THAT(error_of([] { report_page("{}"); }), remedy);
  EXPECT_THAT(error_of([] { report_figures("{}"); }), remedy);
}

}  // namespace no_report_page_test
}  // namespace rhec::apps
