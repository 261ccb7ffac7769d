#include "hosts.hpp"

#include <dlfcn.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <filesystem>

#include "binding.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/loop/scenario.hpp"

namespace rhec::python {
namespace {

namespace py = pybind11;

py::dict plugin_dict(const PluginRecord& plugin) {
  py::dict made;
  made["kind"] = plugin.accepted() ? py::object(py::str(std::string(word_of(plugin.kind)))) : py::none();
  made["name"] = plugin.name;
  made["version"] = plugin.version;
  made["licence"] = plugin.licence;
  made["source"] = plugin.source;
  made["backend"] = plugin.backend;
  made["path"] = plugin.path.string();
  made["refusal"] = plugin.explanation();
  return made;
}

py::list list_of(const std::vector<OptionRow>& rows) {
  py::list made;
  for (const OptionRow& row : rows) {
    py::dict option;
    option["name"] = row.name;
    option["type"] = row.type;
    option["default"] = row.default_value;
    option["values"] = row.constraint;
    option["meaning"] = row.meaning;
    made.append(option);
  }
  return made;
}

PluginKind kind_of(const std::string& word) {
  for (const PluginKind kind :
       {PluginKind::model, PluginKind::blocking, PluginKind::solver, PluginKind::prior, PluginKind::term})
    if (word == word_of(kind)) return kind;
  throw Error("kind: found '" + word + "', expected one of model, blocking, solver, prior, term");
}

/// The options of all plugins with that name, by their kinds.
py::dict options_of(const std::vector<std::string>& plugin_path, const std::string& name, const std::string& kind) {
  const Host host = examined_host(plugin_path);
  py::dict made;
  if (!kind.empty()) {
    made[py::str(kind)] = list_of(host.options(kind_of(kind), name));
    return made;
  }
  for (const PluginRecord& plugin : host.discover())
    if (plugin.accepted() && plugin.name == name)
      made[py::str(std::string(word_of(plugin.kind)))] = list_of(host.options(plugin.kind, name));
  if (made.size() == 0) made["model"] = list_of(host.options(PluginKind::model, name));  // a file, or the host's error
  return made;
}

/// The keys of scenarios, by section; the root's is "".
py::dict sections() {
  std::vector<OptionSection> all = sim::scenario_sections();
  for (OptionSection& section : sim::log_sections()) all.push_back(std::move(section));
  py::dict made;
  for (const OptionSection& section : all) made[py::str(section.name)] = list_of(section.rows);
  return made;
}

/// The folder of the library that this module is linked to.
std::string library_folder() {
  Dl_info found{};
  dladdr(reinterpret_cast<const void*>(&word_of), &found);
  return std::filesystem::canonical(found.dli_fname).parent_path().string();
}

}  // namespace

Host examined_host(const std::vector<std::string>& plugin_path) {
  return Host({plugin_path.begin(), plugin_path.end()}, {.apart = true});
}

void bind_hosts(py::module_& module) {
  module.def(
      "plugins",
      [](const std::vector<std::string>& plugin_path) {
        const Host host = examined_host(plugin_path);
        py::list made;
        for (const PluginRecord& plugin : host.discover()) made.append(plugin_dict(plugin));
        return made;
      },
      py::arg("plugin_path"));
  module.def("plugin_options", &options_of, py::arg("plugin_path"), py::arg("name"), py::arg("kind"));
  module.def("sections", &sections);
  module.def("library_folder", &library_folder);
}

}  // namespace rhec::python
