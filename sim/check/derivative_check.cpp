#include "rhec/sim/check/derivative_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double margin = 0.02;       // of a variable's range; difference points stay inside it
constexpr double most_scales = 10.0;  // wider bounds do not count as typical values
constexpr double distances[] = {2e-2, 2e-3, 2e-4, 2e-5, 2e-6};  // spacing of difference points, in scales

/// One entry of z = [x; u; p; p_end].
struct Entry {
  std::string name;
  double scale = 1.0;
  double step = 1.0;  ///< unit of `distances`
};

std::pair<double, double> typical_range(const Variable& variable) {
  const auto [lower, upper] = range_of(variable, 1.0);
  const double low = std::max(lower, -most_scales * variable.scale);
  const double high = std::min(upper, most_scales * variable.scale);
  return low < high ? std::pair(low, high) : std::pair(lower, upper);
}

void append(std::vector<Entry>& entries, const std::vector<Variable>& variables, const char* suffix = "") {
  for (const Variable& variable : variables) {
    const auto [lower, upper] = typical_range(variable);
    const double half = 0.5 * (upper - lower);
    entries.push_back(
        {variable.name + suffix, variable.scale, half > 0.0 ? std::min(variable.scale, half) : variable.scale});
  }
}

double& value_at(StagePoints& points, const ModelDescription& about, int stage, int entry) {
  const int nx = static_cast<int>(about.states.size()), nu = static_cast<int>(about.inputs.size()),
            np = static_cast<int>(about.parameters.size());
  if (entry < nx) return points.states[stage * nx + entry];
  if ((entry -= nx) < nu) return points.inputs[stage * nu + entry];
  if ((entry -= nu) < np) return points.parameters[stage * np + entry];
  return points.parameters_end[stage * np + entry - np];
}

/// Evaluates ranges of stages into arrays whose entries are NaN until the model writes them.
class Evaluation {
 public:
  Evaluation(const Model& model, bool ramp, int substeps) : model_(&model), ramp_(ramp), substeps_(substeps) {
    nx_ = model.state_count();
    ny_ = model.output_count();
    nz_ = nx_ + model.input_count() + (ramp ? 2 : 1) * model.parameter_count();
  }
  int entries() const { return nz_; }

  std::vector<double> next(const StagePoints& points) const {
    std::vector<double> out(points.count * nx_, none);
    auto request = intervals(points);
    request.next_states = out.data();
    model_->integrate(request);
    return out;
  }
  std::vector<double> jacobians(const StagePoints& points) const {
    std::vector<double> out(points.count * nx_ * nz_, none);
    auto request = intervals(points);
    request.jacobians = out.data();
    model_->integrate(request);
    return out;
  }
  std::vector<double> hessians(const StagePoints& points, const std::vector<double>& multipliers) const {
    std::vector<double> out(points.count * nz_ * nz_, none);
    auto request = intervals(points);
    request.multipliers = multipliers.data();
    request.hessians = out.data();
    model_->integrate(request);
    return out;
  }
  std::vector<double> outputs(const StagePoints& points) const {
    std::vector<double> out(points.count * ny_, none);
    model_->observe({.count = points.count, .states = points.states.data(), .outputs = out.data()});
    return out;
  }
  std::vector<double> output_jacobians(const StagePoints& points) const {
    std::vector<double> out(points.count * ny_ * nx_, none);
    model_->observe({.count = points.count, .states = points.states.data(), .jacobians = out.data()});
    return out;
  }
  std::vector<double> output_hessians(const StagePoints& points, const std::vector<double>& multipliers) const {
    std::vector<double> out(points.count * nx_ * nx_, none);
    model_->observe({.count = points.count,
                     .states = points.states.data(),
                     .multipliers = multipliers.data(),
                     .hessians = out.data()});
    return out;
  }

 private:
  Model::Intervals intervals(const StagePoints& points) const {
    return {.count = points.count,
            .states = points.states.data(),
            .inputs = points.inputs.data(),
            .parameters = points.parameters.data(),
            .parameters_end = ramp_ ? points.parameters_end.data() : nullptr,
            .durations = points.durations.data(),
            .substeps = substeps_};
  }

  const Model* model_;
  bool ramp_;
  int substeps_, nx_ = 0, ny_ = 0, nz_ = 0;
};

