#pragma once

#include <string>
#include <vector>

#include "command.hpp"

namespace rhec::apps {

/// What can stand where a command line is being written.
struct Completion {
  enum class Files { none, folders, yaml, all };
  Files files = Files::none;       ///< which of the shell's files can stand there, too
  std::vector<std::string> words;  ///< a word ending with '.', '=' or ',' goes on without a space
};

/// What the last word of `line` can become; the first one is the program's name. Plugins are those that are found, with
/// the line's `--plugin-path`; keys and their values those of the scenario or the plugin on the line. Options and
/// commands themselves are not among them, since a shell's script has these. What cannot be read has no words.
Completion complete(const std::vector<CommandDescription>& commands, const std::vector<std::string>& line);

}  // namespace rhec::apps
