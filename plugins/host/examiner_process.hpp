#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <string>

namespace rhec {

/// What became of a process that examined a plugin.
struct ExaminerEnd {
  std::string problem = {};  ///< why it could not be started; empty if it was
  std::string report = {};   ///< what it wrote to its report
  std::string output = {};   ///< the beginning of what was written to its standard streams
  bool timed_out = false;
  int status = 0;  ///< as waitpid gives it
};

/// The program that examines plugins, as it is installed beside the library of this function.
std::filesystem::path examiner_program();

/// Runs the examiner on a plugin, in a process group of its own that is killed when it has ended or the time is over.
ExaminerEnd run_examiner(const std::filesystem::path& program, const std::filesystem::path& plugin,
                         std::chrono::milliseconds time_limit, std::size_t memory_limit);

}  // namespace rhec
