#pragma once

#include <memory>
#include <optional>
#include <string>

#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/study/sweep.hpp"
#include "rhec/sim/study/sweep_runner.hpp"

namespace rhec::apps {

/// The processes that mpirun, or a similar launcher, has started together. Rank 0 distributes the runs and writes the
/// results; all ranks make runs. MPI is in a separate library (apps/mpi), which a process that was started alone does
/// not load.
class SweepRanks {
 public:
  /// Tells the other ranks that there is nothing to do, unless they have already begun; calls MPI_Finalize.
  virtual ~SweepRanks() = default;
  virtual int rank() const = 0;
  virtual int count() const = 0;

  /// For rank 0: all ranks as workers, with `threads` threads each. First waits until every rank has read its sweep;
  /// throws Error if one failed to, or has a different one.
  virtual std::unique_ptr<sim::SweepWorkers> workers(const Host& host, const sim::Sweep& sweep, int threads) = 0;
  /// For all other ranks: makes runs until rank 0 says that all is done. `problem` says why there is no sweep.
  virtual void serve(const Host& host, const std::optional<sim::Sweep>& sweep, const std::string& problem,
                     int threads) = 0;
};

/// How many processes were started together, according to the environment that mpirun and srun set; 1: this one only.
int started_ranks();
/// Starts MPI. Throws Error if this program was built without MPI, or if MPI reports another number of processes.
std::unique_ptr<SweepRanks> start_ranks(const Host& host, int expected);

/// The type of the library's function `rhec_start_sweep_ranks`.
using StartSweepRanks = SweepRanks*();

}  // namespace rhec::apps
