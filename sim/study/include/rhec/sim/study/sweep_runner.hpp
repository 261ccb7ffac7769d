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

/// Makes one run of a sweep. Its errors are stored in the row; only running out of memory throws.
RHEC_EXPORT SweepRow make_run(const Host& host, const Sweep& sweep, std::int64_t run);

/// Interface of workers that make runs, anywhere. All calls come from one thread.
class RHEC_EXPORT SweepWorkers {
 public:
  virtual ~SweepWorkers();
  /// How many more runs to submit now so that no worker idles.
  virtual std::int64_t room() = 0;
  virtual void give(std::int64_t run) = 0;
  /// Rows finished since the last call; waits up to `patience` if there are none. Rethrows an exception that ended a
  /// worker.
  virtual std::vector<SweepRow> take(std::chrono::milliseconds patience) = 0;
  /// Withdraws the runs that no worker has begun; returns their number.
  virtual std::int64_t withdraw() = 0;
};

/// Threads of this process. On destruction, running threads finish their run first.
class RHEC_EXPORT ThreadWorkers final : public SweepWorkers {
 public:
  /// `host` and `sweep` must outlive this object. As many threads as the system starts; throws Error if it starts none.
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
  std::int64_t there = 0;                      ///< runs already in the store
  std::int64_t made = 0;                       ///< runs made and written
  std::map<RunStatus, std::int64_t> statuses;  ///< of the runs made and those already there
  double seconds = 0.0;                        ///< since the start
  bool stopped = false;                        ///< stopped on request: no more runs are begun
};

struct SweepHooks {
  std::function<void(const SweepProgress&)> progress = {};  ///< called several times a second
  std::function<bool()> stop = {};  ///< polled as often; once true, only running runs are finished
};

/// Makes the runs of a sweep that are missing in the store, and writes each as soon as it is finished, several at once
/// if they finish faster than the disk writes. Throws Error as the store does; rows written before are kept.
RHEC_EXPORT SweepProgress run_sweep(const Sweep& sweep, SweepStore& store, SweepWorkers& workers,
                                    const SweepHooks& hooks = {});

}  // namespace rhec::sim
