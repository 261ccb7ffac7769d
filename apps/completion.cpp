#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"

namespace rhec::apps {
namespace {

/// In single quotes of a shell.
std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

std::vector<std::string> names_of(const std::vector<CommandDescription>& commands) {
  std::vector<std::string> names;
  names.reserve(commands.size());
  for (const CommandDescription& command : commands) names.push_back(command.name);
  return names;
}

std::vector<std::string> words_of(const CommandDescription& command) {
  std::vector<std::string> words;
  for (const CommandDescription::Option& option : command.options)
    words.insert(words.end(), option.names.begin(), option.names.end());
  return words;
}

/// What does not begin with a dash is a file, as far as a shell knows.
std::string bash_script(const std::vector<CommandDescription>& commands) {
  std::string cases;
  for (const CommandDescription& command : commands)
    cases += fmt::format("    {}) words='{}' ;;\n", command.name, fmt::join(words_of(command), " "));
  return fmt::format(
      "# Completion of rhec for bash: source <(rhec completion bash)\n"
      "_rhec() {{\n"
      "  local word=\"${{COMP_WORDS[COMP_CWORD]}}\" words=''\n"
      "  if ((COMP_CWORD == 1)); then\n"
      "    mapfile -t COMPREPLY < <(compgen -W '{} --help --version' -- \"$word\")\n"
      "    return\n"
      "  fi\n"
      "  case \"${{COMP_WORDS[1]}}\" in\n{}  esac\n"
      "  if [[ $word == -* ]]; then\n"
      "    mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$word\")\n"
      "  else\n"
      "    mapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
      "  fi\n"
      "}}\n"
      "complete -o filenames -o bashdefault -F _rhec rhec\n",
      fmt::join(names_of(commands), " "), cases);
}

/// A text within "[...]" of an _arguments specification.
std::string zsh_meaning(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') result += '\\';
    result += c;
  }
  return result;
}

std::string zsh_script(const std::vector<CommandDescription>& commands) {
  std::string list, cases;
  for (const CommandDescription& command : commands) {
    list += fmt::format("    {}\n", quoted(fmt::format("{}:{}", command.name, zsh_meaning(command.about))));
    cases += fmt::format("    {})\n      _arguments", command.name);
    for (const CommandDescription::Option& option : command.options)
      for (const std::string& name : option.names)
        cases += " \\\n        " + quoted(fmt::format("*{}[{}]{}", name, zsh_meaning(option.meaning),
                                                      option.takes_value ? ":value:_files" : ""));
    cases += " \\\n        '*:file:_files' ;;\n";
  }
  return fmt::format(
      "#compdef rhec\n"
      "# Completion of rhec for zsh: source <(rhec completion zsh)\n"
      "_rhec() {{\n"
      "  local -a commands=(\n{}  )\n"
      "  if ((CURRENT == 2)); then\n"
      "    _describe command commands\n"
      "    return\n"
      "  fi\n"
      "  local command=\"$words[2]\"\n"
      "  shift words\n"
      "  ((CURRENT--))\n"
      "  case \"$command\" in\n{}  esac\n"
      "}}\n"
      "compdef _rhec rhec\n",
      list, cases);
}

std::string fish_script(const std::vector<CommandDescription>& commands) {
  std::string text = "# Completion of rhec for fish: rhec completion fish | source\n";
  for (const CommandDescription& command : commands) {
    text += fmt::format("complete -c rhec -n __fish_use_subcommand -a {} -d {}\n", command.name, quoted(command.about));
    for (const CommandDescription::Option& option : command.options) {
      text += fmt::format("complete -c rhec -n '__fish_seen_subcommand_from {}'", command.name);
      for (const std::string& name : option.names)
        text += name.starts_with("--") ? fmt::format(" -l {}", name.substr(2)) : fmt::format(" -s {}", name.substr(1));
      text += fmt::format("{} -d {}\n", option.takes_value ? " -r" : "", quoted(option.meaning));
    }
  }
  return text;
}

int print_completion(const Program& program, const std::string& shell) {
  const std::vector<std::string> known{"bash", "zsh", "fish"};
  const std::vector<CommandDescription> commands = program.commands();
  if (shell == "bash") {
    fmt::print("{}", bash_script(commands));
  } else if (shell == "zsh") {
    fmt::print("{}", zsh_script(commands));
  } else if (shell == "fish") {
    fmt::print("{}", fish_script(commands));
  } else {
    const std::string near = nearest(shell, known);
    throw Error(fmt::format("there is no completion for '{}'; {}", shell,
                            near.empty() ? fmt::format("expected one of {}", fmt::join(known, ", "))
                                         : fmt::format("did you mean '{}'?", near)));
  }
  return exit_fine;
}

}  // namespace

void add_completion(Program& program) {
  auto shell = std::make_shared<std::string>();
  Command command = program.add("completion", "Prints a script that completes commands and options in a shell.",
                                "Examples:\n"
                                "  source <(rhec completion bash)        in ~/.bashrc\n"
                                "  source <(rhec completion zsh)         in ~/.zshrc, after compinit\n"
                                "  rhec completion fish | source         in ~/.config/fish/config.fish",
                                [shell, &program] { return print_completion(program, *shell); });
  command.add("shell", *shell, "bash, zsh or fish").value("SHELL").required();
}

}  // namespace rhec::apps
