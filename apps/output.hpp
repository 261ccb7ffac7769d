#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "command.hpp"

// Where results go, and what is printed of them: the same for all commands.
namespace rhec::apps {

/// `--out`, of a command whose results go to `out/NAME` or `out/NAME_COMMAND` where it is not given; `type` says
/// whether it takes a file or a folder.
void add_out(Command& command, std::string& out, const std::string& type, const std::string& meaning);
/// `--json`: results are printed as JSON, and nothing else on standard output.
void add_json(Command& command, bool& json);

/// Where results go. What is given; otherwise `out/` and the name of the file that the results are of, with `suffix`:
/// out/figure8 of scenarios/figure8.yaml, out/figure8_compare with "_compare".
std::filesystem::path out_of(const std::string& given, const std::filesystem::path& source, const std::string& suffix);

/// Prints a JSON document, with the place of the results as its last key, `out`.
void print_json(const std::string& document, const std::filesystem::path& out);
/// Prints what a configuration makes one wonder about, on standard error.
void tell_notes(const std::vector<std::string>& notes);

}  // namespace rhec::apps
