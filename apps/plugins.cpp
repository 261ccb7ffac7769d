#include "rhec/plugins/host/host.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "doctor.hpp"
#include "formula_views.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::apps {
namespace {

struct PluginsArguments {
  std::string name;
  bool json = false;
  bool doctor = false;
  GraphFile graph;
  std::vector<std::filesystem::path> plugin_path;
};

using Table = std::vector<std::vector<std::string>>;

/// Each column is as wide as its widest cell, except the last, which is not padded.
void print_table(const Table& rows, std::string_view indent) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  }
  for (const auto& row : rows) {
    std::string line(indent);
    for (std::size_t c = 0; c < row.size(); ++c)
      line += c + 1 < row.size() ? fmt::format("{:<{}}  ", row[c], widths[c]) : row[c];
    fmt::print("{}\n", line.substr(0, line.find_last_not_of(' ') + 1));
  }
}

std::string or_dash(const std::string& text) { return text.empty() ? "-" : text; }

std::string backend_of(const PluginRecord& plugin) {
  if (plugin.backend.empty()) return "-";
  return plugin.backend_version.empty() ? plugin.backend : plugin.backend + " " + plugin.backend_version;
}

void list(const Host& host) {
  Table table{{"KIND", "NAME", "VERSION", "LICENCE", "BACKEND", "PATH"}};
  Table refused;
  for (const PluginRecord& plugin : host.discover()) {
    if (plugin.accepted()) {
      table.push_back({std::string(word_of(plugin.kind)), plugin.name, plugin.version, or_dash(plugin.licence),
                       backend_of(plugin), plugin.path.string()});
    } else {
      refused.push_back({plugin.path.string() + ":", plugin.explanation()});
    }
  }
  std::sort(table.begin() + 1, table.end());
  if (table.size() > 1) {
    print_table(table, "");
  } else {
    fmt::print("No plugins.\n{}", host.diagnosis());
  }
  if (refused.empty()) return;
  fmt::print("\nNot used:\n");
  print_table(refused, "  ");
}

struct VariableKind {
  const char* name;
  std::vector<Variable> ModelDescription::*variables;
};
constexpr VariableKind variable_kinds[] = {{"states", &ModelDescription::states},
                                           {"inputs", &ModelDescription::inputs},
                                           {"parameters", &ModelDescription::parameters},
                                           {"outputs", &ModelDescription::outputs}};

/// A model made without options, with all the outputs it offers.
std::shared_ptr<Model> model_with_all_outputs(const Host& host, const std::string& name) {
  Settings options;
  options.set("outputs", Settings::scalar("all"));
  return host.make_model(name, options);
}

/// Of a model: what computes it on this machine.
std::string how_evaluated(const Model& model) {
  const std::vector<std::string> sets = model.instruction_sets();
  if (!model.graph()) return "by code of its own, " + sets.back();
  if (sets.front() != "interpreted") return "by the interpreter, " + sets.back();
  return fmt::format("by compiled kernels, {} (of {})", sets.back(), fmt::join(sets.begin() + 1, sets.end(), ", "));
}

/// The variables that a configuration can name.
void print_variables(const ModelDescription& about) {
  Table table{{"VARIABLE", "UNIT", "BOUNDS", "MEANING"}};
  for (const VariableKind& kind : variable_kinds) {
    table.push_back({kind.name});
    for (const Variable& variable : about.*kind.variables) {
      const bool bounded = std::isfinite(variable.lower) || std::isfinite(variable.upper);
      std::string meaning = variable.meaning;
      if (kind.variables == &ModelDescription::parameters)
        meaning += fmt::format(" ({:g}: nothing slips)", variable.nominal);
      if (kind.variables == &ModelDescription::outputs && !variable.usual) meaning += " (if chosen)";
      table.push_back({"  " + variable.name, variable.unit,
                       bounded ? fmt::format("[{:.4g}, {:.4g}]", variable.lower, variable.upper) : "-", meaning});
    }
  }
  fmt::print("\n");
  print_table(table, "");
}

sim::Json as_json(const Variable& variable) {
  sim::Json all{{"name", variable.name}, {"unit", variable.unit}, {"meaning", variable.meaning}};
  all["lower"] = variable.lower;  // null if there is none
  all["upper"] = variable.upper;
  all["scale"] = variable.scale;
  return all;
}

void add_variables(const ModelDescription& about, sim::Json& all) {
  for (const VariableKind& kind : variable_kinds) {
    auto& list = all[kind.name] = sim::Json::array();
    for (const Variable& variable : about.*kind.variables) {
      list.push_back(as_json(variable));
      if (kind.variables == &ModelDescription::parameters) list.back()["nominal"] = variable.nominal;
      if (kind.variables == &ModelDescription::outputs) list.back()["usual"] = variable.usual;
    }
  }
}

void print_options(const std::vector<OptionRow>& options) {
  if (options.empty()) {
    fmt::print("\nIt has no options.\n");
    return;
  }
  Table table{{"OPTION", "TYPE", "DEFAULT", "VALUES", "MEANING"}};
  for (const OptionRow& option : options)
    table.push_back(
        {option.name, option.type, or_dash(option.default_value), or_dash(option.constraint), option.meaning});
  fmt::print("\n");
  print_table(table, "");
}

void describe(const Host& host, const PluginRecord& plugin) {
  Table about{{"kind", std::string(word_of(plugin.kind))},
              {"name", plugin.name},
              {"version", plugin.version},
              {"licence", or_dash(plugin.licence)},
              {"source", or_dash(plugin.source)},
              {"backend", backend_of(plugin)},
              {"can", or_dash(plugin.capabilities)},
              {"path", plugin.path.string()}};
  std::shared_ptr<Model> model;
  if (plugin.kind == PluginKind::model) {
    model = model_with_all_outputs(host, plugin.name);
    about.insert(about.end() - 1, {"evaluated", how_evaluated(*model)});
  }
  print_table(about, "");
  if (model) print_variables(model->description());
  print_options(host.options(plugin.kind, plugin.name));
}

