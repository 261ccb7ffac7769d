#include "radau_steps.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "graph_steps.hpp"
#include "interval_lanes.hpp"

namespace rhec {
namespace {

constexpr int radau_lanes = RadauSteps::lanes;

IntervalLanes interval_lanes(const RadauPlan& plan) {
  const RadauPlaces& at = plan.places();
  return {.nx = plan.nx(),
          .np = plan.np(),
          .nu = plan.nu(),
          .nz = plan.nz(),
          .ramp = plan.has_ramp(),
          .z = at.z,
          .weights = at.weights,
          .next = at.next};
}

}  // namespace

RadauSteps::Chain::Chain(const RatesStructure& of, bool ramp, bool single)
    : plan(of, ramp, single),
      next(stored_rows(numbered(plan.places().next, of.nx), 1, plan.places().zero)),
      jacobian(stored_rows(plan.moved(), of.nx, plan.places().zero)),
      hessian(stored_rows(plan.hessian(), plan.nz(), plan.places().zero)) {}

RadauSteps::RadauSteps(std::shared_ptr<const RatesTapes> tapes, int nx, int np, int nu, bool ramp,
                       std::vector<double> scales)
    : tapes_(std::move(tapes)),
      single_(tapes_->structure(nx, np, nu), ramp, true),
      several_(tapes_->structure(nx, np, nu), ramp, false) {
  const RatesStructure structure = tapes_->structure(nx, np, nu);
  const int na = structure.na();
  for (const auto& [r, c] : structure.slopes) slopes_.push_back(nx + r * na + c);
  for (const auto& [r, c] : structure.bends) bends_.push_back(r * na + c);
  for (int q = 0; q < single_.plan.unknowns(); ++q)
    scales_.push_back(scales[static_cast<std::size_t>(single_.plan.state_of(q))]);
  const int registers =
      std::max({tapes_->rates.register_count(), tapes_->slopes.register_count(), tapes_->bends.register_count()});
  memory_ = (static_cast<std::size_t>(single_.plan.places().count) + static_cast<std::size_t>(registers)) * radau_lanes;
}

/// Eight intervals at most.
class RadauSteps::Run {
 public:
  struct Wanted {
    bool jacobian, hessian;
  };
  Run(const RadauSteps& of, const TapeKernels& kernels, double* memory, int substeps, Wanted wanted)
      : of_(of),
        plan_(of.chain(substeps).plan),
        at_(plan_.places()),
        kernels_(kernels),
        memory_(memory),
        registers_(at(at_.count)),
        substeps_(substeps),
        wanted_(wanted) {
    const RadauMethod& method = plan_.method();
    fill(at_.zero, 0.0);
    fill(at_.one, 1.0);
    for (std::uint32_t s = 0; s < 3; ++s) {
      fill(at_.sums + s, method.sums[s]);
      for (std::uint32_t t = 0; t < 3; ++t) {
        fill(at_.inverse + 3 * s + t, method.inverse[s][t]);
        fill(at_.minus_inverse + 3 * s + t, -method.inverse[s][t]);
      }
    }
  }

  double* at(std::uint32_t place) const { return memory_ + static_cast<std::size_t>(place) * radau_lanes; }
  const double* memory() const { return memory_; }
  const RadauPlan& plan() const { return plan_; }

  /// z is there, with as many lanes as are loaded; `durations` of the intervals. `store` is called when the next states
  /// and their Jacobian are there.
  template <class Store>
  void integrate(const double* durations, int count, Store store) {
    count_ = count;
    for (int i = 0; i < radau_lanes; ++i) {
      const double h = durations[std::min(i, count - 1)] * (1.0 / substeps_);
      at(at_.h)[i] = h;
      at(at_.minus_h)[i] = -h;
    }
    if (!wanted_.hessian) {
      take(substeps_, wanted_.jacobian);
      return store();
    }
    clear(at_.hessian, plan_.nz() * plan_.nz());
    for (int step = substeps_ - 1; step >= 0; --step) {
      take(step + 1, true);
      if (step == substeps_ - 1) store();
      pull_back();
    }
  }

 private:
  void multiply(RadauPlan::Products products) const { kernels_.add_products(products, memory_); }
  void fill(std::uint32_t place, double value) const { std::fill_n(at(place), radau_lanes, value); }
  void clear(std::uint32_t first, int count) const { std::fill_n(at(first), std::ptrdiff_t{count} * radau_lanes, 0.0); }
  void copy(std::uint32_t from, std::uint32_t to, int count) const {
    std::copy_n(at(from), std::ptrdiff_t{count} * radau_lanes, at(to));
  }