/// Reference for a column of given derivatives.
struct Differences {
  std::vector<double> slope;   ///< for the distance that agrees best; NaN if none is finite
  std::vector<double> excess;  ///< its deviation from `given` beyond rounding error
};

/// Five-point difference with respect to `entry` of the results of `evaluate` at the stages (`size` values each).
template <class Evaluate>
Differences differences(const StagePoints& stages, const ModelDescription& about, int entry, double step, int size,
                        const std::vector<double>& given, const Evaluate& evaluate) {
  const std::size_t count = static_cast<std::size_t>(stages.count) * size;
  Differences best{std::vector<double>(count, none),
                   std::vector<double>(count, std::numeric_limits<double>::infinity())};
  StagePoints moved = stages;
  std::vector<double> start(stages.count);
  for (int i = 0; i < stages.count; ++i) start[i] = value_at(moved, about, i, entry);
  for (const double distance : distances) {
    const double h = distance * step;
    std::vector<double> slope(count, 0.0), largest(count, 0.0);
    for (const auto& [steps, weight] : {std::pair{-2, 1.0}, {-1, -8.0}, {1, 8.0}, {2, -1.0}}) {
      for (int i = 0; i < stages.count; ++i) value_at(moved, about, i, entry) = start[i] + steps * h;
      const std::vector<double> values = evaluate(moved);
      for (std::size_t k = 0; k < count; ++k) {
        slope[k] += weight * values[k] / (12.0 * h);
        largest[k] = std::max(largest[k], std::abs(values[k]));
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      const double rounding = 8.0 * std::numeric_limits<double>::epsilon() * largest[k] / h;
      const double excess = std::max(0.0, std::abs(given[k] - slope[k]) - rounding);
      if (!(excess < best.excess[k])) continue;  // also skips NaN
      best.excess[k] = excess;
      best.slope[k] = slope[k];
    }
  }
  return best;
}

/// Collects entries and finds the worst in `finish`, once the magnitudes that errors are relative to are known.
class Worst {
 public:
  explicit Worst(int results) : largest_(results, 0.0) {}

  void show(int result, double factor, double given, double slope, double excess, std::string where) {
    if (!std::isfinite(given) || !std::isfinite(slope)) {
      ++skipped_;
      return;
    }
    ++compared_;
    const double size = std::abs(given) * factor;
    largest_[result] = std::max(largest_[result], size);
    if (excess > 0.0) candidates_.push_back({result, excess * factor, size, {0.0, std::move(where), given, slope}});
  }
  void finish(WorstEntry& into, DerivativeErrors& all) {
    for (Candidate& each : candidates_) {
      const double floor = std::clamp(largest_[each.result], 1e-3, 1.0);
      each.entry.error = each.excess / std::max(floor, each.size);
      if (each.entry.error > into.error) into = std::move(each.entry);
    }
    all.compared += compared_;
    all.skipped += skipped_;
  }

 private:
  struct Candidate {
    int result;
    double excess, size;
    WorstEntry entry;
  };
  std::vector<double> largest_;
  std::vector<Candidate> candidates_;
  int compared_ = 0, skipped_ = 0;
};

struct Results {
  const std::vector<Variable>* variables;
  const char* prefix;  ///< prefix of a result's name
};

/// First derivatives: `jacobians` against differences of `values`.
template <class Values, class Jacobians>
void first_derivatives(const StagePoints& stages, const ModelDescription& about, const std::vector<Entry>& entries,
                       const Results& results, const Values& values, const Jacobians& jacobians, WorstEntry& into,
                       DerivativeErrors& all) {
  const int rows = static_cast<int>(results.variables->size()), columns = static_cast<int>(entries.size());
  const std::vector<double> given = jacobians(stages);
  Worst worst(rows);
  std::vector<double> column(static_cast<std::size_t>(stages.count) * rows);
  for (int j = 0; j < columns; ++j) {
    for (int i = 0; i < stages.count; ++i)
      for (int r = 0; r < rows; ++r) column[i * rows + r] = given[(i * columns + j) * rows + r];
    const Differences found = differences(stages, about, j, entries[j].step, rows, column, values);
    for (int i = 0; i < stages.count; ++i)
      for (int r = 0; r < rows; ++r) {
        const Variable& result = (*results.variables)[r];
        worst.show(r, entries[j].scale / result.scale, column[i * rows + r], found.slope[i * rows + r],
                   found.excess[i * rows + r],
                   fmt::format("d {}{} / d {}", results.prefix, result.name, entries[j].name));
      }
  }
  worst.finish(into, all);
}

/// Checks the second derivatives of each result separately, and their sum weighted with multipliers.
template <class Jacobians, class Hessians>
void second_derivatives(const StagePoints& stages, const ModelDescription& about, const std::vector<Entry>& entries,
                        const Results& results, const Jacobians& jacobians, const Hessians& hessians, WorstEntry& into,
                        DerivativeErrors& all) {
  const int rows = static_cast<int>(results.variables->size()), n = static_cast<int>(entries.size());
  const auto squares = static_cast<std::size_t>(stages.count) * n * n;
  std::vector<std::vector<double>> given;
  std::vector<double> multipliers(static_cast<std::size_t>(stages.count) * rows, 0.0);
  std::vector<double> sum(squares, 0.0), size(squares, 0.0);
  const auto weight = [&](int r) { return (r % 2 == 0 ? 1.0 : -0.5) / (*results.variables)[r].scale; };
  for (int r = 0; r < rows; ++r) {
    std::fill(multipliers.begin(), multipliers.end(), 0.0);
    for (int i = 0; i < stages.count; ++i) multipliers[i * rows + r] = 1.0;
    given.push_back(hessians(stages, multipliers));
    for (std::size_t k = 0; k < squares; ++k) {
      sum[k] += weight(r) * given[r][k];
      size[k] += std::abs(weight(r) * given[r][k]);
    }
  }
  Worst worst(rows);
  const int per_stage = rows * n;
  std::vector<double> column(static_cast<std::size_t>(stages.count) * per_stage);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < stages.count; ++i)
      for (int m = 0; m < n; ++m)
        for (int r = 0; r < rows; ++r) column[i * per_stage + m * rows + r] = given[r][(i * n + j) * n + m];
    const Differences found = differences(stages, about, j, entries[j].step, per_stage, column, jacobians);
    for (int i = 0; i < stages.count; ++i)
      for (int m = 0; m < n; ++m)
        for (int r = 0; r < rows; ++r) {
          const Variable& result = (*results.variables)[r];
          const int k = i * per_stage + m * rows + r;
          worst.show(r, entries[j].scale * entries[m].scale / result.scale, column[k], found.slope[k], found.excess[k],
                     fmt::format("d2 {}{} / d {} d {}", results.prefix, result.name, entries[m].name, entries[j].name));
        }
  }
  for (int i = 0; i < stages.count; ++i)
    for (int r = 0; r < rows; ++r) multipliers[i * rows + r] = weight(r);
  const std::vector<double> summed = rows > 0 ? hessians(stages, multipliers) : sum;
  for (int i = 0; i < stages.count; ++i)
    for (int j = 0; j < n; ++j)
      for (int m = 0; m < n; ++m) {
        const std::size_t k = (static_cast<std::size_t>(i) * n + j) * n + m;
        const double excess = std::max(0.0, std::abs(summed[k] - sum[k]) - 1e-13 * size[k]);
        worst.show(0, entries[j].scale * entries[m].scale, summed[k], sum[k], excess,
                   fmt::format("sum of multipliers times d2 {}... / d {} d {}", results.prefix, entries[m].name,
                               entries[j].name));
      }
  if (rows > 0) worst.finish(into, all);
}

}  // namespace

