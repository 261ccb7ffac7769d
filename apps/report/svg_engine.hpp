#pragma once

#include <string>

namespace rhec::apps {

/// Runs the script of the figures without a browser (Duktape): takes a report document, returns an array [{name, svg}]
/// in JSON.
std::string draw_figures(const std::string& document);

}  // namespace rhec::apps
