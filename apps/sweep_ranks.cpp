#include "sweep_ranks.hpp"

#include <dlfcn.h>

#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <filesystem>

#include "rhec/core/base/error.hpp"

namespace rhec::apps {

int started_ranks() {
  // Set by Open MPI's mpirun; by MPICH's and others that use PMI; in a Slurm job step, but not in the script that
  // starts steps.
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"}) {
    const char* text = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): before there are threads
    const int count = text ? std::atoi(text) : 0;
    if (count > 0) return count;
  }
  return 1;
}

std::unique_ptr<SweepRanks> start_ranks(const Host& host, int expected) {
  std::filesystem::path library;
  for (const PluginPlace& place : host.places())
    if (place.origin == "installed") library = place.directory.parent_path() / "sweep_mpi.so";
  if (!std::filesystem::exists(library))
    throw Error(fmt::format(
        "started as one of {} processes, but this program was built without MPI: there is no {}; install Open MPI "
        "(libopenmpi-dev) and build it again, or start it alone",
        expected, library.string()));
  // MPI loads its own components, which need its symbols (RTLD_GLOBAL).
  void* loaded = dlopen(library.c_str(), RTLD_NOW | RTLD_GLOBAL);
  if (!loaded) {
    const char* reason = dlerror();
    throw Error(fmt::format("{}: cannot be loaded ({}); install Open MPI (openmpi-bin), or start this program alone",
                            library.string(), reason ? reason : "no reason is known"));
  }
  auto* start = reinterpret_cast<StartSweepRanks*>(dlsym(loaded, "rhec_start_sweep_ranks"));
  if (!start)
    throw Error(fmt::format("{}: is not the library that it should be; install this program anew", library.string()));
  std::unique_ptr<SweepRanks> ranks(start());
  if (ranks->count() != expected)
    throw Error(
        fmt::format("started as one of {} processes, but MPI sees {}; start it with the mpirun of the Open MPI that it "
                    "was built with, or with 'srun --mpi=pmix'",
                    expected, ranks->count()));
  return ranks;
}

}  // namespace rhec::apps
