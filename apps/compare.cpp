#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "commands.hpp"
#include "crash_report.hpp"
#include "output.hpp"
#include "progress.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/scenario_file.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/comparison/comparison.hpp"
#include "rhec/sim/files/json.hpp"
#include "rhec/sim/files/output_folder.hpp"

namespace rhec::apps {
namespace {

using sim::Answer;
using sim::Backend;
using sim::Comparison;

struct CompareArguments {
  std::string scenario, out;
  std::vector<std::string> solvers;
  std::string drive;
  std::vector<std::string> assignments;
  int seeds = 1, every = 0;
  double accuracy = 0.0;
  bool no_closed_loop = false, json = false;
  std::vector<std::filesystem::path> plugin_path;
};

constexpr const char* default_drive = "gn_rti:mode=converge";
constexpr const char* form = "expected [LABEL=]NAME[:KEY=VALUE,...]";

// ---- parsing of --solvers

/// The position of a character outside of brackets, braces and quotes.
std::size_t find_outside(std::string_view text, char wanted, std::size_t from = 0) {
  int depth = 0;
  char quote = 0;
  for (std::size_t i = from; i < text.size(); ++i) {
    const char c = text[i];
    if (quote) {
      if (c == quote) quote = 0;
    } else if (depth == 0 && c == wanted) {
      return i;
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '[' || c == '{') {
      ++depth;
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return std::string_view::npos;
}

std::vector<std::string> split_outside(std::string_view text, char at) {
  std::vector<std::string> parts;
  for (std::size_t from = 0;;) {
    const std::size_t end = find_outside(text, at, from);
    parts.emplace_back(text.substr(from, end == std::string_view::npos ? end : end - from));
    if (end == std::string_view::npos) return parts;
    from = end + 1;
  }
}

/// A solver as written on the command line: "fast=gn_rti:mode=rti" has a label, a name and one option.
struct Written {
  std::string text, label, name;
  std::vector<std::string> options;
  bool has_colon = false;
};

/// Parses a list of solvers. Commas separate solvers, and also the options of one solver: a part that has a '=', but no
/// colon and no solver's name after the '=', is another option of the preceding solver if that one has options.
std::vector<Written> read_list(const std::string& list, const std::vector<std::string>& known) {
  std::vector<Written> solvers;
  for (const std::string& part : split_outside(list, ',')) {
    const std::size_t colon = find_outside(part, ':'), equals = find_outside(part, '=');
    const bool has_value = equals != std::string::npos;
    const bool names_a_solver =
        has_value && std::find(known.begin(), known.end(), part.substr(equals + 1)) != known.end();
    if (!solvers.empty() && solvers.back().has_colon && has_value && colon == std::string::npos && !names_a_solver) {
      solvers.back().text += "," + part;
      solvers.back().options.push_back(part);
      continue;
    }
    Written& solver = solvers.emplace_back();
    solver.text = part;
    solver.has_colon = colon != std::string::npos;
    std::string head = part.substr(0, colon);
    if (const std::size_t label_end = head.find('='); label_end != std::string::npos) {
      solver.label = head.substr(0, label_end);
      head = head.substr(label_end + 1);
      if (solver.label.empty()) throw Error(fmt::format("--solvers {}: an empty label; {}", part, form));
    }
    solver.name = head;
    if (solver.has_colon && colon + 1 < part.size()) solver.options.push_back(part.substr(colon + 1));
    if (solver.name.empty()) throw Error(fmt::format("--solvers {}: a solver without a name; {}", list, form));
  }
  return solvers;
}

/// The backend as written. Its solver is made once to check that it can be made.
Backend backend_of(const Host& host, const Written& written, const std::string& flag) {
  Backend backend{written.label, written.name, Settings::map()};
  const std::string options_at = fmt::format("{} {}:", flag, written.name);
  const auto told = [&](const Error& mistake) {
    const std::string text = mistake.what();  // errors in options begin with a place, as if given by --set
    constexpr std::string_view set = "--set ";
    return Error(text.starts_with(set) ? options_at + text.substr(set.size())
                                       : fmt::format("{} {}: {}", flag, written.name, text));
  };
  try {
    host.options(PluginKind::solver, written.name);  // checks that the solver exists before reading its options
    for (const std::string& option : written.options) apply_assignment(backend.options, option);
    host.make_solver(written.name, backend.options);
  } catch (const Error& mistake) {
    throw told(mistake);
  }
  return backend;
}

std::vector<Backend> read_backends(const Host& host, const std::vector<std::string>& lists) {
  const std::vector<std::string> known = host.names(PluginKind::solver);
  std::vector<Written> written;
  for (const std::string& list : lists)
    for (Written& solver : read_list(list, known)) written.push_back(std::move(solver));
  std::vector<Backend> backends;
  for (const Written& solver : written) {
    Backend backend = backend_of(host, solver, "--solvers");
    if (backend.label.empty()) {
      const auto same_name = std::count_if(written.begin(), written.end(), [&](const Written& other) {
        return other.name == solver.name && other.label.empty();
      });
      backend.label = same_name > 1 ? solver.text : solver.name;
    }
    const auto is_taken = [&](const Backend& other) { return other.label == backend.label; };
    if (std::any_of(backends.begin(), backends.end(), is_taken))
      throw Error(
          fmt::format("--solvers {}: a second solver of the label '{}'; expected labels that differ: LABEL=NAME",
                      solver.text, backend.label));
    backends.push_back(std::move(backend));
  }
  return backends;
}

/// Parses --drive: a label of --solvers, or another solver.
Backend read_drive(const Host& host, const std::string& text, const std::vector<Backend>& backends) {
  for (const Backend& backend : backends)
    if (backend.label == text) return backend;
  const std::vector<Written> written = read_list(text, host.names(PluginKind::solver));
  if (written.size() != 1) throw Error(fmt::format("--drive {}: expected one solver, found {}", text, written.size()));
  Backend backend = backend_of(host, written.front(), "--drive");
  if (backend.label.empty()) backend.label = written.front().text;
  return backend;
}

// ---- output

/// "gn_rti, mode: converge"
std::string described(const Backend& backend) {
  std::string text = backend.solver;
  for (const auto& [key, value] : backend.options.members())
    text += fmt::format(", {}: {}", key, value.kind() == Settings::Kind::scalar ? value.text() : sim::json_text(value));
  return text;
}

/// Wide enough for the labels, but limited to keep the table narrow.
std::size_t label_width(const Comparison& comparison) {
  std::size_t width = 8;
  for (const Backend& backend : comparison.backends) width = std::max(width, backend.label.size());
  return std::min<std::size_t>(width, 24);
}

std::string fitted(const std::string& label, std::size_t width) {
  const std::string text = label.size() > width ? label.substr(0, width - 1) + "~" : label;
  return fmt::format("{:<{}}", text, width);
}

std::string small(double value) { return std::isnan(value) ? "-" : value == 0.0 ? "0" : fmt::format("{:.1e}", value); }
std::string microseconds(double value) {
  return std::isnan(value) ? "-" : fmt::format("{:.{}f}", value, value < 1000.0 ? 1 : 0);
}

void print_head(const Comparison& comparison) {
  const bool one_seed = comparison.seeds.size() == 1;
  fmt::print("scenario {}, {}\n", comparison.scenario,
             one_seed ? fmt::format("seed {}", comparison.seeds.front())
                      : fmt::format("seeds {} to {}", comparison.seeds.front(), comparison.seeds.back()));
  const std::size_t width = label_width(comparison);
  for (const Backend& backend : comparison.backends)
    fmt::print("  {}  {}\n", fitted(backend.label, width), described(backend));
  fmt::print("problems along the way of {}", described(comparison.reference));
  if (comparison.every > 1)
    fmt::print("; of steps 0, {}, {}, ... alone (--every {})", comparison.every, 2 * comparison.every,
               comparison.every);
  fmt::print("\n");
  for (std::size_t r = 0; r < comparison.reference_runs.size(); ++r)
    if (!comparison.reference_runs[r].completed)
      fmt::print("  seed {}: {}\n", comparison.seeds[r], comparison.reference_runs[r].ended);
  if (comparison.accuracy)
    fmt::print("at equal accuracy: each tightened until the KKT residual at the 99th percentile is at most {:g}\n",
               *comparison.accuracy);
}

void print_answers(const Comparison& comparison, const sim::SameProblems& same) {
  const std::size_t width = label_width(comparison);
  const bool is_rhe = same.kind == "rhe";
  fmt::print("\n{}: {} problems, the same for all\n", is_rhe ? "ESTIMATION (RHE)" : "CONTROL (RHC)",
             same.problems.size());
  constexpr const char* row = "{:<{}}  {:>9} {:>8}  {:>8}  {:>8} {:>8} {:>8}  {:>8} {:>8} {:>8}  {:>9} {:>9} {:>7}";
  const std::string head =
      fmt::format(row, "", width, "ITERATION", "KKT", "DEFECT", "GAP", "", "", "DISTANCE", "", "", "TIME [us]", "", "");
  fmt::print("{}\n", head.substr(0, head.find_last_not_of(' ') + 1));
  fmt::print(row, "SOLVER", width, "MED/MAX", "P99", "MAX", "MEDIAN", "P99", "MAX", "MEDIAN", "P99", "MAX", "MEDIAN",
             "P99", "RATIO");
  fmt::print("  STATUS\n");
  const double first = spread_of(same.backends.front().answers, &Answer::time_us).median;
  for (std::size_t b = 0; b < same.backends.size(); ++b) {
    const sim::BackendAnswers& backend = same.backends[b];
    const std::string label = fitted(comparison.backends[b].label, width);
    if (backend.refused > 0)
      fmt::print("{}  refuses {} of {}: {}\n", label, backend.refused, same.problems.size(), backend.refusal);
    if (backend.answers.empty()) continue;
    const auto of = [&](double Answer::*number) { return spread_of(backend.answers, number); };
    const sim::Spread iterations = spread_of(backend.answers, &Answer::iterations), gap = of(&Answer::gap),
                      distance = of(&Answer::distance), time = of(&Answer::time_us);
    std::string statuses;
    for (const auto& [status, count] : backend.statuses)
      statuses += fmt::format("{}{} {}", statuses.empty() ? "" : ", ", count, status);
    fmt::print(row, label, width, fmt::format("{:g}/{:g}", iterations.median, iterations.max),
               small(of(&Answer::kkt).p99), small(of(&Answer::defect).max), small(gap.median), small(gap.p99),
               small(gap.max), small(distance.median), small(distance.p99), small(distance.max),
               microseconds(time.median), microseconds(time.p99),
               std::isnan(first) ? "-" : fmt::format("{:.3g}", time.median / first));
    fmt::print("  {}\n", statuses);
    if (!backend.tuning.empty()) fmt::print("{:<{}}  {}\n", "", width, backend.tuning);
  }
  if (same.without_best > 0)
    fmt::print("to {} of them no answer is feasible: without a best one they have neither gap nor distance\n",
               same.without_best);
}

/// An error measure of a run, and how many digits to print.
struct Column {
  std::string name;
  int digits;
  std::function<double(const sim::RunSummary&)> number;
};

std::vector<Column> columns_of(const sim::RunSummary& run) {
  std::vector<Column> columns;
  for (const auto& [name, value] : run.mae.parameters)
    columns.push_back({name, 5, [key = name](const sim::RunSummary& each) { return each.mae.parameters.at(key); }});
  columns.push_back({"position [m]", 5, [](const sim::RunSummary& each) { return each.mae.position; }});
  columns.push_back({"heading [rad]", 6, [](const sim::RunSummary& each) { return each.mae.heading; }});
  columns.push_back({"tracking [m]", 5, [](const sim::RunSummary& each) { return each.mae.tracking; }});
  return columns;
}

void print_loops(const Comparison& comparison) {
  if (comparison.loops.empty()) return;
  const auto driven = std::find_if(comparison.loops.begin(), comparison.loops.end(),
                                   [](const sim::BackendRuns& loop) { return !loop.runs.empty(); });
  const std::vector<Column> columns =
      driven == comparison.loops.end() ? std::vector<Column>() : columns_of(driven->runs.front());
  const std::size_t width = label_width(comparison);
  const std::size_t seeds = comparison.seeds.size();
  fmt::print("\nCLOSED LOOP: each drives by itself; mean absolute errors{}\n",
             seeds > 1 ? fmt::format(", means over {} seeds", seeds) : "");
  fmt::print("{:<{}}  {:>9} {:>7} {:>9}", "SOLVER", width, "COMPLETED", "STEPS", "FALLBACKS");
  for (const Column& column : columns) fmt::print(" {:>18}", column.name);
  fmt::print("\n");
  const std::vector<sim::RunSummary>& first = comparison.loops.front().runs;
  for (std::size_t b = 0; b < comparison.loops.size(); ++b) {
    const sim::BackendRuns& loop = comparison.loops[b];
    const std::string label = fitted(comparison.backends[b].label, width);
    if (!loop.refusal.empty()) {
      fmt::print("{}  refuses {}\n", label, loop.refusal);
      continue;
    }
    std::int64_t steps = 0, fallbacks = 0;
    for (const sim::RunSummary& run : loop.runs) {
      steps += run.steps;
      fallbacks += run.fallbacks;
    }
    const auto completed =
        std::count_if(loop.runs.begin(), loop.runs.end(), [](const sim::RunSummary& run) { return run.completed; });
    fmt::print("{}  {:>9} {:>7} {:>9}", label, fmt::format("{}/{}", completed, seeds), steps, fallbacks);
    for (const Column& column : columns)
      fmt::print(" {:>18.{}f}", paired_mean(loop.runs, first, column.number).mean, column.digits);
    fmt::print("\n");
    for (std::size_t r = 0; r < loop.runs.size(); ++r)
      if (!loop.runs[r].completed)
        fmt::print("{:<{}}  seed {}: {}\n", "", width, comparison.seeds[r], loop.runs[r].ended);
    if (b == 0 || first.empty()) continue;
    fmt::print("{:<{}}  {:>27}", "", width, "difference to the first");
    for (const Column& column : columns) {
      const sim::Mean mean = paired_mean(loop.runs, first, column.number);
      fmt::print(" {:>18}", std::isnan(mean.standard_error)
                                ? fmt::format("{:+.1e}", mean.difference)
                                : fmt::format("{:+.1e} ~{:.0e}", mean.difference, mean.standard_error));
    }
    fmt::print("\n");
  }
}

void print_notes(const Comparison& comparison, const std::filesystem::path& folder) {
  fmt::print(
      "\nGAP: objective above the best answer's, relative; defects are charged. DISTANCE: from the best answer, in "
      "units\n"
      "of the model's scales. RATIO: of median times to the first solver's. Times are of this machine: trust "
      "ratios.\n");
  if (comparison.loops.size() > 1 && comparison.seeds.size() > 1)
    fmt::print("~: standard error of the mean difference over the seeds.\n");
  fmt::print("numbers and a picture of the times: {}\n", folder.string());
}

int compare(const CompareArguments& arguments) {
  Settings settings = load_scenario(arguments.scenario);
  apply_assignments(settings, arguments.assignments);
  const Host host = examined_host(arguments.plugin_path);
  sim::ComparisonOptions options;
  options.backends = read_backends(host, arguments.solvers);
  options.reference = read_drive(host, arguments.drive, options.backends);
  options.seeds = arguments.seeds;
  options.every = arguments.every;
  options.closed_loop = !arguments.no_closed_loop;
  if (arguments.accuracy > 0.0) options.accuracy = arguments.accuracy;
  sim::OutputFolder folder(out_of(arguments.out, arguments.scenario, "_compare"));
  ProgressBar bar("compare");
  options.progress = [&](double share) { bar.show(share); };
  const Comparison comparison = sim::compare(host, settings, options);
  bar.finish();
  const std::string document = sim::comparison_json(comparison);
  folder.write("compare.json", document);
  folder.write("compare.svg", sim::comparison_svg(comparison));
  folder.commit();
  if (arguments.json) {
    print_json(document, folder.path());
  } else {
    print_head(comparison);
    for (const sim::SameProblems& same : comparison.problems) print_answers(comparison, same);
    print_loops(comparison);
    print_notes(comparison, folder.path());
  }
  return comparison.all_usable() ? exit_fine : exit_not_solved;
}

}  // namespace

void add_compare(Program& program) {
  auto arguments = std::make_shared<CompareArguments>();
  arguments->drive = default_drive;
  Command command = program.add(
      "compare", "Compares solvers on a scenario: the same problems, then each in the closed loop.",
      "First one solver drives the scenario, and all of those compared solve every problem on its way from the same\n"
      "guess, so that one's drift is not another's input. One KKT residual assesses all of them. Then each drives "
      "alone,\n"
      "over the same ground and with the same noise. Writes compare.json and compare.svg to the output folder;\n"
      "docs/compare.md says what each figure means.\n\n"
      "A solver is NAME, NAME:KEY=VALUE,KEY=VALUE with options of its own, and may have a label: "
      "LABEL=NAME:KEY=VALUE.\n\n"
      "The exit code is 3 where a solver refused a problem or had no usable answer to it, or a run was not "
      "completed.\n\n"
      "Examples:\n"
      "  rhec compare scenarios/figure8.yaml --solvers rti=gn_rti,converged=gn_rti:mode=converge --out out/compare\n"
      "  rhec compare scenarios/zigzag.yaml --solvers gn_rti:mode=converge,tolerance=1e-6 --seeds 4 --no-closed-loop\n"
      "  rhec compare scenarios/figure8.yaml --solvers gn_rti,sparse_sqp --accuracy 1e-8 --set speed=4",
      [arguments] { return compare(*arguments); });
  command.add("scenario", arguments->scenario, "a YAML file").required();
  command
      .add_list("--solvers", arguments->solvers,
                "solvers of 'rhec plugins', with commas between them; may be given several times")
      .required()
      .value("A,B,...");
  command.add("--seeds", arguments->seeds, "the scenario's seed and those that follow it")
      .value("N")
      .within(1, 10000)
      .shows_default();
  command.add("--drive", arguments->drive, "who drives while problems are recorded: a solver, or a label")
      .value("SOLVER")
      .shows_default();
  command
      .add("--every", arguments->every,
           "problems of every N-th step alone; otherwise as many as leave about 400 of a kind")
      .value("N")
      .within(1, 1000000);
  command
      .add("--accuracy", arguments->accuracy,
           "tighten each solver's tolerance until 99 % of the same problems have this KKT residual or less")
      .value("EPS")
      .positive();
  command.add_flag("--no-closed-loop", arguments->no_closed_loop, "the same problems alone");
  add_assignments(command, arguments->assignments, "a key of the scenario");
  add_out(command, arguments->out, "DIR",
          "folder of the results; otherwise out/ and the scenario's name with _compare");
  add_json(command, arguments->json);
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
