#include "completion_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "commands.hpp"
#include "crash_report.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/model_section.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"

namespace rhec::apps {
namespace {

using Words = std::vector<std::string>;
using Files = Completion::Files;

bool is_yaml(const std::string& word) { return word.ends_with(".yaml") || word.ends_with(".yml"); }

/// A command line taken apart: its command, what its options are given, and what stands by its place.
struct Line {
  const CommandDescription* command = nullptr;
  std::vector<std::pair<const CommandDescription::Option*, std::string>> options;
  Words placed;
  const CommandDescription::Option* open = nullptr;  ///< the option whose value the last word is
  std::string word;                                  ///< the last one

  Words values_of(std::string_view name) const {
    Words values;
    for (const auto& [option, value] : options)
      if (std::find(option->names.begin(), option->names.end(), name) != option->names.end()) values.push_back(value);
    return values;
  }
};

Line parse(const std::vector<CommandDescription>& commands, const Words& words) {
  Line line;
  if (words.size() < 3) return line;
  const auto command = std::find_if(commands.begin(), commands.end(),
                                    [&](const CommandDescription& one) { return one.name == words[1]; });
  if (command == commands.end()) return line;
  line.command = &*command;
  line.word = words.back();
  for (std::size_t i = 2; i + 1 < words.size(); ++i) {
    const CommandDescription::Option* option = nullptr;
    for (const CommandDescription::Option& one : command->options)
      if (std::find(one.names.begin(), one.names.end(), words[i]) != one.names.end()) option = &one;
    if (!option) {
      if (!words[i].starts_with('-')) line.placed.push_back(words[i]);
    } else if (option->takes_value) {
      if (i + 2 == words.size()) {
        line.open = option;
      } else {
        line.options.emplace_back(option, words[++i]);
      }
    }
  }
  return line;
}

/// The words that a key's part in capitals stands for, such as OUTPUT, by what a model has.
struct Variables {
  std::array<std::pair<std::string_view, Words>, 4> kinds;

  explicit Variables(const Model* model) : kinds{{{"OUTPUT", {}}, {"INPUT", {}}, {"STATE", {}}, {"PARAMETER", {}}}} {
    if (!model) return;
    const ModelDescription& about = model->description();
    const std::array variables{&about.outputs, &about.inputs, &about.states, &about.parameters};
    for (std::size_t i = 0; i < kinds.size(); ++i)
      for (const Variable& variable : *variables[i]) kinds[i].second.push_back(variable.name);
  }
};

bool has_capitals(std::string_view part) {
  const auto is_capital = [](char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; };
  return std::count_if(part.begin(), part.end(), is_capital) > 1;
}

/// A key with names in the place of its capitals: noise.outputs.x_gps, noise.outputs.y_gps; where these are not known,
/// as far as them: noise.outputs.
Words named(const std::string& key, const Variables& variables) {
  for (std::size_t begin = 0; begin < key.size();) {
    const std::size_t end = std::min(key.find('.', begin), key.size());
    const std::string part = key.substr(begin, end - begin);
    if (has_capitals(part)) {
      Words found;
      for (const auto& [capitals, names] : variables.kinds) {
        // "STATE, INPUT or PARAMETER" stands for each of them, "STATE_noise" for a word that goes on.
        const std::size_t at = part.find(capitals);
        if (at == std::string::npos) continue;
        const std::size_t after = std::min(part.find_first_of(", ", at), part.size());
        const std::string rest = part.substr(at + capitals.size(), after - at - capitals.size());
        for (const std::string& name : names)
          for (std::string& whole :
               named(fmt::format("{}{}{}{}", key.substr(0, begin), name, rest, key.substr(end)), variables))
            found.push_back(std::move(whole));
      }
      if (found.empty()) found.push_back(key.substr(0, begin));
      return found;
    }
    begin = end + 1;
  }
  return {key};
}

/// Keys, each with the row that says what it may be.
using Keys = std::vector<std::pair<std::string, OptionRow>>;

/// What a line is about: its plugins, and the scenario or the plugin that it names.
class Subject {
 public:
  explicit Subject(const Line& line) : host_(examined_host(folders(line))) {
    // Of `check` it is a further model, on which a term is looked at.
    const Words files = line.command->name == "check" ? Words() : line.values_of("--vehicle");
    const std::string name = !files.empty() ? files.front() : line.placed.empty() ? "" : line.placed.front();
    const Words solvers = line.values_of("--solver");
    plugin_ = !solvers.empty() ? solvers.front() : name;
    if (!is_yaml(name)) return;
    try {
      scenario_ = load_scenario(name);
      for (const std::string& assignment : line.values_of("--set")) apply_assignments(scenario_, {assignment});
      if (scenario_.find("model")) model_ = ModelSection(host_, *scenario_.find("model")).model();
    } catch (const Error&) {  // a line that is not whole yet; its command will tell what is wrong
      model_ = nullptr;
    }
  }

