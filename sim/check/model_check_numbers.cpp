// Finds where within the bounds a model's values are not finite or grow without bound.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "model_checks.hpp"
#include "rhec/sim/check/derivative_check.hpp"
#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {
namespace {

constexpr double reach = 3.0;       // of variables without bounds, in scales
constexpr double steep = 1e3;       // a derivative this many times the usual one is examined further;
constexpr double steeper = 1e2;     // it counts as unbounded if it grows by this factor in its neighbourhood
constexpr int looked_into = 32;     // bad samples whose variables are redrawn one by one,
constexpr int redraws = 24;         // this many times each
constexpr int batch_size = 64;      // samples that are evaluated together
constexpr int cheap_substeps = 16;  // as many as do not count
constexpr double narrow = 0.8;      // of its range: a variable locates the bad samples if they lie within this fraction

/// Results for one sample.
struct Look {
  // Whether there are entries of F and of h that are not finite.
  bool values = false, first = false, second = false;
  bool outputs = false, output_first = false, output_second = false;
  double slope = 0.0;  ///< largest entry of F's Jacobian, in scales

  bool bad_step() const { return values || first || second; }
  bool bad_output() const { return outputs || output_first || output_second; }
};

/// Up to which derivatives. Second ones take most of the time.
enum class Depth { first, all };

struct Dimension {
  std::string name;
  double lower, upper, scale;
};

class Explorer {
 public:
  explicit Explorer(const CheckedModel& checked)
      : model_(checked.model),
        options_(checked.options),
        substeps_(checked.substeps),
        nx_(checked.model.state_count()),
        nu_(checked.model.input_count()),
        np_(checked.model.parameter_count()),
        ny_(checked.model.output_count()),
        nz_(nx_ + nu_ + np_),
        random_(checked.options.seed, "numbers of a model") {
    for (const auto* variables : {&checked.about.states, &checked.about.inputs, &checked.about.parameters})
      for (const Variable& variable : *variables) {
        const auto [lower, upper] = range_of(variable, reach);
        dimensions_.push_back({variable.name, lower, upper, variable.scale});
      }
  }

  using Point = std::vector<double>;
  const std::vector<Dimension>& dimensions() const { return dimensions_; }

  /// Evaluates samples as one range of stages, which is quicker than one by one.
  std::vector<Look> look(std::span<const Point> points, Depth depth) {
    constexpr double unwritten = std::numeric_limits<double>::quiet_NaN();
    const bool second = depth == Depth::all && model_.has_second_derivatives();
    const std::size_t count = points.size(), nx = nx_, ny = ny_, nz = nz_;
    for (auto* part : {&states_, &inputs_, &parameters_}) part->clear();
    for (const Point& z : points) {
      states_.insert(states_.end(), z.begin(), z.begin() + nx_);
      inputs_.insert(inputs_.end(), z.begin() + nx_, z.begin() + nx_ + nu_);
      parameters_.insert(parameters_.end(), z.begin() + nx_ + nu_, z.end());
    }
    next_.assign(count * nx, unwritten);
    jacobian_.assign(count * nx * nz, unwritten);
    hessian_.assign(second ? count * nz * nz : 0, unwritten);
    outputs_.assign(count * ny, unwritten);
    output_jacobian_.assign(count * ny * nx, unwritten);
    output_hessian_.assign(second ? count * nx * nx : 0, unwritten);
    durations_.assign(count, options_.interval);
    step_multipliers_.assign(count * nx, 1.0);
    output_multipliers_.assign(count * ny, 1.0);
    Model::Intervals step{.count = static_cast<int>(count),
                          .states = states_.data(),
                          .inputs = inputs_.data(),
                          .parameters = parameters_.data(),
                          .durations = durations_.data(),
                          .substeps = substeps_,
                          .next_states = next_.data(),
                          .jacobians = jacobian_.data()};
    Model::Nodes node{.count = static_cast<int>(count),
                      .states = states_.data(),
                      .outputs = outputs_.data(),
                      .jacobians = output_jacobian_.data()};
    if (second) {
      step.multipliers = step_multipliers_.data();
      step.hessians = hessian_.data();
      node.multipliers = output_multipliers_.data();
      node.hessians = output_hessian_.data();
    }
    model_.integrate(step);
    model_.observe(node);
    std::vector<Look> found(count);
    for (std::size_t i = 0; i < count; ++i) {
      const auto bad = [i, count](const std::vector<double>& array) {
        const auto size = static_cast<std::ptrdiff_t>(array.size() / count);
        const auto begin = array.begin() + static_cast<std::ptrdiff_t>(i) * size;
        return std::any_of(begin, begin + size, [](double value) { return !std::isfinite(value); });
      };
      Look& one = found[i];
      one = {bad(next_), bad(jacobian_), bad(hessian_), bad(outputs_), bad(output_jacobian_), bad(output_hessian_)};
      for (std::size_t j = 0; j < nz; ++j)
        for (std::size_t r = 0; r < nx; ++r)
          one.slope = std::max(
              one.slope, std::abs(jacobian_[(i * nz + j) * nx + r]) * dimensions_[j].scale / dimensions_[r].scale);
    }
    return found;
  }

