#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/problems/problem_file.hpp"

namespace rhec::bench {

/// Problems of one structure that follow each other in time, and the guess for the first one.
struct Sequence {
  std::string name;  ///< "gentle/rhe/fhb", "figure8/rhc"
  std::string kind;
  std::shared_ptr<const Model> model;
  struct Sample {
    std::unique_ptr<const HorizonProblem> problem;
    int steps = 0;  ///< intervals by which its window starts after the one before
    /// An estimator's window of the same length, one interval later, with the same data where the windows overlap.
    bool slides = false;
  };
  std::vector<Sample> samples = {};
  std::unique_ptr<HorizonProblem> workspace = {};  ///< large enough for any of the samples
  Iterate start = {};                              ///< guess for the first sample
};

inline constexpr int longest_horizon = 10000;  ///< longest that a sequence may have [intervals]

/// The sequence of the records of one prefix, in their order. Throws Error, also if inputs are blocked: a benchmark
/// would not move their blocks.
Sequence sequence_of(const std::vector<sim::ProblemRecord>& records, const std::shared_ptr<const Model>& model);

/// The reference problems, one sequence for each prefix of their ids, in the order of the files. Their folder is given
/// by the environment variable RHEC_REFERENCE_PROBLEMS; the default is one beside the source tree. Empty if there is no
/// such folder.
std::vector<Sequence> reference_sequences(const Host& host);

/// A closed-loop run of a scenario of the source tree.
struct Drive {
  std::string name;                           ///< of the sequences, followed by /rhe or /rhc
  std::string scenario;                       ///< "figure8"
  std::vector<std::string> assignments = {};  ///< as after --set
};
/// The estimator's and the controller's problems of a closed-loop run, from the time when the estimator's window is
/// full and its estimate has settled. Throws Error, also if the run does not complete.
std::vector<std::vector<sim::ProblemRecord>> record(const Host& host, const Drive& how);
std::vector<Sequence> drive(const Host& host, const Drive& how);

/// An assignment for scenarios of the bicycle: effort is weighed without rates of inputs, and so without a state for
/// the input applied last. That is the problem that other programs are given.
inline const std::string without_rates =
    "controller.weights={stage: {x_pos: 1, y_pos: 1, u1: 5, u2: 0.8}, terminal: {x_pos: 10, y_pos: 10}}";

/// Drives over varying ground that need no data outside the source tree: full-horizon blocking, and structured blocking
/// of one and of both parameters, on an easy path and on one with turns as tight as the steering allows.
const std::vector<Drive>& usual_drives();

/// Copies a sample's data into a problem of the same set-up, in place, as a control loop would: all but what depends on
/// the newest measurement ...
void set_known(const Sequence::Sample& sample, HorizonProblem& to) noexcept;
/// ... and what does.
void set_newest(const HorizonProblem& from, HorizonProblem& to, std::span<double> scratch) noexcept;

}  // namespace rhec::bench
