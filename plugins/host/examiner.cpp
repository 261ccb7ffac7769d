#include <link.h>

#include <string>

#include "factory.hpp"
#include "library.hpp"
#include "rhec/plugins/host/examination.hpp"
#include "verdict.hpp"

namespace rhec {
namespace {

int add_library(dl_phdr_info* object, std::size_t, void* libraries) {
  const std::string path = object->dlpi_name;
  if (path.empty() || path.front() != '/') return 0;  // the program itself; what the kernel provides
  if (const auto stamp = stamp_of(path)) static_cast<std::vector<NeededLibrary>*>(libraries)->push_back({path, *stamp});
  return 0;
}

}  // namespace

void examine_in_this_process(const std::filesystem::path& plugin, const ExaminationReport& report) {
  const Stage stage = [&](std::string_view name) { report(report_line("stage", name)); };
  bool is_loaded = false;
  const Library library = load_library(plugin, [&](std::string_view name) {
    is_loaded = name == "manifest";
    stage(name);
  });
  Verdict verdict;
  verdict.record = library.record;
  report(lines_of(verdict));  // whose plugin it is, should it not come back from the trial
  if (library.manifest) verdict.trial = try_library(library, stage);
  if (is_loaded) dl_iterate_phdr(&add_library, &verdict.libraries);
  report(lines_of(verdict));
}

}  // namespace rhec