std::pair<double, double> range_of(const Variable& variable, double scales) {
  const double reach =
      variable.unit == "rad" ? std::max(scales * variable.scale, std::numbers::pi) : scales * variable.scale;
  const bool below = std::isfinite(variable.lower), above = std::isfinite(variable.upper);
  return {below ? variable.lower : std::min(-reach, above ? variable.upper - reach : 0.0),
          above ? variable.upper : std::max(reach, below ? variable.lower + reach : 0.0)};
}

StagePoints random_stages(const ModelDescription& within, int count, std::uint64_t seed) {
  RandomStream random(seed, "stages of a model's check");
  StagePoints points;
  points.count = count;
  const auto draw = [&](const std::vector<Variable>& variables, bool zero, std::vector<double>& into) {
    for (const Variable& variable : variables) {
      const auto [lower, upper] = typical_range(variable);
      const double room = margin * (upper - lower);
      const double value = random.uniform(lower + room, upper - room);
      into.push_back(zero ? std::clamp(0.0, lower + room, upper - room) : value);
    }
  };
  for (int i = 0; i < count; ++i) {
    draw(within.states, i % 5 == 4, points.states);
    draw(within.inputs, i % 3 == 2, points.inputs);
    draw(within.parameters, false, points.parameters);
    draw(within.parameters, false, points.parameters_end);
    points.durations.push_back(random.uniform(0.05, 0.25));
  }
  return points;
}

