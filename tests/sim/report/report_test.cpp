#include "rhec/sim/report/report.hpp"

#include <gtest/gtest.h>

#include <string>

#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace report_test {

TEST(ReportDocument, RefusesWhatIsNotThere) {
  const std::string refusal = error_of([] { report_document("no/such/folder", "test"); });
  EXPECT_CONTAINS(refusal, "no/such/folder");
  EXPECT_CONTAINS(refusal, "rhec run");
}

}  // namespace report_test
}  // namespace rhec::sim