  Words plugins(std::optional<PluginKind> kind) const {
    Words names;
    for (const PluginRecord& plugin : host_.discover())
      if (plugin.accepted() && (!kind || plugin.kind == *kind)) names.push_back(plugin.name);
    return names;
  }

  /// Those of a plugin, if the line is about one; else those of a scenario.
  Keys keys() const {
    Keys keys;
    for (const PluginRecord& plugin : host_.discover())
      if (plugin.accepted() && plugin.name == plugin_) add(host_.options(plugin.kind, plugin.name), "", keys);
    if (!keys.empty()) return keys;
    const Variables variables(model_.get());
    for (const OptionSection& section : option_sections()) {
      for (const OptionRow& row : section.rows) {
        for (const std::string& key :
             named(section.name.empty() ? row.name : section.name + "." + row.name, variables)) {
          keys.emplace_back(key, row);
          add_options_of_plugin(key, row, keys);
        }
      }
    }
    return keys;
  }

  Words values(const std::string& key) const {
    for (const auto& [name, row] : keys()) {
      if (name != key) continue;
      if (const auto kind = kind_of(row)) return plugins(*kind);
      if (row.type == "flag") return {"true", "false"};
      constexpr std::string_view choice = "one of ";
      if (!row.constraint.starts_with(choice)) return {};
      return split(row.constraint.substr(choice.size()));
    }
    return {};
  }

 private:
  static std::vector<std::filesystem::path> folders(const Line& line) {
    std::vector<std::filesystem::path> found;
    for (const std::string& folder : line.values_of("--plugin-path"))
      if (std::filesystem::is_directory(folder)) found.emplace_back(folder);
    return found;
  }

  static Words split(const std::string& list) {
    Words words;
    for (std::size_t begin = 0; begin <= list.size();) {
      const std::size_t end = std::min(list.find(", ", begin), list.size());
      words.push_back(list.substr(begin, end - begin));
      begin = end + 2;
    }
    return words;
  }

  static void add(const std::vector<OptionRow>& rows, const std::string& prefix, Keys& keys) {
    for (const OptionRow& row : rows)
      for (const std::string& key : named(prefix + row.name, Variables(nullptr))) keys.emplace_back(key, row);
  }

  /// Of a key that names a plugin: "a solver plugin".
  static std::optional<PluginKind> kind_of(const OptionRow& row) {
    for (const PluginKind kind :
         {PluginKind::model, PluginKind::blocking, PluginKind::solver, PluginKind::prior, PluginKind::term})
      if (row.constraint == "a " + std::string(word_of(kind)) + " plugin") return kind;
    return std::nullopt;
  }

  /// Options of a plugin stand beside its name.
  void add_options_of_plugin(const std::string& key, const OptionRow& row, Keys& keys) const {
    constexpr std::string_view last = ".name";
    const auto kind = kind_of(row);
    if (!kind || !key.ends_with(last)) return;
    const std::string section = key.substr(0, key.size() - last.size());
    const Settings* given = scenario_.find_path(key);
    if (!given) given = scenario_.find_path(section);
    const std::string name = given && !given->text().empty() ? given->text() : row.default_value;
    const Words known = plugins(*kind);
    if (std::find(known.begin(), known.end(), name) != known.end())
      add(host_.options(*kind, name), section + ".", keys);
  }