/// A vehicle whose equations are a file.
void describe_vehicle(const Host& host, const std::string& file) {
  const std::shared_ptr<Model> model = model_with_all_outputs(host, file);
  const ModelDescription& about = model->description();
  print_table({{"kind", "model, of equations"},
               {"name", about.name},
               {"source", or_dash(about.source)},
               {"evaluated", how_evaluated(*model)},
               {"path", file}},
              "");
  print_variables(about);
  print_options(host.options(PluginKind::model, file));
}

void add_options(const std::vector<OptionRow>& options, sim::Json& all) {
  all["options"] = sim::Json::array();
  for (const OptionRow& option : options)
    all["options"].push_back({{"name", option.name},
                              {"type", option.type},
                              {"default", option.default_value},
                              {"constraint", option.constraint},
                              {"meaning", option.meaning}});
}

sim::Json vehicle_json(const Host& host, const std::string& file) {
  const std::shared_ptr<Model> model = model_with_all_outputs(host, file);
  const ModelDescription& about = model->description();
  sim::Json all{{"kind", "model"}, {"name", about.name}, {"source", about.source}, {"path", file}};
  add_options(host.options(PluginKind::model, file), all);
  add_variables(about, all);
  return all;
}

sim::Json as_json(const Host& host, const PluginRecord& plugin) {
  sim::Json all;
  if (!plugin.accepted()) return {{"path", plugin.path.string()}, {"refusal", plugin.explanation()}};
  all["kind"] = std::string(word_of(plugin.kind));
  all["name"] = plugin.name;
  all["version"] = plugin.version;
  all["licence"] = plugin.licence;
  all["source"] = plugin.source;
  all["backend"] = plugin.backend;
  all["backend_version"] = plugin.backend_version;
  all["capabilities"] = plugin.capabilities;
  all["path"] = plugin.path.string();
  add_options(host.options(plugin.kind, plugin.name), all);
  if (plugin.kind == PluginKind::model) add_variables(model_with_all_outputs(host, plugin.name)->description(), all);
  return all;
}

/// The plugins of that name. Of several of one kind, only the first one found is used.
std::vector<PluginRecord> named(const Host& host, const std::string& name) {
  std::vector<PluginRecord> found;
  std::vector<std::string> known;
  for (const PluginRecord& plugin : host.discover()) {
    if (!plugin.accepted()) continue;
    known.push_back(plugin.name);
    const auto same = [&](const PluginRecord& other) { return other.kind == plugin.kind; };
    if (plugin.name == name && std::none_of(found.begin(), found.end(), same)) found.push_back(plugin);
  }
  if (!found.empty()) return found;
  throw unknown_plugin("there is no plugin", name, known, host);
}

int show(const PluginsArguments& arguments) {
  const Host host = examined_host(arguments.plugin_path, arguments.doctor);
  if (arguments.doctor) return examine_plugins(host, arguments.name, arguments.json);
  if (arguments.graph) {
    if (arguments.name.empty())
      throw Error("--graph: it is the graph of a model, which is not named; name it before --graph");
    return show_graph(*model_with_all_outputs(host, arguments.name), *arguments.graph, arguments.json);
  }
  if (is_equations_file(arguments.name)) {
    if (arguments.json) {
      auto all = sim::Json::array();
      all.push_back(vehicle_json(host, arguments.name));
      fmt::print("{}\n", all.dump(2));
    } else {
      describe_vehicle(host, arguments.name);
    }
    return exit_fine;
  }
  const std::vector<PluginRecord> wanted = arguments.name.empty() ? host.discover() : named(host, arguments.name);
  if (arguments.json) {
    auto all = sim::Json::array();
    for (const PluginRecord& plugin : wanted) all.push_back(as_json(host, plugin));
    fmt::print("{}\n", all.dump(2));
  } else if (arguments.name.empty()) {
    list(host);
  } else {
    for (const PluginRecord& plugin : wanted) {
      if (&plugin != &wanted.front()) fmt::print("\n");
      describe(host, plugin);
    }
  }
  return exit_fine;
}

}  // namespace

void add_plugins(Program& program) {
  auto arguments = std::make_shared<PluginsArguments>();
  Command command = program.add(
      "plugins", "Lists the models, blockings, solvers, priors and terms that are found, or says all of one.",
      "Examples:\n"
      "  rhec plugins\n"
      "  rhec plugins gn_rti\n"
      "  rhec plugins my_vehicle.yaml       a vehicle's equations\n"
      "  rhec plugins my_vehicle.yaml --graph vehicle.svg\n"
      "  rhec plugins --doctor              why each file was or was not accepted\n"
      "  rhec plugins --json --plugin-path my/plugins",
      [arguments] { return show(*arguments); });
  command
      .add("name", arguments->name,
           "show this plugin, its options, and what a model has; or a vehicle's equations (*.yaml); a plugin or a file "
           "with --doctor")
      .value("NAME");
  command.add_flag("--json", arguments->json, "print JSON, options included");
  command
      .add_optional("--graph", arguments->graph,
                    "of a model: print operations, depth and sparsity of its formula, and draw it if a file is named")
      .value("[FILE.svg]");
  command.add_flag("--doctor", arguments->doctor,
                   "say of every file that could be a plugin if it is accepted, or why not and what to do, and try the "
                   "accepted ones; the exit code is 3 if one is refused, not used, or fails");
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
