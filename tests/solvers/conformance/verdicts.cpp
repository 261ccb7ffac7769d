#include "verdicts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "assessment.hpp"

namespace rhec::conformance {
namespace {

// Objectives that are this near to each other, relative, are of the same optimum.
constexpr double same_objective = 1e-7;
// An objective of all but zero is compared absolutely.
constexpr double smallest_objective = 1e-3;

const std::string extension = ".verdicts";

double number(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size())
    throw std::runtime_error("kept verdicts: '" + text + "' is no number");
  return value;
}

void write(std::ostream& out, const Verdict& v) {
  std::string reason = v.reason;
  std::replace(reason.begin(), reason.end(), '\n', ' ');
  out << "solver " << v.solver << "\nmodel " << v.model << "\nfamily " << v.family << "\nseveral_optima "
      << v.several_optima << "\nseed " << v.seed << "\noutcome " << v.outcome << "\nreason " << reason << "\nstatus "
      << v.status << "\niterations " << v.iterations
      << fmt::format("\nresidual {}\nobjective {}\ncorrected {}\nmilliseconds {}", v.residual, v.objective, v.corrected,
                     v.milliseconds)
      << fmt::format("\nreference {}\nsolution", v.reference);
  for (const double value : v.solution) out << fmt::format(" {}", value);
  out << "\nend\n";
}

std::vector<Verdict> read(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<Verdict> all;
  Verdict v;
  for (std::string line; std::getline(in, line);) {
    const std::size_t space = line.find(' ');
    const std::string key = line.substr(0, space), value = space == std::string::npos ? "" : line.substr(space + 1);
    const std::map<std::string, std::string*> texts = {{"solver", &v.solver}, {"model", &v.model},
                                                       {"family", &v.family}, {"outcome", &v.outcome},
                                                       {"reason", &v.reason}, {"status", &v.status}};
    const std::map<std::string, double*> numbers = {{"residual", &v.residual},
                                                    {"objective", &v.objective},
                                                    {"corrected", &v.corrected},
                                                    {"milliseconds", &v.milliseconds},
                                                    {"reference", &v.reference}};
    if (const auto text = texts.find(key); text != texts.end()) {
      *text->second = value;
    } else if (const auto real = numbers.find(key); real != numbers.end()) {
      *real->second = number(value);
    } else if (key == "several_optima") {
      v.several_optima = value == "1";
    } else if (key == "seed") {
      v.seed = static_cast<unsigned>(number(value));
    } else if (key == "iterations") {
      v.iterations = static_cast<int>(number(value));
    } else if (key == "solution") {
      std::istringstream words(value);
      for (std::string word; words >> word;) v.solution.push_back(number(word));
    } else if (key == "end") {
      all.push_back(std::exchange(v, {}));
    }
  }
  return all;
}

std::vector<Verdict> kept_verdicts() {
  std::vector<std::filesystem::path> files;
  if (std::filesystem::is_directory(verdict_folder()))
    for (const auto& entry : std::filesystem::directory_iterator(verdict_folder()))
      if (entry.path().extension() == extension) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<Verdict> all;
  for (const auto& file : files) {
    const std::vector<Verdict> some = read(file);
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

/// A verdict against those of the other solvers on the same problem.
struct Compared {
  Verdict verdict;
  double gap = std::numeric_limits<double>::quiet_NaN();       ///< of the objective to the best known, relative
  double distance = std::numeric_limits<double>::quiet_NaN();  ///< of the solution from the best one's
};

std::vector<Compared> compare(const std::vector<Verdict>& verdicts) {
  using Key = std::tuple<std::string, std::string, unsigned>;
  const auto key = [](const Verdict& v) { return Key{v.model, v.family, v.seed}; };
  std::map<Key, const Verdict*> best;
  for (const Verdict& v : verdicts) {
    if (v.outcome != "solved") continue;
    const Verdict*& so_far = best[key(v)];
    if (!so_far || v.corrected < so_far->corrected) so_far = &v;
  }
  std::vector<Compared> all;
  for (const Verdict& v : verdicts) {
    Compared compared{v};
    if (v.outcome == "solved") {
      const Verdict& of_best = *best.at(key(v));
      double least = of_best.corrected;
      if (std::isfinite(v.reference)) least = std::min(least, v.reference);
      compared.gap = (v.corrected - least) / std::max(std::abs(least), smallest_objective);
      compared.distance = distance(v.solution, of_best.solution);
      if (compared.gap > same_objective && !v.several_optima) {
        compared.verdict.outcome = "failed";
        compared.verdict.reason = fmt::format("another optimum: its objective is {:.1e} above {}", compared.gap,
                                              least < of_best.corrected ? "the reference" : of_best.solver + "'s");
      }
    }
    all.push_back(std::move(compared));
  }
  return all;
}

/// What became of all problems of a family, for one solver.
struct Summary {
  int problems = 0, good = 0, refused = 0, most_iterations = 0, other_optima = 0;
  std::string outcome, words;
  double residual = 0.0, gap = 0.0, distance = 0.0, milliseconds = 0.0;
};

Summary summarise(const std::vector<const Compared*>& of_family) {
  Summary s;
  for (const Compared* each : of_family) {
    const Verdict& v = each->verdict;
    ++s.problems;
    s.milliseconds = std::max(s.milliseconds, v.milliseconds);
    if (v.outcome == "refused") {
      ++s.refused;
      s.words = v.reason;
    } else if (v.outcome == "failed") {
      s.words += fmt::format("{}seed {}: {}", s.words.empty() ? "" : "; ", v.seed, v.reason);
    } else {
      ++s.good;
      s.outcome = v.outcome;
      s.most_iterations = std::max(s.most_iterations, v.iterations);
      if (v.outcome == "solved") {
        s.residual = std::max(s.residual, v.residual);
        s.gap = std::max(s.gap, each->gap);
        s.distance = std::max(s.distance, each->distance);
        s.other_optima += each->gap > same_objective;
      }
    }
  }
  if (s.refused == s.problems) {
    s.outcome = "refused";
  } else if (s.good < s.problems) {
    s.outcome = fmt::format("FAILED {}/{}", s.problems - s.good, s.problems);
  }
  return s;
}

std::string describe(const Summary& s) {
  if (s.outcome == "refused" || s.good < s.problems) return s.words;
  if (s.outcome == "infeasible") return "and it is";
  std::string text = fmt::format("{:3} iterations, residual {:.0e}, gap {:.0e}, distance {:.0e}, {:.1f} ms",
                                 s.most_iterations, s.residual, s.gap, s.distance, s.milliseconds);
  if (s.other_optima > 0) text += fmt::format(" ({} in another optimum)", s.other_optima);
  return text;
}

std::string json_text(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + "\"";
}
std::string json_number(double value) { return std::isfinite(value) ? fmt::format("{}", value) : "null"; }

std::string as_json(const std::vector<Compared>& all) {
  std::string text = "[";
  for (const Compared& each : all) {
    const Verdict& v = each.verdict;
    text += fmt::format(
        "{}\n{{\"solver\": {}, \"model\": {}, \"family\": {}, \"seed\": {}, \"verdict\": {}, \"reason\": {}, "
        "\"status\": {}, \"iterations\": {}, \"kkt_residual\": {}, \"objective\": {}, \"objective_gap\": {}, "
        "\"solution_distance\": {}, \"milliseconds\": {}}}",
        text.size() > 1 ? "," : "", json_text(v.solver), json_text(v.model), json_text(v.family), v.seed,
        json_text(v.outcome), json_text(v.reason), json_text(v.status), v.iterations, json_number(v.residual),
        json_number(v.objective), json_number(each.gap), json_number(each.distance), json_number(v.milliseconds));
  }
  return text + "\n]\n";
}

}  // namespace

std::filesystem::path verdict_folder() {
  const char* given = std::getenv("RHEC_CONFORMANCE_FOLDER");
  return given ? given : RHEC_CONFORMANCE_FOLDER;
}

void forget_verdicts() { std::filesystem::remove_all(verdict_folder()); }

void keep_verdicts(const std::vector<Verdict>& verdicts) {
  std::filesystem::create_directories(verdict_folder());
  std::string name = verdicts.front().solver + "." + verdicts.front().model + "." + verdicts.front().family;
  std::replace(name.begin(), name.end(), '/', '_');
  std::ofstream out(verdict_folder() / (name + extension));
  for (const Verdict& v : verdicts) write(out, v);
  if (!out.flush()) throw std::runtime_error("cannot write verdicts to " + verdict_folder().string());
}

int report_verdicts() {
  const std::vector<Compared> all = compare(kept_verdicts());
  using Row = std::pair<std::string, std::string>;
  std::vector<Row> rows;
  std::set<std::string> solvers;
  std::map<std::pair<Row, std::string>, std::vector<const Compared*>> cells;
  for (const Compared& each : all) {
    const Row row{each.verdict.model, each.verdict.family};
    solvers.insert(each.verdict.solver);
    rows.push_back(row);
    cells[{row, each.verdict.solver}].push_back(&each);
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());

  std::string text = fmt::format("{:46}", "problem");
  for (const std::string& solver : solvers) text += fmt::format(" {:14}", solver);
  std::string details;
  int failures = 0;
  for (const Row& row : rows) {
    const std::string problem = row.second + " on " + row.first;
    text += fmt::format("\n{:46}", problem);
    for (const std::string& solver : solvers) {
      const auto cell = cells.find({row, solver});
      if (cell == cells.end()) {
        text += fmt::format(" {:14}", "-");
        continue;
      }
      const Summary s = summarise(cell->second);
      text += fmt::format(" {:14}", s.outcome);
      details += fmt::format("{:12} {:46} {:11} {}\n", solver, problem, s.outcome, describe(s));
      failures += s.problems - s.good - s.refused;
    }
  }
  text += "\n\n" + details + fmt::format("\n{} verdicts, {} failures\n", all.size(), failures);
  std::fputs(text.c_str(), stdout);
  std::filesystem::create_directories(verdict_folder());
  std::ofstream(verdict_folder() / "verdicts.txt") << text;
  std::ofstream(verdict_folder() / "verdicts.json") << as_json(all);
  return failures;
}

}  // namespace rhec::conformance
