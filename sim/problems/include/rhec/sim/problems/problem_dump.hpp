#pragma once

#include <cstdint>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rhec/sim/files/output_folder.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "rhec/sim/problems/recording_solver.hpp"

namespace rhec::sim {

/// Saves problems solved in loops to the problem files rhe.jsonl and rhc.jsonl, with each solve's initial guess and,
/// under `origin`, its outcome. Saves problems whose solve failed (not `is_usable`), and the final solve of every n-th
/// step.
///
/// Their ids are run/rhe/STEP and run/rhc/STEP. If a step solves several times (controller restart, heading search),
/// this is the last solve; earlier failures are run/rhe/attempt1/STEP and so on.
class RHEC_EXPORT ProblemDump {
 public:
  /// Writes files of these kinds to a folder; they are temporary until `commit`. every = 0: only failures. Throws
  /// Error.
  ProblemDump(const std::filesystem::path& folder, const std::vector<std::string>& kinds, int every);
  ProblemDump(const ProblemDump&) = delete;
  ProblemDump& operator=(const ProblemDump&) = delete;

  /// Callback for a loop with this robot; `run` is the loop's name. One loop at a time.
  decltype(LoopHooks::solved) watch(const std::string& run, const Robot& robot);

  /// Moves the files into place, even empty ones, to replace those of earlier runs. Throws Error, also for problems
  /// that could not be saved before.
  void commit();

  /// One of the files after `commit`.
  struct File {
    std::filesystem::path path;
    std::int64_t problems = 0;
    /// `--solver NAME --set KEY=VALUE ...` of the solvers used.
    std::vector<std::string> solvers;
  };
  std::vector<File> files() const;

 private:
  struct Stream {
    std::filesystem::path path;
    std::ofstream file;
    std::int64_t problems = 0;
    std::map<std::string, std::int64_t> solvers;  ///< number of problems per solver
    std::optional<ProblemRecord> last;            ///< of the current step, if it is to be saved
    std::string prefix;                           ///< of its id
    std::string solver;
    std::int64_t step = -1;
    int attempts = 0;  ///< solves of that step
    bool failed = false;
  };
  void take(const std::string& run, const Robot& robot, std::int64_t step, const HorizonProblem& problem,
            const Iterate& guess, const Report& report);
  void end_step(Stream& stream);
  static void write(Stream& stream);

  OutputFolder folder_;
  std::map<std::string, Stream> streams_;
  int every_;
  std::exception_ptr failure_;
};

}  // namespace rhec::sim
