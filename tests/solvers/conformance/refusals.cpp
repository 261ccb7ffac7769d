#include "refusals.hpp"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <fstream>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::conformance {
namespace {

const std::string file = RHEC_SOLVERS_DOCUMENT;

std::string trimmed(const std::string& text, const char* away) {
  const std::size_t first = text.find_first_not_of(away);
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(away) - first + 1);
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::size_t begin = line.find('|') + 1;
  for (std::size_t end = line.find('|', begin); end != std::string::npos; begin = end + 1, end = line.find('|', begin))
    cells.push_back(trimmed(line.substr(begin, end - begin), " `"));
  return cells;
}

Documentation read() {
  std::ifstream in(file);
  if (!in) throw Error(file + ": cannot be read; it says what solvers may refuse");
  Documentation result;
  bool in_refusals = false;
  int row = 0, number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    if (line.rfind("## ", 0) == 0) {
      in_refusals = line == "## Refusals";
      if (line.rfind("## `", 0) == 0) result.solvers.push_back(line.substr(4, line.find('`', 4) - 4));
      continue;
    }
    if (!in_refusals || line.rfind('|', 0) != 0) continue;
    // The first two rows are the head.
    if (++row <= 2) continue;
    const std::vector<std::string> cells = cells_of(line);
    if (cells.size() != 5)
      throw Error(fmt::format("{}:{}: {} columns; expected solver, options, problem, words, reason", file, number,
                              cells.size()));
    const std::string origin = fmt::format("{}:{}", file, number);
    AllowedRefusal refusal{number, cells[0], Settings::map(), cells[2], cells[3]};
    if (cells[1] != "default") refusal.options = parse_yaml("{" + cells[1] + "}", origin);
    if (refusal.words.empty() || cells[4].empty()) throw Error(origin + ": a refusal needs its words and its reason");
    result.refusals.push_back(std::move(refusal));
  }
  if (row < 2) throw Error(file + ": no table under the heading '## Refusals'");
  return result;
}

}  // namespace

bool Documentation::knows(const std::string& solver) const {
  return std::find(solvers.begin(), solvers.end(), solver) != solvers.end();
}

const Documentation& documentation() {
  static const Documentation one = read();
  return one;
}

std::string problem_name(const std::string& family, const std::string& model) { return family + " on " + model; }

bool covers(const AllowedRefusal& refusal, const std::string& solver, const std::string& problem) {
  return refusal.solver == solver && fnmatch(refusal.problem.c_str(), problem.c_str(), 0) == 0;
}

}  // namespace rhec::conformance
