#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "output.hpp"
#include "report/report_page.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/report/report.hpp"

namespace rhec::apps {
namespace {

struct ReportArguments {
  std::string source, page, figures;
  bool json = false;
};

/// Writes one file next to its destination; `commit` moves it into place.
class OutputFile {
 public:
  OutputFile(const std::filesystem::path& file, const std::string& content) : folder_(folder_of(file)) {
    folder_.write(file.filename().string(), content);
  }
  void commit() { folder_.commit(); }

 private:
  static std::filesystem::path folder_of(const std::filesystem::path& file) {
    if (!file.has_filename() || std::filesystem::is_directory(file))
      throw Error(fmt::format("--out {}: is a folder; give the name of a file, such as {}", file.string(),
                              (file / "report.html").string()));
    return file.has_parent_path() ? file.parent_path() : ".";
  }
  sim::OutputFolder folder_;
};

/// The page lies with what it is of: in a folder of results, beside a file.
std::filesystem::path page_of(const ReportArguments& arguments) {
  if (!arguments.page.empty()) return arguments.page;
  const std::filesystem::path source(arguments.source);
  return std::filesystem::is_directory(source) ? source / "report.html"
                                               : std::filesystem::path(source).replace_extension(".html");
}

int report(const ReportArguments& arguments) {
  if (!has_report_page())
    throw Error("this program was built without the page of reports (-DRHEC_REPORT=OFF); build it with RHEC_REPORT=ON");
  const std::string document = sim::report_document(arguments.source, "rhec " RHEC_PROJECT_VERSION);
  const std::filesystem::path file = page_of(arguments);
  OutputFile page(file, report_page(document));
  std::optional<sim::OutputFolder> figures;
  std::size_t count = 0;
  if (!arguments.figures.empty()) {
    figures.emplace(arguments.figures);
    for (const ReportFigure& figure : report_figures(document)) {
      figures->write(figure.name + ".svg", figure.svg);
      ++count;
    }
    figures->commit();
  }
  page.commit();
  if (arguments.json) {
    sim::Json all{{"report", file.string()}};
    if (figures) all["figures"] = figures->path().string();
    fmt::print("{}\n", all.dump(2));
    return exit_fine;
  }
  fmt::print("report: {}\n", file.string());
  if (figures) fmt::print("{} figures: {}\n", count, figures->path().string());
  return exit_fine;
}

}  // namespace

void add_report(Program& program) {
  auto arguments = std::make_shared<ReportArguments>();
  Command command = program.add(
      "report", "Makes a page to look at of a run, an estimation, a sweep, a comparison of solvers or a map of slip.",
      "The page is one HTML file that needs no network: open it in a browser. It has every figure with its numbers, "
      "and a\n"
      "window that can be moved through a run: blocks, measurements, the plan.\n\n"
      "Examples:\n"
      "  rhec report out/figure8                  makes out/figure8/report.html\n"
      "  rhec report out/blocks.sqlite -o blocks.html --svg out/figures\n"
      "  rhec report out/compare/compare.json",
      [arguments] { return report(*arguments); });
  command
      .add("source", arguments->source,
           "the folder of 'rhec run' or 'rhec estimate', the database of 'rhec sweep', compare.json, or a map of slip")
      .value("RUN_OR_DB_OR_COMPARISON")
      .required();
  command
      .add("-o,--out", arguments->page,
           "the page; otherwise report.html in the folder that it is of, or beside the file, with its name")
      .value("FILE");
  command.add("--svg", arguments->figures, "folder for the figures, each a file of its own for a paper").value("DIR");
  add_json(command, arguments->json);
}

}  // namespace rhec::apps
