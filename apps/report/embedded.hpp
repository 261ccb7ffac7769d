#pragma once

#include <string_view>

// The output of apps/report/build.mjs, in the program's read-only data.
namespace rhec::apps {

std::string_view embedded_page();
std::string_view embedded_figures();

}  // namespace rhec::apps
