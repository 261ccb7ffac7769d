#include "rhec/sim/problems/problem_dump.hpp"

#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {
namespace {

/// Quotes text as one shell word.
std::string quoted(const std::string& text) {
  if (text.find_first_of(" \t'\"\\$`!*?[]{}()<>|&;#~") == std::string::npos) return text;
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

std::string command_of(const PluginChoice& solver) {
  std::string command = "--solver " + quoted(solver.name);
  for (const auto& [key, value] : solver.options.members())
    command +=
        " --set " + quoted(key + "=" + (value.kind() == Settings::Kind::scalar ? value.text() : json_text(value)));
  return command;
}

}  // namespace

ProblemDump::ProblemDump(const std::filesystem::path& folder, const std::vector<std::string>& kinds, int every)
    : folder_(folder), every_(every) {
  for (const std::string& kind : kinds) {
    const std::string name = fmt::format("{}.jsonl", kind);
    Stream& stream = streams_[kind];
    stream.path = folder_.path() / name;
    stream.file.open(folder_.file(name), std::ios::binary | std::ios::trunc);
  }
}

decltype(LoopHooks::solved) ProblemDump::watch(const std::string& run, const Robot& robot) {
  return [this, run, &robot](std::int64_t step, const HorizonProblem& problem, const Iterate& guess, const Iterate&,
                             const Report& report) {
    if (failure_) return;
    try {
      take(run, robot, step, problem, guess, report);
    } catch (const std::exception&) {
      failure_ = std::current_exception();  // a solver must not throw; `commit` does
    }
  };
}

void ProblemDump::take(const std::string& run, const Robot& robot, std::int64_t step, const HorizonProblem& problem,
                       const Iterate& guess, const Report& report) {
  const auto at = streams_.find(std::string(problem.kind()));
  if (at == streams_.end()) return;
  Stream& stream = at->second;
  const std::string prefix = fmt::format("{}/{}", run, problem.kind());
  if (stream.step != step || stream.prefix != prefix) {
    end_step(stream);
    stream.prefix = prefix;
    stream.step = step;
  } else if (stream.last && stream.failed) {
    stream.last->set_id(fmt::format("{}/attempt{}/{}", prefix, stream.attempts, step));
    write(stream);
  }
  ++stream.attempts;
  stream.last.reset();
  stream.failed = !is_usable(report.status);
  if (!stream.failed && (every_ <= 0 || step % every_ != 0)) return;
  const PluginChoice model = robot.model_choice(), solver = robot.solver_choice(problem.kind());
  stream.solver = command_of(solver);
  stream.last = record_of(problem, &guess, fmt::format("{}/{}", prefix, step), model.name, model.options);
  stream.last->origin = {{"run", run},
                         {"step", fmt::format("{}", step)},
                         {"solver", solver.name},
                         {"options", json_text(solver.options)},
                         {"status", rhec::name_of(report.status)},
                         {"iterations", fmt::format("{}", report.iterations)},
                         {"objective", fmt::format("{}", report.objective)},
                         {"kkt_residual", fmt::format("{}", report.kkt.largest())}};
}

void ProblemDump::end_step(Stream& stream) {
  if (stream.last) write(stream);
  stream.last.reset();
  stream.attempts = 0;
}

void ProblemDump::write(Stream& stream) {
  stream.file << problem_line(*stream.last) << '\n';
  ++stream.problems;
  ++stream.solvers[stream.solver];
}

void ProblemDump::commit() {
  if (failure_) std::rethrow_exception(failure_);
  for (auto& [kind, stream] : streams_) {
    end_step(stream);
    stream.file.close();
    if (!stream.file)
      throw Error(fmt::format("{}: cannot be written; choose another folder for problems, or make room on its disk",
                              stream.path.string()));
  }
  folder_.commit();
}

std::vector<ProblemDump::File> ProblemDump::files() const {
  std::vector<File> files;
  for (const auto& [kind, stream] : streams_) {
    File& file = files.emplace_back();
    file.path = stream.path;
    file.problems = stream.problems;
    for (const auto& [command, count] : stream.solvers) file.solvers.push_back(command);
  }
  return files;
}

}  // namespace rhec::sim
