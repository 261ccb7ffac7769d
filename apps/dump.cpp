#include "dump.hpp"

#include <fmt/format.h>

#include <string>
#include <string_view>

namespace rhec::apps {
namespace {

/// The text as a shell word, quoted if necessary.
std::string as_shell_word(const std::string& text) {
  constexpr std::string_view plain = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_./-+=:,@%";
  if (!text.empty() && text.find_first_not_of(plain) == std::string::npos) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

}  // namespace

void add_dump(Command& command, DumpArguments& arguments) {
  const Argument folder =
      command
          .add("--dump", arguments.folder,
               "save every problem whose solve failed there, for 'rhec solve', in rhe.jsonl and rhc.jsonl")
          .value("DIR");
  command.add("--dump-every", arguments.every, "save those of every N-th step too")
      .value("N")
      .within(1, 1000000)
      .needs(folder);
}

Dump::Dump(const DumpArguments& arguments, const std::vector<std::string>& kinds) {
  if (arguments.folder) dump_.emplace(*arguments.folder, kinds, arguments.every);
}

decltype(sim::LoopHooks::solved) Dump::watch(const std::string& run, const Robot& robot) {
  if (!dump_) return {};
  return dump_->watch(run, robot);
}

void Dump::commit() {
  if (dump_) dump_->commit();
}

void Dump::tell(const std::vector<std::filesystem::path>& plugin_path) const {
  if (!dump_) return;
  std::string places;
  for (const auto& place : plugin_path) places += fmt::format(" --plugin-path {}", as_shell_word(place.string()));
  for (const sim::ProblemDump::File& file : dump_->files()) {
    fmt::print("problems: {} ({})\n", file.path.string(), file.problems);
    for (const std::string& solver : file.solvers)
      fmt::print("  again as they were: rhec solve {} {}{}\n", as_shell_word(file.path.string()), solver, places);
  }
}

}  // namespace rhec::apps