  Host host_;
  std::string plugin_;
  Settings scenario_;
  std::shared_ptr<const Model> model_;
};

Words with_prefix(const std::string& prefix, Words words) {
  for (std::string& word : words) word.insert(0, prefix);
  return words;
}

/// KEY=VALUE, or a key alone.
Words assignments(const Subject& subject, const std::string& word, bool has_value) {
  const std::size_t equals = word.find('=');
  if (equals != std::string::npos)
    return with_prefix(word.substr(0, equals + 1), subject.values(word.substr(0, equals)));
  Words words;
  for (const auto& [key, row] : subject.keys()) words.push_back(key.ends_with('.') || !has_value ? key : key + "=");
  return words;
}

/// A list with commas: what is there stays.
Words listed(const std::string& word, const Words& names) {
  const std::size_t comma = word.rfind(',');
  return comma == std::string::npos ? names : with_prefix(word.substr(0, comma + 1), names);
}

Completion completion_of(const Line& line, const CommandDescription::Option& argument) {
  const std::string& name = argument.names.front();
  const bool is_option = line.open != nullptr;
  const auto is = [&](std::initializer_list<std::string_view> names) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  if (is({"--set", "--case"})) return {Files::none, assignments(Subject(line), line.word, true)};
  if (is({"--tune", "--keep"})) return {Files::none, assignments(Subject(line), line.word, false)};
  if (!is_option && line.command->name == "check") {
    const Subject subject(line);
    Words names = subject.plugins(PluginKind::model);
    for (std::string& term : subject.plugins(PluginKind::term)) names.push_back(std::move(term));
    return {Files::yaml, std::move(names)};
  }
  if (is({"--vehicle", "model"})) return {Files::yaml, Subject(line).plugins(PluginKind::model)};
  if (is({"--solver", "--drive"})) return {Files::none, Subject(line).plugins(PluginKind::solver)};
  if (is({"--solvers"})) return {Files::none, listed(line.word, Subject(line).plugins(PluginKind::solver))};
  if (!is_option && line.command->name == "plugins") return {Files::yaml, Subject(line).plugins(std::nullopt)};
  if (is({"shell"})) return {Files::none, {"bash", "zsh", "fish"}};
  if (is({"section"})) {
    Words words;
    for (const OptionSection& section : option_sections()) {
      if (!section.name.empty()) words.push_back(section.name);
      for (const OptionRow& row : section.rows)
        if (!has_capitals(row.name)) words.push_back(section.name.empty() ? row.name : section.name + "." + row.name);
    }
    return {Files::none, std::move(words)};
  }
  if (is({"scenario", "sweep", "file"})) return {Files::yaml, {}};
  if (argument.value == "DIR" || argument.value.find("FOLDER") != std::string::npos) return {Files::folders, {}};
  const bool takes_file = !is_option || argument.value.find("FILE") != std::string::npos || is({"-o", "--out"});
  return {takes_file ? Files::all : Files::none, {}};
}

}  // namespace

Completion complete(const std::vector<CommandDescription>& commands, const std::vector<std::string>& words) {
  const Line line = parse(commands, words);
  if (!line.command) return {};
  Completion made;
  if (line.open) {
    made = completion_of(line, *line.open);
  } else if (!line.command->places.empty()) {
    // The last place may take several words.
    const std::vector<CommandDescription::Option>& places = line.command->places;
    made = completion_of(line, places[std::min(line.placed.size(), places.size() - 1)]);
  }
  std::erase_if(made.words, [&](const std::string& word) { return !word.starts_with(line.word); });
  std::sort(made.words.begin(), made.words.end());
  made.words.erase(std::unique(made.words.begin(), made.words.end()), made.words.end());
  return made;
}

}  // namespace rhec::apps
