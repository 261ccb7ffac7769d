#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

// What commands say of their arguments. The parsing is CLI11's; command.cpp alone includes it, since it takes long to
// compile.
namespace rhec::apps {

/// What to do once the command line has been read; returns an exit code.
using Action = std::function<int()>;

/// One argument of a command, to be described further.
class Argument {
 public:
  explicit Argument(CLI::Option* option) : option_(option) {}
  Argument& required();
  /// The word for its value in the help, e.g. FILE.
  Argument& value(const std::string& word);
  /// Shows the variable's value in the help, as the default.
  Argument& shows_default();
  /// Only from `lowest` to `highest`.
  Argument& within(int lowest, int highest);
  Argument& positive();
  Argument& not_negative();
  /// Only together with another one.
  Argument& needs(const Argument& other);

 private:
  CLI::Option* option_;
};

/// A command of the program. What its arguments are read into must outlive the program.
class Command {
 public:
  explicit Command(CLI::App* app) : app_(app) {}

  /// An argument that is read into `variable`: an int, a double, a std::string, a std::optional of the
  /// latter two, or a vector of texts, which takes several words.
  /// `names` are "-o,--out" for an option, "scenario" for what is given by its place.
  template <class Variable>
  Argument add(const std::string& names, Variable& variable, const std::string& meaning);
  /// An option that may be given several times, with one value each time.
  Argument add_list(const std::string& name, std::vector<std::string>& values, const std::string& meaning);
  /// The same; `take` is called with all of them, and throws Error for a wrong one.
  Argument add_list(const std::string& name, const std::function<void(const std::vector<std::string>&)>& take,
                    const std::string& meaning);
  Argument add_flag(const std::string& name, bool& variable, const std::string& meaning);
  /// An option whose value may be left out; it is empty then.
  Argument add_optional(const std::string& name, std::optional<std::string>& value, const std::string& meaning);

 private:
  CLI::App* app_;
};

/// What a command takes, for those who show it in other forms.
struct CommandDescription {
  struct Option {
    std::vector<std::string> names;  ///< with their dashes; of what is given by its place, its name
    std::string meaning;
    bool takes_value = false;
    std::string value;  ///< the word for its value in the help
  };
  std::string name, about;
  std::vector<Option> options;
  std::vector<Option> places;  ///< what is given by its place, in order
};

/// The program: one of its commands is called.
class Program {
 public:
  /// `first_steps` is what is printed where there is not even a command, `version` makes what `--version` prints.
  Program(const std::string& about, const std::string& examples, std::string first_steps,
          std::function<std::string()> version);
  ~Program();

  /// `notes` follow the help of the command's arguments.
  Command add(const std::string& name, const std::string& about, const std::string& notes, Action action);
  /// All commands, in the order in which they were added.
  std::vector<CommandDescription> commands() const;
  /// Reads the command line and calls its command's action, or prints help, the version, or what is wrong. Returns an
  /// exit code. Throws what the action throws.
  int run(int count, char** words);

 private:
  /// An error message if the command is unknown; otherwise empty.
  std::string wrong_command(const std::string& word) const;

  std::unique_ptr<CLI::App> app_;
  std::string first_steps_;
  Action chosen_;
};

}  // namespace rhec::apps
