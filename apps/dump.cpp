#include "dump.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

namespace rhec::apps {

void add_dump(CLI::App& command, DumpArguments& arguments) {
  auto* folder =
      command
          .add_option("--dump", arguments.folder,
                      "save every problem whose solve failed there, for 'rhec solve', in rhe.jsonl and rhc.jsonl")
          ->type_name("DIR");
  command.add_option("--dump-every", arguments.every, "save those of every N-th step too")
      ->type_name("N")
      ->check(CLI::Range(1, 1000000))
      ->needs(folder);
}

Dump::Dump(const DumpArguments& arguments, const std::vector<OcpKind>& kinds) {
  if (arguments.folder) dump_.emplace(*arguments.folder, kinds, arguments.every);
}

decltype(sim::LoopHooks::solved) Dump::watch(const std::string& run, const Robot& robot) {
  if (!dump_) return {};
  return dump_->watch(run, robot);
}

void Dump::commit() {
  if (dump_) dump_->commit();
}

void Dump::tell() const {
  if (!dump_) return;
  for (const sim::ProblemDump::File& file : dump_->files()) {
    fmt::print("problems: {} ({})\n", file.path.string(), file.problems);
    for (const std::string& solver : file.solvers)
      fmt::print("  again as they were: rhec solve {} {}\n", file.path.string(), solver);
  }
}

}  // namespace rhec::apps
