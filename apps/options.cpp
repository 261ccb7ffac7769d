#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "output.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/logs/mapping/signal_map.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "ros/ros_options.hpp"

namespace rhec::apps {
namespace {

struct OptionsArguments {
  std::string section;
  bool json = false;
  std::vector<std::filesystem::path> plugin_path;
};

using Row = std::vector<std::string>;

/// A row of a Markdown table; a bar inside a cell is escaped, since it would end the cell.
std::string line_of(const Row& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) {
    line += ' ';
    for (const char c : cell) line += c == '|' ? std::string("\\|") : std::string(1, c);
    line += " |";
  }
  return line + "\n";
}

std::string table_of(const Row& head, const std::vector<Row>& rows) {
  std::string text = line_of(head) + "|";
  for (std::size_t i = 0; i < head.size(); ++i) text += "---|";
  text += "\n";
  for (const Row& row : rows) text += line_of(row);
  return text;
}

std::string table_of(const std::vector<OptionRow>& options, const std::string& prefix) {
  std::vector<Row> rows;
  for (const OptionRow& option : options) {
    const bool is_section = option.type == "map";
    rows.push_back({fmt::format("`{}{}`", prefix, option.name), option.type, is_section ? "" : option.default_value,
                    is_section ? "a section of its own" : option.constraint, option.meaning});
  }
  return table_of({"key", "type", "default", "values", "meaning"}, rows);
}

std::string section_text(const OptionSection& section) {
  return section.name.empty() ? fmt::format("## Root\n\n{}\n\n{}", section.meaning, table_of(section.rows, ""))
                              : fmt::format("## {0}\n\n{1}\n\n{2}", section.name, section.meaning,
                                            table_of(section.rows, section.name + "."));
}

std::string plugin_text(const Host& host, const PluginRecord& plugin) {
  std::string text = fmt::format("## {} `{}`\n\n", word_of(plugin.kind), plugin.name);
  if (!plugin.capabilities.empty()) text += fmt::format("{}.\n\n", plugin.capabilities);
  const std::vector<OptionRow> options = host.options(plugin.kind, plugin.name);
  text += options.empty() ? "It has no options.\n" : table_of(options, "");
  return text;
}

constexpr const char* introduction = R"(# Configuration

Every key of a scenario, as `rhec options` prints it. A key of a section is written below the section's name in YAML, and
joined to it by a dot on the command line: `--set estimator.horizon=20`. A whole section is replaced by
`--set 'blocking.kappa={name: full_horizon}'`. The sections `path`, `terrain` and `vehicle`, and the keys `speed` and `seed`,
are those of a simulation (`rhec run`); `log` and `variants` are those of a recorded drive (`rhec estimate`); the others make a
robot (`rhec::Robot::from_file`). Unknown keys are errors.

Words in capitals stand for names: STATE, INPUT, PARAMETER and OUTPUT for each variable of the model of that kind. Where a key
names a plugin, the plugin's own options stand beside that name; they are listed behind the sections. Models are not, nor
solvers that are backed by another program, since not every installation has the same: `rhec plugins` lists all, and
`rhec plugins NAME` the options of one, with the variables of a model.
)";

std::string full_name(const OptionSection& section, const std::string& key) {
  return section.name.empty() ? key : section.name + "." + key;
}

/// Plugins of a name.
std::vector<PluginRecord> plugins_named(const Host& host, const std::string& name) {
  std::vector<PluginRecord> found = host.discover();
  std::erase_if(found, [&](const PluginRecord& plugin) {
    return !plugin.accepted() || plugin.name != name || !plugin.used_instead.empty();
  });
  return found;
}

/// The sections that a word names: one of that name, or those with a key of that name, by its full name or its own,
/// with its row alone. Throws Error, with the nearest name, which may be that of a plugin, if there is none.
std::vector<OptionSection> named(const std::vector<OptionSection>& sections, const std::string& word,
                                 const Host& host) {
  std::vector<OptionSection> found;
  std::vector<std::string> names, keys;
  for (const OptionSection& section : sections) {
    if (!section.name.empty() && section.name == word) return {section};
    if (!section.name.empty()) names.push_back(section.name);
    OptionSection with_key{section.name, section.meaning, {}};
    for (const OptionRow& row : section.rows) {
      keys.push_back(full_name(section, row.name));
      if (word == row.name || word == keys.back()) with_key.rows.push_back(row);
    }
    if (!with_key.rows.empty()) found.push_back(std::move(with_key));
  }
  if (!found.empty()) return found;
  std::vector<std::string> known = names;
  known.insert(known.end(), keys.begin(), keys.end());
  for (const PluginRecord& plugin : host.discover())
    if (plugin.accepted()) known.push_back(plugin.name);
  const std::string near = nearest(word, known);
  throw Error(fmt::format("there is no section, key or plugin '{}'; {}", word,
                          near.empty() ? fmt::format("expected a key or one of the sections {}", fmt::join(names, ", "))
                                       : fmt::format("did you mean '{}'?", near)));
}

