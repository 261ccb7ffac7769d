#include "rhec/core/horizon/horizon_terms.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/base/scratch.hpp"

namespace rhec {
namespace {

/// rho, d rho / ds and d2 rho / ds2 at s = r^2.
struct LossAt {
  double value, slope, bend;
};

LossAt loss_at(const Loss& loss, double r) noexcept {
  const double s = r * r;
  if (loss.delta == infinity) return {s, 1.0, 0.0};
  const double square = loss.delta * loss.delta, root = std::sqrt(1.0 + s / square);
  return {2.0 * square * (root - 1.0), 1.0 / root, -0.5 / (square * root * root * root)};
}

/// The stages from the first to the last one of which a limit has a multiplier.
StageRange pulled(const Iterate& iterate, StageRange stages, int limits) noexcept {
  const auto pulls = [&](int i) {
    const double* const multipliers = iterate.limit_bound(i);
    bool any = false;
    for (int r = 0; r < limits; ++r) any |= multipliers[r] != 0.0;
    return any;
  };
  while (stages.first <= stages.last && !pulls(stages.first)) ++stages.first;
  while (stages.first < stages.last && !pulls(stages.last)) --stages.last;
  return stages;
}

}  // namespace

HorizonTerms::HorizonTerms(std::shared_ptr<const TermFunctions> functions, const Model& model, int max_intervals)
    : functions_(std::move(functions)),
      nx_(model.state_count()),
      np_(model.parameter_count()),
      nu_(model.input_count()) {
  if (!functions_) return;
  const auto nodes = static_cast<std::size_t>(max_intervals) + 1;
  limits_ = functions_->limit_count();
  linear_.assign(functions_->linear(), functions_->linear() + limits_);
  data_row_ = functions_->data_count();
  data_.assign(nodes * data_row_, 0.0);
  lower_.assign(nodes * limits_, -infinity);
  upper_.assign(nodes * limits_, infinity);
  own_lower_.assign(static_cast<std::size_t>(limits_), 0.0);
  own_upper_.assign(static_cast<std::size_t>(limits_), 0.0);
  for (const auto stage : {TermFunctions::Stage::first, TermFunctions::Stage::middle, TermFunctions::Stage::last}) {
    const TermFunctions::Rows& rows = functions_->rows(stage);
    most_rows_ = std::max(most_rows_, static_cast<std::size_t>(rows.count()));
    most_slopes_ = std::max(most_slopes_, rows.slopes.size());
    most_bends_ = std::max(most_bends_, rows.bends.size());
  }
}

bool HorizonTerms::is_hard(int limit) const noexcept { return std::isinf(functions_->linear()[limit]); }

void HorizonTerms::set_price(double price) noexcept {
  price_ = infinity;
  for (int limit = 0; limit < static_cast<int>(linear_.size()); ++limit) {
    if (!is_hard(limit)) continue;
    linear_[static_cast<std::size_t>(limit)] = price;
    price_ = price;
  }
}

void HorizonTerms::take_data(const HorizonTerms& from) noexcept {
  data_ = from.data_;
  lower_ = from.lower_;
  upper_ = from.upper_;
  set_price(from.price_);
}

void HorizonTerms::place(int node, const TermPlace& place) noexcept {
  if (!functions_) return;
  for (std::size_t t = 0; t < functions_->terms().size(); ++t) {
    functions_->terms()[t].term->write_data(place, data(node) + functions_->first_data_of(t), own_lower_.data(),
                                            own_upper_.data());
    for (int k = 0; k < functions_->limits_of(t); ++k) {
      const int limit = functions_->place_of(t, k);
      double least = own_lower_[static_cast<std::size_t>(k)], most = own_upper_[static_cast<std::size_t>(k)];
      // A soft limit that has no room keeps to the middle: a row has one violation, which a sum of two would not be.
      if (least > most && functions_->linear()[limit] < infinity) least = most = 0.5 * (least + most);
      lower(node)[limit] = least;
      upper(node)[limit] = most;
    }
  }
}

const TermFunctions::Rows* HorizonTerms::rows(int node, int intervals, bool is_given) const noexcept {
  const bool is_first = node == 0 && is_given, is_last = node == intervals;
  if (!functions_ || (is_first && is_last)) return nullptr;
  using Stage = TermFunctions::Stage;
  return &functions_->rows(is_first ? Stage::first : is_last ? Stage::last : Stage::middle);
}

std::size_t HorizonTerms::scratch_size(const HorizonStructure& structure) const noexcept {
  if (!functions_) return 0;
  const auto nodes = static_cast<std::size_t>(structure.capacity().intervals) + 1;
  const std::size_t of_a_node = functions_->argument_row() + 2 * most_rows_ + most_slopes_ + most_bends_;
  return nodes * of_a_node + functions_->scratch_size() + nu_ + np_ + 16;
}

/// Calls use(kind, stages) for the stages of a range, those of a kind together.
template <class Use>
void HorizonTerms::for_each_kind(const Horizon& horizon, StageRange range, const Use& use) const noexcept {
  const int N = horizon.structure.intervals();
  const auto part = [&](TermFunctions::Stage stage, int first, int last) {
    const StageRange stages{std::max(first, range.first), std::min(last, range.last)};
    if (stages.first <= stages.last && functions_->rows(stage).count() > 0) use(stage, stages);
  };
  const int first = horizon.is_given ? 1 : 0;
  if (horizon.is_given && N > 0) part(TermFunctions::Stage::first, 0, 0);
  part(TermFunctions::Stage::middle, first, N - 1);
  if (N >= first) part(TermFunctions::Stage::last, N, N);
}

void HorizonTerms::gather(const Horizon& horizon, StageRange range, const Iterate& iterate,
                          double* arguments) const noexcept {
  const int N = horizon.structure.intervals(), row = functions_->argument_row();
  const bool begins_alike = has_fixed_columns(horizon.structure);
  for (int i = range.first; i <= range.last; ++i, arguments += row) {
    double* to = std::copy_n(iterate.state(i), begins_alike && i < N ? nx_ + np_ + nu_ : nx_, arguments);
    if (i < N) {
      if (begins_alike) {
        to -= np_ + nu_;
      } else {
        horizon.structure.parameters_on(iterate, i, to);
        horizon.structure.inputs_on(iterate, i, to + np_);
      }
      to[np_ + nu_] = horizon.durations[i];
      to = std::copy_n(horizon.data + at(i, horizon.data_count), horizon.data_count, to + np_ + nu_ + 1);
    } else {
      std::copy_n(iterate.state(i) + nx_, np_, to);
      to = std::fill_n(to + np_, nu_ + 1 + horizon.data_count, 0.0);
    }
    to = std::copy_n(data(i), data_row_, to);
    std::fill(to, arguments + row, 0.0);
  }
}

/// Whether every variable of [x; p; u] is at its place in the row [s; w] of every stage.
bool HorizonTerms::has_fixed_columns(const HorizonStructure& structure) const noexcept {
  return structure.is_direct() && !structure.any_start();
}

/// The column of [s; w] of a variable of [x; p; u].
int HorizonTerms::column(const HorizonStructure& structure, int node, int argument) const noexcept {
  if (argument < nx_) return argument;
  if (argument >= nx_ + np_) return structure.column_of_input(node, argument - nx_ - np_);
  const int parameter = argument - nx_;
  const int control = node < structure.intervals() ? structure.control_of_lifted(node, parameter) : -1;
  return control >= 0 ? structure.capacity().states + control : argument;
}

void HorizonTerms::evaluate_limits(const Horizon& horizon, const Iterate& iterate, double* values,
                                   double* scratch) const noexcept {
  const int row = horizon.structure.capacity().limit_row();
  for_each_kind(horizon, {0, horizon.structure.intervals()}, [&](TermFunctions::Stage stage, StageRange stages) {
    const TermFunctions::Rows& rows = functions_->rows(stage);
    const int count = stages.last - stages.first + 1;
    Scratch memory(scratch);
    double* const arguments = memory.take(at(count, functions_->argument_row()));
    double* const all = memory.take(at(count, rows.count()));
    gather(horizon, stages, iterate, arguments);
    functions_->evaluate(stage, count, arguments, all, nullptr, memory.rest());
    for (int k = 0; k < count; ++k)
      std::copy_n(all + at(k, rows.count()), rows.limits, values + at(stages.first + k, row));
  });
}

void HorizonTerms::mark_limits(const Horizon& horizon, int node, std::uint8_t* state_flags,
                               std::uint8_t* control_flags) const noexcept {
  const HorizonStructure& structure = horizon.structure;
  const TermFunctions::Rows* const rows = this->rows(node, structure.intervals(), horizon.is_given);
  if (!rows || rows->limits == 0) return;
  const int ns = structure.capacity().states;
  std::fill_n(state_flags, rows->limits * ns, std::uint8_t{0});
  if (node < structure.intervals())
    std::fill_n(control_flags, rows->limits * structure.control_count(node), std::uint8_t{0});
  for (const auto& [r, c] : rows->slopes) {
    if (r >= rows->limits) continue;
    const int to = column(structure, node, c);
    (to < ns ? state_flags[to * rows->limits + r] : control_flags[(to - ns) * rows->limits + r]) = 1;
  }
}

void HorizonTerms::write_limit_counts(const Horizon& horizon, StageRange range, StageQp& qp) const noexcept {
  const int N = horizon.structure.intervals();
  for (int i = range.first; i <= range.last; ++i) {
    const TermFunctions::Rows* const rows = this->rows(i, N, horizon.is_given);
    qp.set_limits(i, rows ? rows->limits : 0);
  }
}

/// The bounds of limits, of which the upper ones have the values at first, and their prices.
void HorizonTerms::complete_limits(const TermFunctions::Rows& rows, StageRange stages, StageQp& qp) const noexcept {
  const double *linear = linear_.data() + rows.first_limit, *quadratic = functions_->quadratic() + rows.first_limit;
  for (int i = stages.first; i <= stages.last; ++i) {
    const double *least = lower(i) + rows.first_limit, *most = upper(i) + rows.first_limit;
    double *to_lower = qp.limit_lower(i), *to_upper = qp.limit_upper(i);
    double *to_linear = qp.limit_linear(i), *to_quadratic = qp.limit_quadratic(i);
    for (int r = 0; r < rows.limits; ++r) {
      const double value = to_upper[r];
      to_lower[r] = least[r] - value;
      to_upper[r] = most[r] - value;
      to_linear[r] = linear[r];
      to_quadratic[r] = quadratic[r];
    }
  }
}

void HorizonTerms::write_limits(const Horizon& horizon, StageRange range, const Iterate& iterate, LimitParts parts,
                                StageQp& qp, double* scratch) const noexcept {
  if (!has_limits()) return;
  write_limit_counts(horizon, range, qp);
  const bool is_fixed = has_fixed_columns(horizon.structure);
  for_each_kind(horizon, range, [&](TermFunctions::Stage stage, StageRange stages) {
    const TermFunctions::Rows& rows = functions_->rows(stage);
    const int count = stages.last - stages.first + 1, last = stages.first + (count > 1 ? 1 : 0);
    Scratch memory(scratch);
    double* const arguments = memory.take(at(count, functions_->argument_row()));
    gather(horizon, stages, iterate, arguments);
    for (int i = stages.first; parts == LimitParts::all && i <= stages.last; ++i)
      std::fill_n(qp.G(i), at(rows.limits, qp.stride()), 0.0);
    TermFunctions::LimitPlaces places{.values = qp.limit_upper(stages.first),
                                      .values_step = qp.limit_upper(last) - qp.limit_upper(stages.first)};
    if (parts == LimitParts::values || is_fixed) {
      if (parts == LimitParts::all) {
        places.slopes = qp.G(stages.first);
        places.slopes_step = qp.G(last) - qp.G(stages.first);
        places.row_length = qp.stride();
      }
      functions_->evaluate_limits(stage, count, arguments, places, memory.rest());
    } else {
      write_moved_slopes(horizon, stage, stages, arguments, qp, memory.rest());
    }
    complete_limits(rows, stages, qp);
  });
}

void HorizonTerms::write_open_limits(const Horizon& horizon, StageRange range, StageQp& qp) const noexcept {
  write_limit_counts(horizon, range, qp);
  for (int i = range.first; i <= range.last; ++i) {
    std::fill_n(qp.G(i), at(qp.limits(i), qp.stride()), 0.0);
    std::fill_n(qp.limit_lower(i), qp.limits(i), -infinity);
    std::fill_n(qp.limit_upper(i), qp.limits(i), infinity);
  }
}

bool HorizonTerms::any_pulls(const HorizonStructure& structure, const Iterate& iterate) const noexcept {
  const StageRange all{0, structure.intervals()};
  return limits_ > 0 && pulled(iterate, all, limits_).first <= all.last;
}

/// Values, as `complete_limits` expects them, and slopes by variables that are elsewhere in [s; w] than in [x; p; u].
void HorizonTerms::write_moved_slopes(const Horizon& horizon, TermFunctions::Stage stage, StageRange stages,
                                      const double* arguments, StageQp& qp, double* scratch) const noexcept {
  const TermFunctions::Rows& rows = functions_->rows(stage);
  const int count = stages.last - stages.first + 1;
  const auto slope_count = static_cast<std::ptrdiff_t>(rows.slopes.size());
  Scratch memory(scratch);
  double* const values = memory.take(at(count, rows.count()));
  double* const slopes = memory.take(count * slope_count);
  functions_->evaluate(stage, count, arguments, values, slopes, memory.rest());
  for (int i = stages.first; i <= stages.last; ++i) {
    const std::ptrdiff_t k = i - stages.first;
    std::copy_n(values + k * rows.count(), rows.limits, qp.limit_upper(i));
    const double* slope = slopes + k * slope_count;
    for (const auto& [r, c] : rows.slopes) {
      if (r < rows.limits) qp.G(i)[at(r, qp.stride()) + column(horizon.structure, i, c)] += *slope;
      ++slope;
    }
  }
}

double HorizonTerms::cost(const Horizon& horizon, const Iterate& iterate, double* stage_costs,
                          double* scratch) const noexcept {
  double total = 0.0;
  if (!has_residuals()) return total;
  for_each_kind(horizon, {0, horizon.structure.intervals()}, [&](TermFunctions::Stage stage, StageRange stages) {
    const TermFunctions::Rows& rows = functions_->rows(stage);
    const int count = stages.last - stages.first + 1;
    Scratch memory(scratch);
    double* const arguments = memory.take(at(count, functions_->argument_row()));
    double* const values = memory.take(at(count, rows.count()));
    gather(horizon, stages, iterate, arguments);
    functions_->evaluate(stage, count, arguments, values, nullptr, memory.rest());
    for (int k = 0; k < count; ++k) {
      double part = 0.0;
      for (std::size_t q = 0; q < rows.residuals.size(); ++q) {
        const Loss& loss = functions_->losses()[static_cast<std::size_t>(rows.residuals[q])];
        part += loss.weight * loss_at(loss, values[at(k, rows.count()) + rows.limits + static_cast<int>(q)]).value;
      }
      total += part;
      if (stage_costs) stage_costs[stages.first + k] += part;
    }
  });
  return total;
}

double HorizonTerms::add_cost(const Horizon& horizon, StageRange range, const Iterate& iterate, Parts parts,
                              StageQp& qp, double* scratch) const noexcept {
  double total = 0.0;
  const bool curves = parts.matrices && parts.exact;
  if (!functions_ || (!has_residuals() && !curves)) return total;
  const int stride = qp.stride();
  for_each_kind(horizon, range, [&](TermFunctions::Stage stage, StageRange stages) {
    const TermFunctions::Rows& rows = functions_->rows(stage);
    // Without residuals there is only the curvature of limits, which that of limits without multipliers is no part of.
    if (rows.residuals.empty()) stages = pulled(iterate, stages, rows.limits);
    if (stages.first > stages.last) return;
    const int count = stages.last - stages.first + 1, row_count = rows.count();
    const auto slope_count = static_cast<std::ptrdiff_t>(rows.slopes.size());
    const auto bend_count = static_cast<std::ptrdiff_t>(rows.bends.size());
    Scratch memory(scratch);
    double* const arguments = memory.take(at(count, functions_->argument_row()));
    double* const values = memory.take(at(count, row_count));
    double* const weights = memory.take(at(count, row_count));
    double* const slopes = memory.take(count * slope_count);
    double* const bends = memory.take(count * bend_count);
    gather(horizon, stages, iterate, arguments);
    if (!rows.residuals.empty()) functions_->evaluate(stage, count, arguments, values, slopes, memory.rest());
    for (int i = stages.first; i <= stages.last; ++i) {
      const std::ptrdiff_t k = i - stages.first;
      double* const weight = weights + k * row_count;
      std::copy_n(iterate.limit_bound(i), rows.limits, weight);
      for (int q = 0; q < static_cast<int>(rows.residuals.size()); ++q) {
        const int r = rows.limits + q;
        const Loss& loss = functions_->losses()[static_cast<std::size_t>(rows.residuals[static_cast<std::size_t>(q)])];
        const double residual = values[k * row_count + r];
        const LossAt at_it = loss_at(loss, residual);
        total += loss.weight * at_it.value;
        const double gradient = weight[r] = 2.0 * loss.weight * at_it.slope * residual;
        // The Gauss-Newton Hessian leaves out both second derivatives, that of the loss and that of the residual.
        const double square =
            2.0 * loss.weight * (at_it.slope + (parts.exact ? 2.0 * residual * residual * at_it.bend : 0.0));
        for (std::ptrdiff_t e = 0; e < slope_count; ++e) {
          const TermFunctions::Entry& one = rows.slopes[static_cast<std::size_t>(e)];
          if (one.row != r) continue;
          const double slope = slopes[k * slope_count + e];
          const int c = column(horizon.structure, i, one.column);
          if (parts.vectors) qp.h(i)[c] += gradient * slope;
          for (std::ptrdiff_t f = 0; parts.matrices && f < slope_count; ++f) {
            const TermFunctions::Entry& other = rows.slopes[static_cast<std::size_t>(f)];
            if (other.row != r) continue;
            qp.H(i)[at(c, stride) + column(horizon.structure, i, other.column)] +=
                square * slope * slopes[k * slope_count + f];
          }
        }
      }
    }
    if (!curves || bend_count == 0) return;
    functions_->curve(stage, count, arguments, weights, bends, memory.rest());
    for (int i = stages.first; i <= stages.last; ++i)
      for (std::ptrdiff_t e = 0; e < bend_count; ++e) {
        const TermFunctions::Entry& one = rows.bends[static_cast<std::size_t>(e)];
        const int r = column(horizon.structure, i, one.row), c = column(horizon.structure, i, one.column);
        const double bend = bends[(i - stages.first) * bend_count + e];
        qp.H(i)[at(r, stride) + c] += bend;
        if (one.row != one.column) qp.H(i)[at(c, stride) + r] += bend;
      }
  });
  return total;
}

}  // namespace rhec