DerivativeErrors derivative_errors(const Model& model, const ModelDescription& within, const StagePoints& stages,
                                   bool ramp, int substeps) {
  DerivativeErrors errors;
  const Evaluation evaluate(model, ramp, substeps);
  std::vector<Entry> states, all;
  append(states, within.states);
  all = states;
  append(all, within.inputs);
  append(all, within.parameters);
  if (ramp) append(all, within.parameters, " at the interval's end");

  const Results next{&within.states, "next "}, outputs{&within.outputs, ""};
  const auto jacobians = [&](const StagePoints& points) { return evaluate.jacobians(points); };
  const auto output_jacobians = [&](const StagePoints& points) { return evaluate.output_jacobians(points); };
  first_derivatives(
      stages, within, all, next, [&](const StagePoints& points) { return evaluate.next(points); }, jacobians,
      errors.first, errors);
  first_derivatives(
      stages, within, states, outputs, [&](const StagePoints& points) { return evaluate.outputs(points); },
      output_jacobians, errors.output_first, errors);
  if (!model.has_second_derivatives()) return errors;
  second_derivatives(
      stages, within, all, next, jacobians,
      [&](const StagePoints& points, const std::vector<double>& weights) { return evaluate.hessians(points, weights); },
      errors.second, errors);
  second_derivatives(
      stages, within, states, outputs, output_jacobians,
      [&](const StagePoints& points, const std::vector<double>& weights) {
        return evaluate.output_hessians(points, weights);
      },
      errors.output_second, errors);
  return errors;
}

WorstEntry integration_error(const Model& model, const ModelDescription& within, const StagePoints& stages, bool ramp,
                             int substeps) {
  const Evaluation evaluate(model, ramp, substeps);
  const std::vector<double> next = evaluate.next(stages);
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count();
  WorstEntry worst;
  for (int i = 0; i < stages.count; ++i) {
    const double h = stages.durations[i] / substeps;
    const auto rate = [&](const std::vector<double>& x, double steps_done) {
      std::vector<double> p(np), dxdt(nx, none);
      for (int j = 0; j < np; ++j) {
        const double from = stages.parameters[i * np + j], to = ramp ? stages.parameters_end[i * np + j] : from;
        p[j] = from + (to - from) * steps_done / substeps;
      }
      model.rates(x.data(), stages.inputs.data() + i * nu, p.data(), dxdt.data());
      return dxdt;
    };
    const auto moved = [&](std::vector<double> x, const std::vector<double>& dxdt, double time) {
      for (int j = 0; j < nx; ++j) x[j] += dxdt[j] * time;
      return x;
    };
    std::vector<double> x(stages.states.begin() + i * nx, stages.states.begin() + (i + 1) * nx);
    for (int n = 0; n < substeps; ++n) {
      const auto k1 = rate(x, n), k2 = rate(moved(x, k1, h / 2), n + 0.5), k3 = rate(moved(x, k2, h / 2), n + 0.5),
                 k4 = rate(moved(x, k3, h), n + 1);
      for (int j = 0; j < nx; ++j) x[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
    }
    for (int j = 0; j < nx; ++j) {
      const double found = next[i * nx + j];
      if (!std::isfinite(x[j]) || !std::isfinite(found)) continue;
      const double error = std::abs(found - x[j]) / std::max(std::abs(x[j]), within.states[j].scale);
      if (error > worst.error || worst.where.empty())
        worst = {error, fmt::format("next {}", within.states[j].name), found, x[j]};
    }
  }
  return worst;
}

}  // namespace rhec::sim