  /// The first `steps` steps; stages and derivatives of the last one stay.
  void take(int steps, bool with_jacobian) {
    const int nx = plan_.nx(), nz = plan_.nz();
    copy(at_.z, at_.x, nx);
    if (substeps_ > 1 && with_jacobian) {
      clear(at_.moved_start, nx * nz);
      for (int r = 0; r < nx; ++r) fill(at_.moved_start + static_cast<std::uint32_t>(r * nz + r), 1.0);
    }
    for (int step = 0; step < steps; ++step) {
      if (step > 0) begin_at_end(with_jacobian);
      for (std::uint32_t s = 0; s < 3; ++s) {
        const double run = (step + plan_.method().nodes[s]) / substeps_;
        for (int i = 0; i < radau_lanes; ++i) {
          at(at_.run + s)[i] = run;
          at(at_.rest + s)[i] = 1.0 - run;
          at(at_.h_run + s)[i] = at(at_.h)[i] * run;
          at(at_.h_rest + s)[i] = at(at_.h)[i] * (1.0 - run);
        }
      }
      solve();
      if (with_jacobian) {
        evaluate();
        factor();
        multiply(plan_.sensitivities());
      }
      multiply(plan_.next());
    }
  }

  void begin_at_end(bool with_jacobian) const {
    copy(at_.next, at_.x, plan_.nx());
    if (!with_jacobian) return;
    for (std::size_t k = 0; k < plan_.moved().size(); ++k)
      copy(plan_.moved()[k], at_.moved_start + static_cast<std::uint32_t>(k), 1);
  }

  /// Rates and slopes at the stages.
  void evaluate() {
    for (std::uint32_t s = 0; s < 3; ++s) {
      multiply(plan_.arguments(static_cast<int>(s)));
      copy_to_registers(at_.arguments[s], plan_.na(), 0);
      const Tape& tape = of_.tapes_->slopes;
      tape.run(kernels_, registers_, radau_lanes, count_);
      for (int r = 0; r < plan_.nx(); ++r) take_result(tape, r, at_.rates[s] + static_cast<std::uint32_t>(r));
      std::uint32_t to = at_.slopes[s];
      for (const int result : of_.slopes_) take_result(tape, result, to++);
    }
  }

  /// Without a search for pivots: one of which little is left has lost its digits, and becomes NaN, so that no step is
  /// found. That takes a mode that grows by e^3 in a step, or more.
  void factor() {
    multiply(plan_.matrix());
    for (int q = 0; q < plan_.unknowns(); ++q) {
      const auto s = static_cast<std::size_t>(q % RadauMethod::stages);
      const double own = plan_.method().inverse[s][s];
      const double* const diagonal = at(plan_.diagonal(q));
      double* const scale = at(at_.pivots + static_cast<std::uint32_t>(q));
      for (int i = 0; i < radau_lanes; ++i) scale[i] = own + std::abs(diagonal[i] - own);
    }
    for (int q = 0; q < plan_.unknowns(); ++q) {
      const double* const diagonal = at(plan_.diagonal(q));
      double* const pivots = at(at_.pivots + static_cast<std::uint32_t>(q));
      double* const minus = at(at_.minus_pivots + static_cast<std::uint32_t>(q));
      for (int i = 0; i < radau_lanes; ++i) {
        const bool is_lost = std::abs(diagonal[i]) < least_pivot * pivots[i];
        pivots[i] = is_lost ? std::numeric_limits<double>::quiet_NaN() : 1.0 / diagonal[i];
        minus[i] = -pivots[i];
      }
      multiply(plan_.eliminate(q));
    }
  }

