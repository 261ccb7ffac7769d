#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "completion_words.hpp"
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

/// Bash takes "=" and ":" for words of their own: the line is put together again, and what is offered loses what stands
/// before the last of them.
constexpr const char* bash_values = R"(  local -a line=() found=()
  local i files each
  for ((i = 0; i <= COMP_CWORD; i++)); do
    if ((i > 2)) && [[ ${COMP_WORDS[i]} == [=:] || ${line[-1]} == *[=:] ]]; then
      line[-1]+="${COMP_WORDS[i]}"
    else
      line+=("${COMP_WORDS[i]}")
    fi
  done
  word="${line[-1]}"
  mapfile -t found < <("${line[0]}" completion --line -- "${line[@]}" 2>/dev/null)
  files="${found[0]}"
  COMPREPLY=("${found[@]:1}")
  if [[ $word == *[=:]* ]]; then
    COMPREPLY=("${COMPREPLY[@]#"${word%"${word##*[=:]}"}"}")
  fi
  for each in "${COMPREPLY[@]}"; do
    if [[ $each == *[.=,] ]]; then compopt -o nospace 2>/dev/null; fi
  done
  if [[ $files != none ]]; then
    compopt -o filenames 2>/dev/null
    while read -r each; do
      if [[ -d $each || $files == all || ($files == yaml && $each == *.y?(a)ml) ]]; then COMPREPLY+=("$each"); fi
    done < <(compgen -f -- "$word")
  fi
)";

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
      "    return\n"
      "  fi\n"
      "{}"
      "}}\n"
      "complete -F _rhec rhec\n",
      fmt::join(names_of(commands), " "), cases, bash_values);
}

/// Of `words`, which _rhec has shifted, the line is made again.
constexpr const char* zsh_values = R"(_rhec_value() {
  local -a found=("${(@f)$(rhec completion --line -- rhec "${(@)words[1,CURRENT]}" 2>/dev/null)}")
  local files="$found[1]"
  local -a open=(${(M)${(@)found[2,-1]}:#*[.=,]}) closed=(${(@)found[2,-1]:#*[.=,]})
  compadd -Q -S '' -a open
  compadd -Q -a closed
  case "$files" in
    folders) _files -/ ;;
    yaml) _files -g '*.(yaml|yml)' ;;
    all) _files ;;
  esac
}
)";

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
                                                      option.takes_value ? ":value:_rhec_value" : ""));
    cases += " \\\n        '*:value:_rhec_value' ;;\n";
  }
  return fmt::format(
      "#compdef rhec\n"
      "# Completion of rhec for zsh: source <(rhec completion zsh)\n"
      "{}"
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
      zsh_values, list, cases);
}

/// A value of an option stands behind it; what is given by its place may be a word or a file.
constexpr const char* fish_values = R"(function __rhec_values
  set -l found (rhec completion --line -- (commandline -opc) (commandline -ct) 2>/dev/null)
  for each in $found[2..]
    echo $each
  end
  switch "$found[1]"
    case folders
      __fish_complete_directories (commandline -ct) ''
    case yaml
      __fish_complete_suffix .yaml
    case all
      __fish_complete_path (commandline -ct)
  end
end
complete -c rhec -f
complete -c rhec -n 'not __fish_use_subcommand' -a '(__rhec_values)'
)";

std::string fish_script(const std::vector<CommandDescription>& commands) {
  std::string text = "# Completion of rhec for fish: rhec completion fish | source\n";
  text += fish_values;
  for (const CommandDescription& command : commands) {
    text += fmt::format("complete -c rhec -n __fish_use_subcommand -a {} -d {}\n", command.name, quoted(command.about));
    for (const CommandDescription::Option& option : command.options) {
      text += fmt::format("complete -c rhec -n '__fish_seen_subcommand_from {}'", command.name);
      for (const std::string& name : option.names)
        text += name.starts_with("--") ? fmt::format(" -l {}", name.substr(2)) : fmt::format(" -s {}", name.substr(1));
      text += fmt::format("{} -d {}\n", option.takes_value ? " -x -a '(__rhec_values)'" : "", quoted(option.meaning));
    }
  }
  return text;
}

struct CompletionArguments {
  std::vector<std::string> words;
  bool line = false;
};

/// For the scripts: the first line says which files, each other one is a word.
void print_words(const Completion& completion) {
  constexpr std::array files{"none", "folders", "yaml", "all"};
  fmt::print("{}\n", files.at(static_cast<std::size_t>(completion.files)));
  for (const std::string& word : completion.words) fmt::print("{}\n", word);
}

int print_completion(const Program& program, const CompletionArguments& arguments) {
  const std::vector<std::string> known{"bash", "zsh", "fish"};
  const std::vector<CommandDescription> commands = program.commands();
  if (arguments.line) {
    print_words(complete(commands, arguments.words));
    return exit_fine;
  }
  if (arguments.words.size() > 1)
    throw Error(fmt::format("found {} words, expected one shell: {}", arguments.words.size(), fmt::join(known, ", ")));
  const std::string& shell = arguments.words.front();
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
  auto arguments = std::make_shared<CompletionArguments>();
  Command command =
      program.add("completion", "Prints a script that completes commands, options, keys, plugins and files in a shell.",
                  "Examples:\n"
                  "  source <(rhec completion bash)        in ~/.bashrc\n"
                  "  source <(rhec completion zsh)         in ~/.zshrc, after compinit\n"
                  "  rhec completion fish | source         in ~/.config/fish/config.fish",
                  [arguments, &program] { return print_completion(program, *arguments); });
  command.add("shell", arguments->words, "bash, zsh or fish").value("SHELL").required();
  command.add_flag("--line", arguments->line,
                   "for these scripts: the words behind -- are those of a line up to the cursor; print which files its "
                   "last word can be (none, folders, yaml, all), and the words that it can become");
}

}  // namespace rhec::apps
