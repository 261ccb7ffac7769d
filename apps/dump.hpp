#pragma once

#include <optional>
#include <string>
#include <vector>

#include "command.hpp"
#include "rhec/sim/problems/problem_dump.hpp"

namespace rhec::apps {

struct DumpArguments {
  std::optional<std::string> folder;  ///< none: nothing is saved
  int every = 0;
};

/// `--dump DIR` and `--dump-every N`.
void add_dump(Command& command, DumpArguments& arguments);

/// Saves the problems that a command solves, if requested.
class Dump {
 public:
  Dump(const DumpArguments& arguments, const std::vector<std::string>& kinds);

  decltype(sim::LoopHooks::solved) watch(const std::string& run, const Robot& robot);
  void commit();
  /// Prints what was saved, and how to replay it with the same plugin directories.
  void tell(const std::vector<std::filesystem::path>& plugin_path) const;

 private:
  std::optional<sim::ProblemDump> dump_;
};

}  // namespace rhec::apps