  double draw(int j) { return random_.uniform(dimensions_[j].lower, dimensions_[j].upper); }

  /// Half of the samples are uniform; the others have some or all variables at a bound or at zero.
  Point sample(int index) {
    Point z(nz_);
    const double share = index % 2 == 0 ? 0.0 : random_.uniform();
    const bool at_zero = index == 0;
    for (int j = 0; j < nz_; ++j) {
      const Dimension& d = dimensions_[j];
      const double choice = random_.uniform();
      z[j] = draw(j);
      if (at_zero || choice < share / 3.0) {
        z[j] = std::clamp(0.0, d.lower, d.upper);
      } else if (choice < share) {
        z[j] = choice < share * 2.0 / 3.0 ? d.lower : d.upper;
      }
    }
    return z;
  }

  /// The same point with one variable redrawn.
  Point redrawn(Point z, int j) {
    z[j] = draw(j);
    return z;
  }

  /// Whether the slope keeps growing closer to `at`.
  bool grows_on(Point at) {
    const auto slope_at = [this](const Point& z) { return look({&z, 1}, Depth::first).front().slope; };
    const double start = slope_at(at);
    double slope = start;
    for (int trial = 0; trial < 2000 && std::isfinite(slope) && slope < steeper * start; ++trial) {
      Point near = at;
      const int j = static_cast<int>(random_.uniform() * nz_);
      const double width = (dimensions_[j].upper - dimensions_[j].lower) * std::pow(10.0, -8.0 * random_.uniform());
      near[j] = std::clamp(near[j] + width * random_.uniform(-1.0, 1.0), dimensions_[j].lower, dimensions_[j].upper);
      const double found = slope_at(near);
      if (!(found > slope)) continue;
      slope = found;
      at = near;
    }
    return slope >= steeper * start;
  }

  std::string text_of(const Point& z) const {
    std::string text;
    for (int j = 0; j < nz_; ++j) text += fmt::format("{}{} {:.4g}", j > 0 ? ", " : "", dimensions_[j].name, z[j]);
    return text;
  }

 private:
  const Model& model_;
  const ModelCheckOptions& options_;
  const int substeps_;
  int nx_, nu_, np_, ny_, nz_;
  RandomStream random_;
  std::vector<Dimension> dimensions_;
  std::vector<double> states_, inputs_, parameters_, durations_, step_multipliers_, output_multipliers_;
  std::vector<double> next_, jacobian_, hessian_, outputs_, output_jacobian_, output_hessian_;
};

/// Sorted values in clusters, as "in [-1.6, -1.5] or [1.5, 1.6]"; empty if they are nearly everywhere.
std::string intervals_of(std::vector<double> values, const Dimension& d) {
  if (values.empty() || !(d.upper > d.lower)) return {};
  std::sort(values.begin(), values.end());
  const double width = d.upper - d.lower;
  std::vector<std::array<double, 2>> clusters = {{values[0], values[0]}};
  for (const double value : values) {
    if (value - clusters.back()[1] > 0.1 * width) clusters.push_back({value, value});
    clusters.back()[1] = value;
  }
  double covered = 0.0;
  for (const auto& [low, high] : clusters) covered += high - low;
  if (covered > narrow * width) return {};
  std::string text = fmt::format("{} ", d.name);
  for (std::size_t k = 0; k < clusters.size(); ++k) {
    const auto [low, high] = clusters[k];
    text += k > 0 ? " or " : "";
    text += high - low > 1e-9 * width ? fmt::format("in [{:.4g}, {:.4g}]", low, high) : fmt::format("at {:.4g}", low);
  }
  return text;
}

/// The variables that decide whether a sample is bad, and the ranges where it is; "" if there are none. A variable
/// decides if redrawing it alone often fixes a bad sample.
template <class IsBad>
std::string region_of(Explorer& explorer, const std::vector<Explorer::Point>& bad, Depth depth, const IsBad& is_bad) {
  std::string text;
  const std::size_t step = std::max<std::size_t>(1, bad.size() / looked_into);
  for (std::size_t j = 0; j < explorer.dimensions().size(); ++j) {
    int mended = 0, drawn = 0;
    std::vector<double> values;
    values.reserve(bad.size());
    for (const auto& point : bad) values.push_back(point[j]);
    for (std::size_t k = 0; k < bad.size(); k += step) {
      std::vector<Explorer::Point> others;
      others.reserve(redraws);
      for (int i = 0; i < redraws; ++i) others.push_back(explorer.redrawn(bad[k], static_cast<int>(j)));
      const std::vector<Look> looks = explorer.look(others, depth);
      for (std::size_t i = 0; i < others.size(); ++i) {
        ++drawn;
        if (is_bad(looks[i]))
          values.push_back(others[i][j]);
        else
          ++mended;
      }
    }
    if (mended < 0.2 * drawn) continue;
    const std::string part = intervals_of(std::move(values), explorer.dimensions()[j]);
    if (!part.empty()) text += (text.empty() ? "" : "; ") + part;
  }
  return text;
}

struct Tally {
  std::vector<Explorer::Point> points;
  int values = 0, first = 0, second = 0;  ///< numbers of samples where these are not finite
  int only_second = 0;
};

template <class IsBad>
void report_bad(Explorer& explorer, const Tally& bad, int samples, const char* what, FindingList& findings,
                const IsBad& is_bad) {
  if (bad.points.empty()) return;
  const Depth depth = bad.only_second == 0 ? Depth::first : Depth::all;
  const std::string region = region_of(explorer, bad.points, depth, is_bad);
  findings.fail(
      region.empty() ? "anywhere" : region,
      fmt::format(
          "{} of {} samples give {} or derivatives that are not finite (values {}, first derivatives {}, second "
          "{}), e.g. at {}",
          bad.points.size(), samples, what, bad.values, bad.first, bad.second, explorer.text_of(bad.points.front())),
      "narrow the bounds to where the formula holds, or write it so that it holds there; and write all that is asked "
      "for",
      {{"samples", samples},
       {"bad", static_cast<double>(bad.points.size())},
       {"values", bad.values},
       {"first", bad.first},
       {"second", bad.second}});
}

}  // namespace

