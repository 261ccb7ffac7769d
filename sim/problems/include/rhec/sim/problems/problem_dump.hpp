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

/// Saves problems that loops solve as problem files, rhe.jsonl and rhc.jsonl, with the guess that each solve began with
/// and under `origin` what came of it: those whose solve failed (`is_usable`), and of every n-th step the one that
/// counted.
///
/// Their ids are run/rhe/STEP and run/rhc/STEP. Where a step solved several times (a controller that starts anew, a
/// search for the heading) that is the last one; failures before it are run/rhe/attempt1/STEP and so on.
class RHEC_EXPORT ProblemDump {
 public:
  /// Files of these kinds in a folder, written aside until `commit`. every = 0: failures alone. Throws Error.
  ProblemDump(const std::filesystem::path& folder, const std::vector<std::string>& kinds, int every);
  ProblemDump(const ProblemDump&) = delete;
  ProblemDump& operator=(const ProblemDump&) = delete;

  /// What to hang into a loop that drives this robot; `run` is its name. One loop after the other.
  decltype(LoopHooks::solved) watch(const std::string& run, const Robot& robot);

  /// Puts the files into place, empty ones too: what was there is of another run. Throws Error, also for what could not
  /// be saved in the meantime.
  void commit();

  /// One of the files, as it is after `commit`.
  struct File {
    std::filesystem::path path;
    std::int64_t problems = 0;
    /// `--solver NAME --set KEY=VALUE ...` of the solvers that they were put to.
    std::vector<std::string> solvers;
  };
  std::vector<File> files() const;

 private:
  struct Stream {
    std::filesystem::path path;
    std::ofstream file;
    std::int64_t problems = 0;
    std::map<std::string, std::int64_t> solvers;  ///< problems of each
    std::optional<ProblemRecord> last;            ///< of the step that is going on, where it is to be saved
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
