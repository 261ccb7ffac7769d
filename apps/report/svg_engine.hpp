#pragma once

#include <string>

namespace rhec::apps {

/// Runs the figures' script without a browser (Duktape): a report document in, an array [{name, svg}] in JSON out.
std::string draw_figures(const std::string& document);

}  // namespace rhec::apps
