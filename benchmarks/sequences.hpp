#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/problem_file.hpp"

namespace rhec::bench {

/// Problems that follow each other over time, all of one structure, and where the first solve begins.
struct Sequence {
  std::string name;  ///< "gentle/rhe/fhb", "figure8/rhc"
  std::string kind;
  std::shared_ptr<const Model> model;
  struct Sample {
    std::unique_ptr<const HorizonProblem> problem;
    int steps = 0;  ///< intervals that its window starts later than the one before
    /// Its window is an estimator's of the same length an interval later, with the same data where both have any.
    bool slides = false;
  };
  std::vector<Sample> samples = {};
  std::unique_ptr<HorizonProblem> workspace = {};  ///< with room for any of the samples
  Iterate start = {};                              ///< guess for the first one
};

inline constexpr int longest_horizon = 10000;  ///< that a sequence may have

/// The sequence of records of one prefix, in their order. Throws Error, also where inputs are blocked: a benchmark
/// would not move their blocks.
Sequence sequence_of(const std::vector<sim::ProblemRecord>& records, const std::shared_ptr<const Model>& model);

/// The reference problems, a sequence for each prefix of their ids, in the order of the files. The folder is that of
/// the environment variable RHEC_REFERENCE_PROBLEMS, or else one beside the source tree. Empty where it is not there.
std::vector<Sequence> reference_sequences(const Host& host);

/// What a scenario of the source tree is driven with.
struct Drive {
  std::string name;                           ///< of the sequences, with /rhe or /rhc behind it
  std::string scenario;                       ///< "figure8"
  std::vector<std::string> assignments = {};  ///< as after --set
};
/// The problems of a closed loop, estimator's and controller's, from when the estimator's window is full and its
/// estimate has settled. Throws Error, also where the drive does not reach its end.
std::vector<std::vector<sim::ProblemRecord>> record(const Host& host, const Drive& how);
std::vector<Sequence> drive(const Host& host, const Drive& how);

/// Drives over varying ground, for every clone: full-horizon blocking, structured blocking of one and of both
/// parameters on a path that is easy, and on one whose turns are as tight as the steering allows.
const std::vector<Drive>& usual_drives();

/// Copies the data of a sample into a problem of the same set-up, in place, as a loop would set them: all but what the
/// newest measurement brings ...
void set_known(const Sequence::Sample& sample, HorizonProblem& to) noexcept;
/// ... and that.
void set_newest(const HorizonProblem& from, HorizonProblem& to, std::span<double> scratch) noexcept;

}  // namespace rhec::bench
