#include "rhec/sim/report/report.hpp"

#include <gtest/gtest.h>

#include <string>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

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
