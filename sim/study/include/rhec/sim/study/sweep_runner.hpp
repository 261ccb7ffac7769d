#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/store/sweep_store.hpp"
#include "rhec/sim/study/sweep.hpp"

namespace rhec::sim {

/// Makes one run of a sweep. What goes wrong in it is in the row; only a lack of memory throws.
RHEC_EXPORT SweepRow make_run(const Host& host, const Sweep& sweep, std::int64_t run);

/// Those who make runs, wherever they are. All calls come from one thread.
class RHEC_EXPORT SweepWorkers {
 public:
  virtual ~SweepWorkers();
  /// How many more runs can be given now, so that nobody waits.
  virtual std::int64_t room() = 0;
  virtual void give(std::int64_t run) = 0;
  /// What has been finished since; waits a while if that is nothing. Throws what ended a worker.
  virtual std::vector<SweepRow> take(std::chrono::milliseconds patience) = 0;
  /// Takes back the runs that nobody has begun; returns how many these were.
  virtual std::int64_t withdraw() = 0;
};

/// Threads of this process. Those that are at a run when it is destroyed finish it first.
class RHEC_EXPORT ThreadWorkers final : public SweepWorkers {
 public:
  /// `host` and `sweep` must outlive it. At least one thread.
  ThreadWorkers(const Host& host, const Sweep& sweep, int threads);
  ~ThreadWorkers() override;
  ThreadWorkers(const ThreadWorkers&) = delete;
  ThreadWorkers& operator=(const ThreadWorkers&) = delete;

  std::int64_t room() override;
  void give(std::int64_t run) override;
  std::vector<SweepRow> take(std::chrono::milliseconds patience) override;
  std::int64_t withdraw() override;

 private:
  void work();

  const Host& host_;
  const Sweep& sweep_;
  std::mutex mutex_;
  std::condition_variable given_, finished_;
  std::deque<std::int64_t> waiting_;
  std::vector<SweepRow> rows_;
  std::exception_ptr failure_;
  bool over_ = false;
  std::vector<std::thread> threads_;
};

struct SweepProgress {
  std::int64_t total = 0;                      ///< runs of the grid
  std::int64_t there = 0;                      ///< of them, found in the store when their turn came
  std::int64_t made = 0;                       ///< of them, made and written since
  std::map<RunStatus, std::int64_t> statuses;  ///< of those made, and of those that were there
  double seconds = 0.0;                        ///< since the start
  bool stopped = false;                        ///< as asked: no more runs are begun
};

struct SweepHooks {
  std::function<void(const SweepProgress&)> progress = {};  ///< told several times a second
  std::function<bool()> stop = {};  ///< asked as often; after yes only runs under way are finished
};

/// Makes the runs of a sweep that the store does not have, and writes each as soon as it is finished; several at once
/// where they finish faster than the disk is. Throws Error as the store does; what was written before stays.
RHEC_EXPORT SweepProgress run_sweep(const Sweep& sweep, SweepStore& store, SweepWorkers& workers,
                                    const SweepHooks& hooks = {});

}  // namespace rhec::sim
