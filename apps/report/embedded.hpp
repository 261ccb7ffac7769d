#pragma once

#include <string_view>

// What apps/report/build.mjs made, in the program's read-only data.
namespace rhec::apps {

std::string_view embedded_page();
std::string_view embedded_figures();

}  // namespace rhec::apps