std::vector<Finding> check_numbers(const CheckedModel& checked) {
  FindingList findings("numbers");
  Explorer explorer(checked);
  const int samples = checked.options.samples;
  Tally step, output;
  std::vector<std::pair<double, Explorer::Point>> slopes;
  // Of a stiff model the second derivatives of some samples have to do.
  const int batches_for_second = 1 + (checked.substeps - 1) / cheap_substeps;
  int with_second = 0;
  std::vector<Explorer::Point> batch;
  std::vector<Look> looks;
  for (int i = 0; i < samples; ++i) {
    const std::size_t at = i % batch_size;
    if (at == 0) {
      batch.clear();
      for (int k = i; k < std::min(samples, i + batch_size); ++k) batch.push_back(explorer.sample(k));
      const bool all = i / batch_size % batches_for_second == 0;
      looks = explorer.look(batch, all ? Depth::all : Depth::first);
      with_second += all ? static_cast<int>(batch.size()) : 0;
    }
    Explorer::Point& z = batch[at];
    const Look& look = looks[at];
    if (look.bad_output()) {
      output.points.push_back(z);
      output.values += look.outputs;
      output.first += look.output_first;
      output.second += look.output_second;
      output.only_second += !look.outputs && !look.output_first;
    }
    if (look.bad_step()) {
      step.points.push_back(std::move(z));
      step.values += look.values;
      step.first += look.first;
      step.second += look.second;
      step.only_second += !look.values && !look.first;
    } else {
      slopes.emplace_back(look.slope, std::move(z));
    }
  }
  report_bad(explorer, step, samples, "next states", findings, [](const Look& look) { return look.bad_step(); });
  report_bad(explorer, output, samples, "outputs", findings, [](const Look& look) { return look.bad_output(); });

  if (!slopes.empty()) {
    std::sort(slopes.begin(), slopes.end());
    const double limit = steep * std::max(1.0, slopes[slopes.size() / 2].first);
    std::vector<Explorer::Point> points;
    for (auto& [slope, point] : slopes)
      if (slope > limit) points.push_back(std::move(point));
    // Start from the least steep one: at the pole itself, rounding limits the growth.
    if (!points.empty() && explorer.grows_on(points.front())) {
      const std::string region =
          region_of(explorer, points, Depth::first, [&](const Look& look) { return !(look.slope <= limit); });
      findings.warn(region.empty() ? "anywhere" : region,
                    fmt::format("{} of {} samples are near a pole: derivatives of next states grow without bound, e.g. "
                                "at {}",
                                points.size(), samples, explorer.text_of(points.front())),
                    "give bounds that keep away from it", {{"samples", samples}, {"steep", points.size()}});
    }
  }
  if (findings.empty())
    findings.pass(fmt::format("{} samples inside the bounds (without bounds: within {:g} scales, of angles pi), their "
                              "edges and zeros: all finite{}",
                              samples, reach,
                              checked.model.has_second_derivatives() && with_second < samples
                                  ? fmt::format("; second derivatives, which take {} substeps, at {} of them",
                                                checked.substeps, with_second)
                                  : ""),
                  {{"samples", samples}});
  return findings.take();
}

}  // namespace rhec::sim
