#include "staged_steps.hpp"

#include <algorithm>
#include <utility>

#include "graph_steps.hpp"
#include "interval_lanes.hpp"
#include "rhec/core/base/padded.hpp"

namespace rhec {
namespace {

constexpr int lanes = StagedSteps::lanes;

IntervalLanes interval_lanes(const ChainRulePlaces& at) {
  return {.nx = at.nx,
          .np = at.np,
          .nu = at.nu,
          .nz = at.nz,
          .ramp = at.ramp,
          .z = at.z,
          .weights = at.weights,
          .next = at.next};
}

}  // namespace

StoredRows stored_rows(const std::vector<std::uint32_t>& registers, int rows, std::uint32_t zero) {
  const int columns = rows > 0 ? static_cast<int>(registers.size()) / rows : 0;
  StoredRows made{.rows = rows, .eights = padded(columns) / 8, .all = {}};
  for (int r = 0; r < rows; ++r) {
    for (int from = 0; from < columns; from += 8) {
      StoredEight eight;
      int varying = 0;
      for (int k = 0; k < 8; ++k) {
        const std::uint32_t source =
            from + k < columns ? registers[static_cast<std::size_t>(r) * columns + from + k] : zero;
        if (source != zero) varying = k + 1;
        eight.sources[static_cast<std::size_t>(k)] = static_cast<std::int32_t>(source) * lanes;
      }
      eight.kind = varying == 0   ? StoredEight::Kind::constant
                   : varying <= 4 ? StoredEight::Kind::first_4
                                  : StoredEight::Kind::all;
      made.all.push_back(eight);
    }
  }
  return made;
}

RatesStructure RatesTapes::structure(int nx, int np, int nu) const {
  RatesStructure found{.nx = nx, .np = np, .nu = nu, .slopes = {}, .bends = {}};
  const int na = found.na();
  const auto is_zero = [](const Tape& tape, int which) {
    return tape.results()[static_cast<std::size_t>(which)] == Tape::zero;
  };
  for (int r = 0; r < nx; ++r)
    for (int c = 0; c < na; ++c)
      if (!is_zero(slopes, nx + r * na + c)) found.slopes.push_back({r, c});
  for (int r = 0; r < na; ++r)
    for (int c = 0; c <= r; ++c)
      if (!is_zero(bends, r * na + c)) found.bends.push_back({r, c});
  return found;
}

StagedSteps::Chain::Chain(const RatesStructure& of, const ChainRulePlaces& at, bool single)
    : rule(of, at, single),
      jacobian(stored_rows(rule.moved(), at.nx, at.zero)),
      hessian(stored_rows(rule.hessian(), at.nz, at.zero)) {}

StagedSteps::StagedSteps(std::shared_ptr<const RatesTapes> tapes, int nx, int np, int nu, bool ramp)
    : tapes_(std::move(tapes)),
      structure_(tapes_->structure(nx, np, nu)),
      at_(structure_, ramp),
      single_(structure_, at_, true),
      several_(structure_, at_, false),
      next_(stored_rows(numbered(at_.next, nx), 1, at_.zero)) {
  const int na = structure_.na();
  for (const auto& [r, c] : structure_.slopes) slopes_.push_back(nx + r * na + c);
  for (const auto& [r, c] : structure_.bends) bends_.push_back(r * na + c);
  const int registers =
      std::max({tapes_->rates.register_count(), tapes_->slopes.register_count(), tapes_->bends.register_count()});
  memory_ = (static_cast<std::size_t>(at_.count) + static_cast<std::size_t>(registers)) * lanes;
}

/// Eight intervals at most.
class StagedSteps::Run {
 public:
  struct Wanted {
    bool jacobian, hessian;
  };
  Run(const StagedSteps& of, const TapeKernels& kernels, double* memory, int substeps, Wanted wanted)
      : of_(of),
        at_(of.at_),
        chain_(substeps == 1 ? of.single_ : of.several_),
        kernels_(kernels),
        memory_(memory),
        registers_(at(of.at_.count)),
        substeps_(substeps),
        wanted_(wanted) {
    std::fill_n(at(at_.zero), lanes, 0.0);
    std::fill_n(at(at_.one), lanes, 1.0);
  }

  double* at(std::uint32_t place) const { return memory_ + static_cast<std::size_t>(place) * lanes; }
  const double* memory() const { return memory_; }

  /// z is there, with as many lanes as are loaded; `durations` of the intervals. `store` is called when the next states
  /// and their Jacobian are there.
  template <class Store>
  void integrate(const double* durations, int count, Store store) {
    count_ = count;
    for (int i = 0; i < lanes; ++i) {
      const double h = durations[std::min(i, count - 1)] * (1.0 / substeps_);
      for (std::uint32_t k = 0; k < 4; ++k) {
        at(at_.reach + k)[i] = h * ClassicalMethod::reach[k];
        at(at_.share + k)[i] = h * ClassicalMethod::share[k];
      }
    }
    if (!wanted_.hessian) {
      take(substeps_, wanted_.jacobian);
      return store();
    }
    if (substeps_ > 1) {
      std::fill_n(at(at_.pull), matrix(), 0.0);
      std::fill_n(at(at_.entry(at_.hessian, at_.nx, 0)), std::ptrdiff_t{at_.nz - at_.nx} * at_.nz * lanes, 0.0);
    }
    for (int step = substeps_ - 1; step >= 0; --step) {
      take(step + 1, true);
      if (step == substeps_ - 1) store();
      pull_back();
    }
  }

