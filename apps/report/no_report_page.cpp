// For builds without the report page (-DRHEC_REPORT=OFF).
#include "report_page.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::apps {

namespace {
constexpr const char* without =
    "rhec report: this rhec was built without the report's page; build it with -DRHEC_REPORT=ON, which needs node, npm "
    "and duktape (scripts/install-dependencies)";
}

bool has_report_page() { return false; }
std::string report_page(const std::string&) { throw Error(without); }
std::vector<ReportFigure> report_figures(const std::string&) { throw Error(without); }

}  // namespace rhec::apps