  /// Newton's method for the stages, with half the step, and again half, where the residual grows.
  void solve() {
    const int unknowns = plan_.unknowns();
    std::array<bool, radau_lanes> is_done{};
    std::array<double, radau_lanes> share{}, last{};
    last.fill(std::numeric_limits<double>::infinity());
    clear(at_.moves, unknowns);
    clear(at_.base, unknowns);
    clear(at_.newton, unknowns);
    // The newest Newton step, of which `share` was taken from `base`, is in `tried`.
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
      evaluate();
      multiply(plan_.residual());
      const std::array<double, radau_lanes> size = largest(at_.residual);
      std::array<bool, radau_lanes> is_worse{};
      for (std::size_t i = 0; i < radau_lanes; ++i) {
        is_worse[i] = !is_done[i] && iteration > 0 && !(size[i] <= last[i]) && share[i] > least_share;
        if (is_worse[i]) {
          share[i] *= 0.5;
        } else {
          last[i] = size[i];
          share[i] = 1.0;
        }
      }
      factor();
      multiply(plan_.solve());
      bool are_all_done = true;
      const std::array<double, radau_lanes> length = largest(at_.newton);
      for (std::size_t i = 0; i < radau_lanes; ++i) {
        if (is_done[i]) continue;
        if (is_worse[i]) {
          move(i, at_.tried, share[i]);
        } else {
          for (std::uint32_t q = 0; q < static_cast<std::uint32_t>(unknowns); ++q) {
            at(at_.base + q)[i] = at(at_.moves + q)[i];
            at(at_.tried + q)[i] = at(at_.newton + q)[i];
          }
          move(i, at_.tried, 1.0);
          is_done[i] = length[i] <= newton_tolerance;
        }
        are_all_done &= is_done[i];
      }
      if (are_all_done) return;
    }
    constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t i = 0; i < radau_lanes; ++i) {
      if (is_done[i]) continue;
      for (const std::uint32_t place : {at_.h, at_.minus_h}) at(place)[i] = nothing;
      for (std::uint32_t q = 0; q < static_cast<std::uint32_t>(unknowns); ++q) at(at_.moves + q)[i] = nothing;
    }
  }
  static constexpr double least_share = 1.0 / 64.0, least_pivot = 1e-6;

  void move(std::size_t lane, std::uint32_t step, double share) const {
    for (std::uint32_t q = 0; q < static_cast<std::uint32_t>(plan_.unknowns()); ++q)
      at(at_.moves + q)[lane] = at(at_.base + q)[lane] + share * at(step + q)[lane];
  }

  /// In typical magnitudes of the states, or in what they have.
  std::array<double, radau_lanes> largest(std::uint32_t place) const {
    std::array<double, radau_lanes> most{};
    for (int q = 0; q < plan_.unknowns(); ++q) {
      const double* const x = at(at_.x + static_cast<std::uint32_t>(plan_.state_of(q)));
      const double* const values = at(place + static_cast<std::uint32_t>(q));
      const double scale = of_.scales_[static_cast<std::size_t>(q)];
      for (std::size_t i = 0; i < radau_lanes; ++i) {
        const double size = std::abs(values[i]) / (scale + std::abs(x[i]));
        most[i] = size <= most[i] ? most[i] : size;  // a NaN stays
      }
    }
    return most;
  }

  /// Adds the Hessian of the step that was taken last, and goes to its start.
  void pull_back() {
    multiply(plan_.adjoints());
    for (std::uint32_t s = 0; s < 3; ++s) {
      copy_to_registers(at_.arguments[s], plan_.na(), 0);
      copy_to_registers(at_.stage_weights[s], plan_.nx(), plan_.na());
      const Tape& tape = of_.tapes_->bends;
      tape.run(kernels_, registers_, radau_lanes, count_);
      std::uint32_t to = at_.bends;
      for (const int result : of_.bends_) take_result(tape, result, to++);
      multiply(plan_.curvature(static_cast<int>(s)));
    }
    copy(at_.next_weights, at_.weights, plan_.nx());
  }

  void copy_to_registers(std::uint32_t from, int count, int first) const {
    std::copy_n(at(from), std::ptrdiff_t{count} * radau_lanes, registers_ + std::ptrdiff_t{first} * radau_lanes);
  }

  void take_result(const Tape& tape, int which, std::uint32_t place) const {
    rhec::take_result(tape, which, registers_, count_, at(place));
  }

  const RadauSteps& of_;
  const RadauPlan& plan_;
  const RadauPlaces& at_;
  const TapeKernels& kernels_;
  double *memory_, *registers_;
  int substeps_, count_ = 0;
  Wanted wanted_;
};

void RadauSteps::integrate_rows(const IntervalRows& q, const TapeKernels& kernels, double* memory) const noexcept {
  Run run(*this, kernels, memory, q.substeps, {q.jacobians != nullptr, q.hessians != nullptr});
  const Chain& of = chain(q.substeps);
  integrate_rows_in_lanes(q, interval_lanes(of.plan), kernels, run, of.next, of.jacobian, of.hessian);
}

void RadauSteps::integrate(const Model::Intervals& q, const TapeKernels& kernels, double* memory) const noexcept {
  Run run(*this, kernels, memory, q.substeps, {q.jacobians != nullptr, q.hessians != nullptr});
  const RadauPlan& plan = chain(q.substeps).plan;
  integrate_in_lanes(q, interval_lanes(plan), run, plan.moved(), plan.hessian());
}

long RadauSteps::operations(bool with_jacobian, bool with_hessian) const {
  constexpr long iterations = 4;
  const long evaluation = long{RadauMethod::stages} * tapes_->slopes.instruction_count();
  long sum = iterations * (evaluation + single_.plan.iteration_operations());
  if (with_jacobian || with_hessian)
    sum += evaluation + single_.plan.iteration_operations() + single_.plan.sensitivity_operations();
  if (with_hessian)
    sum += long{RadauMethod::stages} * tapes_->bends.instruction_count() + single_.plan.hessian_operations();
  return sum;
}

}  // namespace rhec
