#include "report_page.hpp"

#include <nlohmann/json.hpp>
#include <string_view>

#include "embedded.hpp"
#include "rhec/core/base/error.hpp"
#include "svg_engine.hpp"

namespace rhec::apps {

namespace {

/// Inside <script> nothing may look like markup. JSON has '<' only inside strings, where the escape means the same.
std::string without_markup(const std::string& json) {
  std::string text;
  text.reserve(json.size());
  for (const char letter : json)
    if (letter == '<')
      text += "\\u003c";
    else
      text += letter;
  return text;
}

}  // namespace

bool has_report_page() { return true; }

std::string report_page(const std::string& document) {
  constexpr std::string_view place = "{{document}}";
  const std::string_view page = embedded_page();
  const std::size_t at = page.find(place);
  if (at == std::string_view::npos) throw Error("rhec report: the page has no place for the document; build rhec anew");
  const std::string text = without_markup(document);
  std::string whole;
  whole.reserve(page.size() + text.size());
  whole.append(page.substr(0, at)).append(text).append(page.substr(at + place.size()));
  return whole;
}

std::vector<ReportFigure> report_figures(const std::string& document) {
  std::vector<ReportFigure> figures;
  for (const auto& figure : nlohmann::json::parse(draw_figures(document)))
    figures.push_back({figure.at("name").get<std::string>(), figure.at("svg").get<std::string>()});
  return figures;
}

}  // namespace rhec::apps
