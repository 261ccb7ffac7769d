// The only translation unit of this room that uses NLopt.
#include "rhec/sim/tuning/search.hpp"

#include <nlopt.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

struct Destroy {
  void operator()(nlopt_opt optimiser) const noexcept { nlopt_destroy(optimiser); }
};

/// What all starts share.
struct Shared {
  std::mutex mutex;
  std::optional<Maximum> best;
  int evaluations = 0;
};

/// The search from one start.
class Search {
 public:
  Search(const Objective& objective, const SearchOptions& options, Shared& shared)
      : objective_(objective), options_(options), shared_(shared) {}

  void run(const Eigen::VectorXd& start) {
    const auto size = static_cast<unsigned>(start.size());
    optimiser_.reset(nlopt_create(size == 1 ? NLOPT_LN_SBPLX : NLOPT_LN_BOBYQA, size));
    if (!optimiser_) throw Error("NLopt could not be set up");
    nlopt_opt o = optimiser_.get();
    const auto must = [](nlopt_result result) {
      if (result < 0) throw Error("NLopt refuses its settings");
    };
    must(nlopt_set_max_objective(o, &Search::evaluate, this));
    must(nlopt_set_lower_bounds(o, options_.lower.data()));
    must(nlopt_set_upper_bounds(o, options_.upper.data()));
    must(nlopt_set_initial_step(o, options_.step.data()));
    must(nlopt_set_ftol_abs(o, options_.tolerance));
    must(nlopt_set_xtol_abs1(o, 1e-4));
    must(nlopt_set_maxeval(o, options_.most_evaluations));
    Eigen::VectorXd at = start.cwiseMax(options_.lower).cwiseMin(options_.upper);
    double value = 0.0;
    // Its result says why it ended; what is best has been kept, and rounding errors end a search that is done.
    nlopt_optimize(o, at.data(), &value);
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  static double evaluate(unsigned size, const double* at, double*, void* self) noexcept {
    return static_cast<Search*>(self)->evaluate(Eigen::Map<const Eigen::VectorXd>(at, size));
  }

  double evaluate(const Eigen::VectorXd& at) noexcept {
    try {
      const double value = objective_(at);
      const std::lock_guard lock(shared_.mutex);
      ++shared_.evaluations;
      if (std::isfinite(value) && (!shared_.best || value > shared_.best->value)) shared_.best = {at, value};
      if (options_.progress && shared_.best) options_.progress(shared_.best->at, shared_.best->value);
      if (options_.stop && options_.stop()) {
        if (shared_.best) shared_.best->stopped = true;
        nlopt_force_stop(optimiser_.get());
      }
      return value;
    } catch (...) {  // NLopt is a library of C: rethrown by run()
      failure_ = std::current_exception();
      nlopt_force_stop(optimiser_.get());
      return 0.0;
    }
  }

  const Objective& objective_;
  const SearchOptions& options_;
  Shared& shared_;
  std::unique_ptr<nlopt_opt_s, Destroy> optimiser_;
  std::exception_ptr failure_;
};

}  // namespace

void in_parallel(int count, int threads, const std::function<void(int)>& work) {
  std::atomic<int> next = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto run = [&] {
    for (int i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {  // rethrown below
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
        next = count;
      }
    }
  };
  std::vector<std::thread> others;
  for (int t = 1; t < std::min(threads, count); ++t) {
    try {
      others.emplace_back(run);
    } catch (const std::system_error&) {  // there are limits of threads; those that have started do the work
      break;
    }
  }
  run();
  for (std::thread& other : others) other.join();
  if (failure) std::rethrow_exception(failure);
}

Maximum maximise(const Objective& objective, const std::vector<Eigen::VectorXd>& starts, const SearchOptions& options) {
  Shared shared;
  in_parallel(static_cast<int>(starts.size()), options.threads,
              [&](int i) { Search(objective, options, shared).run(starts[static_cast<std::size_t>(i)]); });
  if (!shared.best) throw Error("no point that was tried has a finite objective");
  Maximum result = *shared.best;
  result.evaluations = shared.evaluations;
  result.stopped = options.stop && options.stop();
  return result;
}

}  // namespace rhec::sim
