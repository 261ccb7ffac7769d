#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "output.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "rhec/plugins/equations/vehicle_cpp.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/check/formula_size.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/files/output_folder.hpp"

namespace rhec::apps {
namespace {

struct ModelArguments {
  std::string file;
  std::vector<std::string> assignments;
  std::optional<std::string> folder;
  bool force = false, json = false;
};

std::string listed(const std::vector<Variable>& variables) {
  std::vector<std::string> names;
  names.reserve(variables.size());
  for (const Variable& variable : variables) names.push_back(fmt::format("{} [{}]", variable.name, variable.unit));
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

sim::Json json_of(const std::vector<Variable>& variables) {
  sim::Json list = sim::Json::array();
  for (const Variable& variable : variables) list.push_back({{"name", variable.name}, {"unit", variable.unit}});
  return list;
}

sim::Json json_of(const Model& model, const std::string& file) {
  const ModelDescription& about = model.description();
  sim::Json options = sim::Json::object(), operations = sim::Json::object();
  for (const Tape::Known& option : model.graph()->options)
    options[model.graph()->graph->name_of(option.node)] = option.value;
  for (const auto& [what, count] : sim::size_of_formula(*model.graph(), about).counts) operations[what] = count;
  return {{"file", file},
          {"name", about.name},
          {"states", json_of(about.states)},
          {"inputs", json_of(about.inputs)},
          {"parameters", json_of(about.parameters)},
          {"outputs", json_of(about.outputs)},
          {"options", options},
          {"operations", operations}};
}

void summarise(const Model& model, const std::string& file) {
  const ModelDescription& about = model.description();
  const sim::FormulaSize size = sim::size_of_formula(*model.graph(), about);
  fmt::print("{}: the vehicle '{}' is valid\n", file, about.name);
  fmt::print("  states      {}\n  inputs      {}\n  parameters  {}\n  outputs     {}\n", listed(about.states),
             listed(about.inputs), listed(about.parameters), listed(about.outputs));
  std::vector<std::string> options;
  for (const Tape::Known& option : model.graph()->options)
    options.push_back(fmt::format("{} = {:g}", model.graph()->graph->name_of(option.node), option.value));
  fmt::print("  options     {}\n", options.empty() ? "none" : fmt::format("{}", fmt::join(options, ", ")));
  fmt::print("  operations  {} of f, {} of h; {} of a whole step with Jacobian and Hessian\n", size.counts[0].second,
             size.counts[3].second, size.counts.back().second);
  fmt::print("'rhec check {0}' looks at its derivatives, 'rhec plugins {0} --graph' at its formula\n", file);
}

/// Writes the plugin's folder, all of it or nothing.
void write_cpp(const ModelArguments& arguments) {
  const VehicleSources sources = vehicle_as_cpp(arguments.file);
  const std::filesystem::path folder(arguments.folder->empty() ? sources.plugin : *arguments.folder);
  for (const VehicleSources::File& file : sources.files)
    if (!arguments.force && std::filesystem::exists(folder / file.name))
      throw Error(fmt::format("{}: is there already; name another folder, or replace it with --force",
                              (folder / file.name).string()));
  sim::OutputFolder out(folder);
  for (const VehicleSources::File& file : sources.files) out.write(file.name, file.content);
  out.commit();
  for (const VehicleSources::File& file : sources.files) fmt::print("{}\n", (folder / file.name).string());
  for (const std::string& note : sources.notes) fmt::print("note: {}\n", note);
}

int show(const ModelArguments& arguments) {
  if (!is_equations_file(arguments.file))
    throw Error(
        fmt::format("'{}' is no file with a vehicle's equations, whose name ends in .yaml; 'rhec plugins {}' says "
                    "what a plugin is",
                    arguments.file, arguments.file));
  Settings settings = Settings::map({arguments.file, 0});
  apply_assignments(settings, arguments.assignments);
  settings.set("outputs", Settings::scalar("all"));
  const std::shared_ptr<Model> model = examined_host({}).make_model(arguments.file, settings);
  if (arguments.folder)
    write_cpp(arguments);
  else if (arguments.json)
    fmt::print("{}\n", json_of(*model, arguments.file).dump(2));
  else
    summarise(*model, arguments.file);
  return exit_fine;
}

}  // namespace

void add_model(Program& program) {
  auto arguments = std::make_shared<ModelArguments>();
  Command command = program.add("model", "Looks at a vehicle's equations, or turns them into C++.",
                                "docs/equations.md describes such files.\n\n"
                                "Examples:\n"
                                "  rhec model my_vehicle.yaml\n"
                                "  rhec model my_vehicle.yaml --cpp              a folder with a plugin\n"
                                "  rhec model my_vehicle.yaml --cpp src/vehicle --force",
                                [arguments] { return show(*arguments); });
  command.add("file", arguments->file, "a vehicle's equations (*.yaml)").value("FILE").required();
  const Argument cpp =
      command.add_optional("--cpp", arguments->folder,
                           "write a plugin in C++ into this folder; without a name, into one named as the vehicle");
  Argument(cpp).value("[FOLDER]");
  command.add_flag("--force", arguments->force, "replace files that are there").needs(cpp);
  add_assignments(command, arguments->assignments, "an option of the vehicle, where the file has no default");
  add_json(command, arguments->json);
}

}  // namespace rhec::apps
