#pragma once

#include <string>
#include <vector>

// The page of `rhec report` and its figures, from a report document (docs/report.md describes it).
namespace rhec::apps {

struct ReportFigure {
  std::string name;  ///< file name without extension
  std::string svg;   ///< contents of the file
};

/// Whether this build has the page; the functions below throw rhec::Error if not.
bool has_report_page();
/// One self-contained HTML file.
std::string report_page(const std::string& document);
/// The figures of that page, drawn for print.
std::vector<ReportFigure> report_figures(const std::string& document);

}  // namespace rhec::apps