 private:
  std::ptrdiff_t matrix() const { return std::ptrdiff_t{at_.nx} * at_.nz * lanes; }
  void multiply(ChainRule::Products products) const { kernels_.add_products(products, memory_); }
  void copy(std::uint32_t from, std::uint32_t to, int count) const {
    std::copy_n(at(from), std::ptrdiff_t{count} * lanes, at(to));
  }

  /// The first `steps` steps; stages and derivatives of the last one stay.
  void take(int steps, bool with_jacobian) {
    copy(at_.z, at_.x, at_.nx);
    if (substeps_ > 1 && with_jacobian) {
      std::fill_n(at(at_.moved[0]), matrix(), 0.0);
      for (int r = 0; r < at_.nx; ++r) std::fill_n(at(at_.entry(at_.moved[0], r, r)), lanes, 1.0);
    }
    for (int step = 0; step < steps; ++step) {
      if (step > 0) {
        copy(at_.next, at_.x, at_.nx);
        if (with_jacobian) std::copy_n(at(at_.moved_next), matrix(), at(at_.moved[0]));
      }
      for (std::uint32_t k = 0; k < 4 && at_.ramp; ++k) {
        const double moved = (step + ClassicalMethod::reach[k]) / substeps_;
        std::fill_n(at(at_.run + k), lanes, moved);
        std::fill_n(at(at_.rest + k), lanes, 1.0 - moved);
      }
      for (int k = 0; k < 4; ++k) {
        multiply(chain_.rule.arguments(k));
        const auto stage = static_cast<std::size_t>(k);
        std::copy_n(at(at_.arguments[stage]), std::ptrdiff_t{at_.na} * lanes, registers_);
        const Tape& tape = with_jacobian ? of_.tapes_->slopes : of_.tapes_->rates;
        tape.run(kernels_, registers_, lanes, count_);
        for (int r = 0; r < at_.nx; ++r) take_result(tape, r, at_.rates[stage] + static_cast<std::uint32_t>(r));
        if (!with_jacobian) continue;
        std::uint32_t to = at_.slopes[stage];
        for (const int result : of_.slopes_) take_result(tape, result, to++);
        multiply(chain_.rule.forward(k));
      }
      multiply(chain_.rule.next());
    }
  }

  /// Adds the Hessian of the step that was taken last, and goes to its start.
  void pull_back() {
    for (int k = 3; k >= 0; --k) {
      multiply(chain_.rule.adjoints(k));
      const auto stage = static_cast<std::size_t>(k);
      double* const weights = std::copy_n(at(at_.arguments[stage]), std::ptrdiff_t{at_.na} * lanes, registers_);
      std::copy_n(at(at_.adjoints[stage]), std::ptrdiff_t{at_.nx} * lanes, weights);
      const Tape& tape = of_.tapes_->bends;
      tape.run(kernels_, registers_, lanes, count_);
      std::uint32_t to = at_.bends;
      for (const int result : of_.bends_) take_result(tape, result, to++);
      multiply(chain_.rule.backward(k));
    }
    if (substeps_ == 1) return;
    multiply(chain_.rule.weights());
    copy(at_.next_weights, at_.weights, at_.nx);
    std::copy_n(at(at_.pull_next), matrix(), at(at_.pull));
  }

  void take_result(const Tape& tape, int which, std::uint32_t place) const {
    rhec::take_result(tape, which, registers_, count_, at(place));
  }

  const StagedSteps& of_;
  const ChainRulePlaces& at_;
  const Chain& chain_;
  const TapeKernels& kernels_;
  double *memory_, *registers_;
  int substeps_, count_ = 0;
  Wanted wanted_;
};

void StagedSteps::integrate_rows(const IntervalRows& q, const TapeKernels& kernels, double* memory) const noexcept {
  Run run(*this, kernels, memory, q.substeps, {q.jacobians != nullptr, q.hessians != nullptr});
  const Chain& chain = q.substeps == 1 ? single_ : several_;
  integrate_rows_in_lanes(q, interval_lanes(at_), kernels, run, next_, chain.jacobian, chain.hessian);
}

void StagedSteps::integrate(const Model::Intervals& q, const TapeKernels& kernels, double* memory) const noexcept {
  Run run(*this, kernels, memory, q.substeps, {q.jacobians != nullptr, q.hessians != nullptr});
  const ChainRule& rule = (q.substeps == 1 ? single_ : several_).rule;
  integrate_in_lanes(q, interval_lanes(at_), run, rule.moved(), rule.hessian());
}

long StagedSteps::operations(bool with_jacobian, bool with_hessian) const {
  const long stages = 4;
  if (!with_jacobian && !with_hessian) return stages * (tapes_->rates.instruction_count() + 2L * at_.na);
  long sum = stages * tapes_->slopes.instruction_count() + single_.rule.operations(with_hessian);
  if (with_hessian) sum += stages * tapes_->bends.instruction_count();
  return sum;
}

}  // namespace rhec
