#include "version.hpp"

#include <iterator>

#include <fmt/format.h>

#include "built_with.hpp"
#include "crash_report.hpp"
#include "rhec/core/base/instruction_sets.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec::apps {
namespace {

/// The plugins that stand on other libraries, and the versions of these.
std::string backends() {
  const Host host = examined_host({});
  std::string text;
  for (const PluginRecord& plugin : host.discover()) {
    if (!plugin.accepted() || plugin.backend.empty()) continue;
    fmt::format_to(std::back_inserter(text), "{}{}: {}", text.empty() ? "" : ", ", plugin.name, plugin.backend);
    if (!plugin.backend_version.empty()) text += " " + plugin.backend_version;
  }
  return text.empty() ? "none was found" : text;
}

std::string_view widest_here() {
  std::string_view widest;
  for (const InstructionSet& set : instruction_sets)
    if (set.is_here()) widest = set.name;
  return widest;
}

}  // namespace

std::string version_text() {
  const auto preset = [](const char* name) { return *name ? name : "none"; };
  return fmt::format("rhec " RHEC_PROJECT_VERSION
                     "\n"
                     "compiler          {}, for {}\n"
                     "preset            {}\n"
                     "flags             {}\n"
                     "instruction sets  core: {}; models: {}; the widest of this machine is {}\n"
                     "libraries         {}\n"
                     "parts             {}\n"
                     "backends          {}",
                     built_with::compiler, built_with::target, preset(built_with::preset), built_with::flags,
                     built_with::core_sets, built_with::model_sets, widest_here(), built_with::libraries,
                     built_with::parts, backends());
}

}  // namespace rhec::apps
