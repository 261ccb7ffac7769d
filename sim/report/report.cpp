#include "rhec/sim/report/report.hpp"

#include <fmt/format.h>

#include <fstream>
#include <utility>

#include "report_parts.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

namespace fs = std::filesystem;

constexpr int document_version = 1;
constexpr const char* what_there_is =
    "expected the folder of a run (steps.csv, times.csv, summary.json: 'rhec run' makes it) or of an estimation "
    "(estimates.csv, summary.json: 'rhec estimate'), the database of a sweep ('rhec sweep'), or compare.json ('rhec "
    "compare'), or a map of slip (estimator.memory.file), or faults.json ('scripts/fault-campaign')";

[[noreturn]] void missing(const fs::path& folder, const char* file, const char* beside, const char* maker) {
  throw Error(
      fmt::format("{}: is missing, though {} is there; the folder is not whole: take a copy that is, or make it "
                  "again with '{}'",
                  (folder / file).string(), beside, maker));
}

/// Remains of an OutputFolder whose program was killed.
std::string unfinished_in(const fs::path& folder) {
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (const std::string name = entry.path().filename().string();
        entry.is_directory() && name.starts_with('.') && name.find(".partial-") != std::string::npos)
      return fmt::format(", but {} of one that was ended before it was done: start it again", name);
  return {};
}

Json folder_report(const fs::path& folder) {
  const auto has = [&](const char* name) { return fs::is_regular_file(folder / name); };
  if (!has("summary.json")) {
    if (has("steps.csv")) missing(folder, "summary.json", "steps.csv", run_maker);
    if (has("estimates.csv")) missing(folder, "summary.json", "estimates.csv", log_maker);
    if (has("faults.json")) return faults_report(folder / "faults.json");
    if (has("compare.json")) return comparison_report(folder / "compare.json");
    throw Error(
        fmt::format("{}: there is no run in this folder{}; {}", folder.string(), unfinished_in(folder), what_there_is));
  }
  // A folder may have held a run and then an estimation, or vice versa; the summary is that of the last one.
  const Json summary = read_json(folder / "summary.json", run_maker);
  if (summary.is_object() && summary.contains("variants")) {
    if (!has("estimates.csv")) missing(folder, "estimates.csv", "summary.json", log_maker);
    if (!summary.contains("signals")) return log_report(folder, summary);
    for (const char* name : {"innovations.csv", "measurements.csv", "predictions.csv"})
      if (!has(name)) missing(folder, name, "summary.json", log_maker);
    return drive_report(folder, summary);
  }
  if (!summary.is_object() || !summary.contains("mae"))
    throw Error(fmt::format("{}: has neither mae nor variants, so it is no summary that rhec wrote; {}",
                            (folder / "summary.json").string(), what_there_is));
  if (!has("steps.csv")) missing(folder, "steps.csv", "summary.json", run_maker);
  return run_report(folder, summary);
}

Json file_report(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string start(72, '\0');
  stream.read(start.data(), std::ssize(start));
  start.resize(static_cast<std::size_t>(stream.gcount()));
  if (!stream.is_open()) throw Error(fmt::format("{}: cannot be read; mend its permissions", file.string()));
  if (start.empty()) throw Error(fmt::format("{}: is empty; {}", file.string(), what_there_is));
  // A database says at byte 68 whose it is (SQLite's "application id").
  if (start.starts_with("SQLite format 3"))
    return start.size() == 72 && start.substr(68) == "rhmp" ? map_report(file) : sweep_report(file);
  const std::string name = file.filename().string();
  if (name == "summary.json" || name == "steps.csv" || name == "times.csv" || name == "horizons.jsonl" ||
      name == "estimates.csv")
    throw Error(fmt::format("{}: is one of a run's files; give the folder that it is in, '{}'", file.string(),
                            file.has_parent_path() ? file.parent_path().string() : "."));
  if (start.find_first_not_of(" \t\r\n") != std::string::npos && start[start.find_first_not_of(" \t\r\n")] == '{')
    return name == "faults.json" ? faults_report(file) : comparison_report(file);
  throw Error(fmt::format("{}: is neither a database of SQLite nor JSON; {}", file.string(), what_there_is));
}

}  // namespace

std::string report_document(const fs::path& source, const std::string& program) {
  std::error_code failure;
  const fs::file_status status = fs::status(source, failure);
  if (source.empty() || !fs::exists(status))
    throw Error(
        fmt::format("{}: there is no such folder or file; {}", source.empty() ? "''" : source.string(), what_there_is));
  Json document;
  document["form"] = "rhec report";
  document["version"] = document_version;
  try {
    document.update(fs::is_directory(status) ? folder_report(source) : file_report(source));
  } catch (const JsonError& error) {
    throw Error(
        fmt::format("{}: a value is of another kind than expected ({}); take a copy that is whole, or make it "
                    "again",
                    source.string(), error.what()));
  }
  document["source"] = source.string();
  document["program"] = program;
  return document.dump();
}

}  // namespace rhec::sim