/// A section with all its text, or the rows of keys alone.
std::string text_of(const std::vector<OptionSection>& found, const std::string& word) {
  if (found.size() == 1 && found.front().name == word) return section_text(found.front());
  std::string text;
  for (const OptionSection& section : found)
    text += (text.empty() ? "" : "\n") + table_of(section.rows, section.name.empty() ? "" : section.name + ".");
  return text;
}

sim::Json json_of(const std::vector<OptionRow>& rows) {
  sim::Json list = sim::Json::array();
  for (const OptionRow& row : rows)
    list.push_back({{"name", row.name},
                    {"type", row.type},
                    {"default", row.default_value},
                    {"constraint", row.constraint},
                    {"meaning", row.meaning}});
  return list;
}

sim::Json json_of(const std::vector<OptionSection>& sections) {
  sim::Json list = sim::Json::array();
  for (const OptionSection& section : sections)
    list.push_back({{"section", section.name}, {"meaning", section.meaning}, {"keys", json_of(section.rows)}});
  return list;
}

sim::Json json_of(const Host& host, const std::vector<PluginRecord>& plugins) {
  sim::Json list = sim::Json::array();
  for (const PluginRecord& plugin : plugins)
    list.push_back({{"kind", std::string(word_of(plugin.kind))},
                    {"name", plugin.name},
                    {"options", json_of(host.options(plugin.kind, plugin.name))}});
  return list;
}

/// Plugins whose options every installation has.
std::vector<PluginRecord> listed_plugins(const Host& host) {
  std::vector<PluginRecord> plugins = host.discover();
  std::erase_if(plugins, [](const PluginRecord& plugin) {
    return !plugin.accepted() || plugin.kind == PluginKind::model || !plugin.backend.empty();
  });
  std::sort(plugins.begin(), plugins.end(), [](const PluginRecord& a, const PluginRecord& b) {
    return a.kind != b.kind ? a.kind < b.kind : a.name < b.name;
  });
  return plugins;
}

int show(const OptionsArguments& arguments) {
  const std::vector<OptionSection> sections = option_sections();
  const Host host = examined_host(arguments.plugin_path);
  if (const auto plugins = plugins_named(host, arguments.section); !plugins.empty()) {
    if (arguments.json) {
      fmt::print("{}\n", json_of(host, plugins).dump(2));
    } else {
      for (const PluginRecord& plugin : plugins) fmt::print("{}", plugin_text(host, plugin));
    }
    return exit_fine;
  }
  if (!arguments.section.empty()) {
    const std::vector<OptionSection> found = named(sections, arguments.section, host);
    fmt::print("{}", arguments.json ? json_of(found).dump(2) + "\n" : text_of(found, arguments.section));
    return exit_fine;
  }
  if (arguments.json) {
    fmt::print("{}\n",
               sim::Json({{"sections", json_of(sections)}, {"plugins", json_of(host, listed_plugins(host))}}).dump(2));
    return exit_fine;
  }
  std::string text = introduction;
  for (const OptionSection& section : sections) text += "\n" + section_text(section);
  for (const PluginRecord& plugin : listed_plugins(host)) text += "\n" + plugin_text(host, plugin);
  fmt::print("{}", text);
  return exit_fine;
}

}  // namespace

std::vector<OptionSection> option_sections() {
  std::vector<OptionSection> sections = sim::scenario_sections();
  for (OptionSection& section : sim::log_sections()) sections.push_back(std::move(section));
  for (OptionSection& section : logs::signal_sections()) sections.push_back(std::move(section));
  for (OptionSection& section : ros::ros_sections()) sections.push_back(std::move(section));
  return sections;
}

void add_options(Program& program) {
  auto arguments = std::make_shared<OptionsArguments>();
  Command command = program.add("options", "Lists every key of a scenario with its default, as Markdown.",
                                "Examples:\n"
                                "  rhec options\n"
                                "  rhec options estimator\n"
                                "  rhec options estimator.horizon\n"
                                "  rhec options structured",
                                [arguments] { return show(*arguments); });
  command.add("section", arguments->section, "show this section, key or plugin alone").value("SECTION");
  add_json(command, arguments->json);
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
