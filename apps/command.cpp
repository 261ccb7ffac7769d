#include "command.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string_view>
#include <utility>

#include "commands.hpp"
#include "rhec/core/config/option_values.hpp"

namespace rhec::apps {
namespace {

/// CLI's own says what the largest number is that a computer knows.
CLI::Validator number_check(const char* expected, bool (*holds)(double)) {
  return {[=](const std::string& text) {
            double value = 0.0;
            const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
            const bool is_number = failure == std::errc() && end == text.data() + text.size();
            return is_number && holds(value) && std::isfinite(value)
                       ? std::string()
                       : fmt::format("found '{}', expected a number {}", text, expected);
          },
          ""};
}

}  // namespace

Argument& Argument::required() {
  option_->required();
  return *this;
}
Argument& Argument::value(const std::string& word) {
  option_->type_name(word);
  return *this;
}
Argument& Argument::shows_default() {
  option_->capture_default_str();
  return *this;
}
Argument& Argument::within(int lowest, int highest) {
  option_->check(CLI::Range(lowest, highest));
  return *this;
}
Argument& Argument::positive() {
  option_->check(number_check("above 0", [](double value) { return value > 0.0; }));
  return *this;
}
Argument& Argument::not_negative() {
  option_->check(number_check("at least 0", [](double value) { return value >= 0.0; }));
  return *this;
}
Argument& Argument::needs(const Argument& other) {
  option_->needs(other.option_);
  return *this;
}

template <class Variable>
Argument Command::add(const std::string& names, Variable& variable, const std::string& meaning) {
  return Argument(app_->add_option(names, variable, meaning));
}
template Argument Command::add(const std::string&, int&, const std::string&);
template Argument Command::add(const std::string&, double&, const std::string&);
template Argument Command::add(const std::string&, std::optional<double>&, const std::string&);
template Argument Command::add(const std::string&, std::string&, const std::string&);
template Argument Command::add(const std::string&, std::optional<std::string>&, const std::string&);
template Argument Command::add(const std::string&, std::vector<std::string>&, const std::string&);

namespace {
CLI::Option* one_value_each_time(CLI::Option* option) {
  return option->expected(1)->allow_extra_args(false)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}
}  // namespace

Argument Command::add_list(const std::string& name, std::vector<std::string>& values, const std::string& meaning) {
  return Argument(one_value_each_time(app_->add_option(name, values, meaning)));
}
Argument Command::add_list(const std::string& name, const std::function<void(const std::vector<std::string>&)>& take,
                           const std::string& meaning) {
  return Argument(one_value_each_time(app_->add_option_function<std::vector<std::string>>(name, take, meaning)));
}
Argument Command::add_flag(const std::string& name, bool& variable, const std::string& meaning) {
  return Argument(app_->add_flag(name, variable, meaning));
}
Argument Command::add_optional(const std::string& name, std::optional<std::string>& value, const std::string& meaning) {
  const auto take = [&value](const std::vector<std::string>& given) {
    value = given.empty() ? std::string() : given.front();
  };
  return Argument(app_->add_option_function<std::vector<std::string>>(name, take, meaning)->expected(0, 1));
}

Program::Program(const std::string& about, const std::string& examples, std::string first_steps,
                 std::function<std::string()> version)
    : app_(std::make_unique<CLI::App>(about, "rhec")), first_steps_(std::move(first_steps)) {
  app_->set_version_flag("--version", std::move(version), "Show the version, and what this program was built with");
  app_->require_subcommand(1);
  app_->footer(examples);
}
Program::~Program() = default;

Command Program::add(const std::string& name, const std::string& about, const std::string& notes, Action action) {
  CLI::App* command = app_->add_subcommand(name, about);
  command->footer(notes);
  command->callback([this, action = std::move(action)] { chosen_ = action; });
  return Command(command);
}

std::vector<CommandDescription> Program::commands() const {
  std::vector<CommandDescription> all;
  for (const CLI::App* command : std::as_const(*app_).get_subcommands([](const CLI::App*) { return true; })) {
    all.push_back({command->get_name(), command->get_description(), {}, {}});
    for (const CLI::Option* option : command->get_options()) {
      CommandDescription::Option one{
          {}, option->get_description(), option->get_items_expected_max() > 0, option->get_type_name()};
      for (const std::string& name : option->get_snames()) one.names.push_back("-" + name);
      for (const std::string& name : option->get_lnames()) one.names.push_back("--" + name);
      const bool is_placed = one.names.empty();
      if (is_placed) one.names.push_back(option->get_name());
      (is_placed ? all.back().places : all.back().options).push_back(std::move(one));
    }
  }
  return all;
}

std::string Program::wrong_command(const std::string& word) const {
  std::vector<std::string> commands;
  for (const CLI::App* command : std::as_const(*app_).get_subcommands([](const CLI::App*) { return true; }))
    commands.push_back(command->get_name());
  const std::string expected = fmt::format("expected one of {}; see 'rhec --help'", fmt::join(commands, ", "));
  if (word == "-h" || word == "--help" || word == "--version") return {};
  if (word.starts_with('-')) return fmt::format("unknown option '{}'; {}", word, expected);
  if (std::find(commands.begin(), commands.end(), word) != commands.end()) return {};
  const std::string near = nearest(word, commands);
  return fmt::format("unknown command '{}'; {}", word,
                     near.empty() ? expected : fmt::format("did you mean '{}'?", near));
}

namespace {

/// An option of a command that does not have it, or a word too many.
std::string unexpected(const CLI::App& command) {
  const std::vector<std::string> words = command.remaining();
  const auto option = std::ranges::find_if(words, [](const std::string& word) { return word.starts_with('-'); });
  if (option == words.end()) return fmt::format("found '{}', which nothing takes", fmt::join(words, " "));
  std::vector<std::string> known;
  for (const CLI::Option* each : command.get_options())
    for (const std::string& name : each->get_lnames()) known.push_back("--" + name);
  const std::string name = option->substr(0, option->find('=')), near = nearest(name, known);
  return fmt::format("there is no option '{}'{}", name, near.empty() ? "" : fmt::format("; did you mean '{}'?", near));
}

}  // namespace

int Program::run(int count, char** words) {
  const auto usage_error = [](std::string_view what) {
    fmt::print(stderr, "rhec: error: {}\n", what);
    return exit_usage;
  };
  if (count < 2) {
    fmt::print("{}", first_steps_);
    return exit_fine;
  }
  if (const std::string problem = wrong_command(words[1]); !problem.empty()) return usage_error(problem);
  try {
    app_->parse(count, words);
  } catch (const CLI::ExtrasError& end) {
    const auto called = app_->get_subcommands();
    if (called.empty()) return usage_error(fmt::format("{}; see 'rhec --help'", end.what()));
    return usage_error(
        fmt::format("{}; see 'rhec {} --help'", unexpected(*called.front()), called.front()->get_name()));
  } catch (const CLI::ParseError& end) {
    if (end.get_exit_code() == 0) return app_->exit(end);  // --help, --version
    const auto called = app_->get_subcommands();
    return usage_error(
        fmt::format("{}; see 'rhec {}--help'", end.what(), called.empty() ? "" : called.front()->get_name() + " "));
  }
  return chosen_();
}

}  // namespace rhec::apps
