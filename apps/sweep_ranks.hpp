#pragma once

#include <memory>
#include <optional>
#include <string>

#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/study/sweep.hpp"
#include "rhec/sim/study/sweep_runner.hpp"

namespace rhec::apps {

/// The processes that mpirun, or the like, has started together. They are told apart by their ranks; rank 0 hands out
/// runs and writes, and all of them make runs. MPI is in a library of its own (apps/mpi), which nobody loads who was
/// started alone.
class SweepRanks {
 public:
  /// Tells the other ranks, if nobody did before, that there is nothing to do; ends MPI.
  virtual ~SweepRanks() = default;
  virtual int rank() const = 0;
  virtual int count() const = 0;

  /// For rank 0: all ranks as workers, each with so many threads. First waits until every rank has read its sweep, and
  /// throws Error if one could not, or has another one.
  virtual std::unique_ptr<sim::SweepWorkers> workers(const Host& host, const sim::Sweep& sweep, int threads) = 0;
  /// For all others: makes runs until rank 0 says that all is done. `problem` says why there is no sweep.
  virtual void serve(const Host& host, const std::optional<sim::Sweep>& sweep, const std::string& problem,
                     int threads) = 0;
};

/// Of how many processes this one was started as a part, by what mpirun and srun leave in the environment; 1: alone.
int started_ranks();
/// Starts MPI. Throws Error where this program was built without it, or where it sees another number of processes.
std::unique_ptr<SweepRanks> start_ranks(const Host& host, int expected);

/// What the library has, as `rhec_start_sweep_ranks`.
using StartSweepRanks = SweepRanks*();

}  // namespace rhec::apps
