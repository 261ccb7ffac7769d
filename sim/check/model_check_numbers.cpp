// Finds where within the bounds a model's values are not finite or grow without bound.
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "model_checks.hpp"
#include "samples.hpp"

namespace rhec::sim {
namespace {

constexpr double steep = 1e3;       // a derivative this many times the usual one is examined further;
constexpr double steeper = 1e2;     // it counts as unbounded if it grows by this factor in its neighbourhood
constexpr int batch_size = 64;      // samples that are evaluated together
constexpr int cheap_substeps = 16;  // as many as do not count

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

class Explorer : public Samples {
 public:
  explicit Explorer(const CheckedModel& checked)
      : Samples(checked.about, checked.options.seed, "numbers of a model"),
        model_(checked.model),
        options_(checked.options),
        substeps_(checked.substeps),
        nx_(checked.model.state_count()),
        nu_(checked.model.input_count()),
        np_(checked.model.parameter_count()),
        ny_(checked.model.output_count()),
        nz_(nx_ + nu_ + np_) {}

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
              one.slope, std::abs(jacobian_[(i * nz + j) * nx + r]) * dimensions()[j].scale / dimensions()[r].scale);
    }
    return found;
  }

  /// Whether the slope keeps growing closer to `at`.
  bool grows_on(Point at) {
    const auto slope_at = [this](const Point& z) { return look({&z, 1}, Depth::first).front().slope; };
    const double start = slope_at(at);
    double slope = start;
    for (int trial = 0; trial < 2000 && std::isfinite(slope) && slope < steeper * start; ++trial) {
      Point near = at;
      const int j = static_cast<int>(random().uniform() * nz_);
      const double width = (dimensions()[j].upper - dimensions()[j].lower) * std::pow(10.0, -8.0 * random().uniform());
      near[j] = std::clamp(near[j] + width * random().uniform(-1.0, 1.0), dimensions()[j].lower, dimensions()[j].upper);
      const double found = slope_at(near);
      if (!(found > slope)) continue;
      slope = found;
      at = near;
    }
    return slope >= steeper * start;
  }

 private:
  const Model& model_;
  const ModelCheckOptions& options_;
  const int substeps_;
  int nx_, nu_, np_, ny_, nz_;
  std::vector<double> states_, inputs_, parameters_, durations_, step_multipliers_, output_multipliers_;
  std::vector<double> next_, jacobian_, hessian_, outputs_, output_jacobian_, output_hessian_;
};

struct Tally {
  std::vector<Explorer::Point> points;
  int values = 0, first = 0, second = 0;  ///< numbers of samples where these are not finite
  int only_second = 0;
};

template <class IsBad>
std::vector<bool> judged(const std::vector<Look>& looks, const IsBad& is_bad) {
  std::vector<bool> bad;
  bad.reserve(looks.size());
  for (const Look& look : looks) bad.push_back(is_bad(look));
  return bad;
}

template <class IsBad>
void report_bad(Explorer& explorer, const Tally& bad, int samples, const char* what, FindingList& findings,
                const IsBad& is_bad) {
  if (bad.points.empty()) return;
  const Depth depth = bad.only_second == 0 ? Depth::first : Depth::all;
  const std::string region = region_of(explorer, bad.points, [&](std::span<const Explorer::Point> points) {
    return judged(explorer.look(points, depth), is_bad);
  });
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
      const std::string region = region_of(explorer, points, [&](std::span<const Explorer::Point> others) {
        return judged(explorer.look(others, Depth::first), [&](const Look& look) { return !(look.slope <= limit); });
      });
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
                              samples, reach_of_samples,
                              checked.model.has_second_derivatives() && with_second < samples
                                  ? fmt::format("; second derivatives, which take {} substeps, at {} of them",
                                                checked.substeps, with_second)
                                  : ""),
                  {{"samples", samples}});
  return findings.take();
}

}  // namespace rhec::sim
