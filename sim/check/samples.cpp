#include "samples.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "rhec/sim/check/derivative_check.hpp"

namespace rhec::sim {
namespace {

constexpr int looked_into = 32;  // bad samples whose variables are drawn anew one by one,
constexpr int redraws = 24;      // this many times each
constexpr double narrow = 0.8;   // of its range: a variable locates the bad samples if they lie within this fraction

/// Sorted values in clusters, as "in [-1.6, -1.5] or [1.5, 1.6]"; empty if they are nearly everywhere.
std::string intervals_of(std::vector<double> values, const Samples::Dimension& d) {
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

}  // namespace

Samples::Samples(const ModelDescription& about, std::uint64_t seed, std::string_view stream) : random_(seed, stream) {
  for (const auto* variables : {&about.states, &about.inputs, &about.parameters})
    for (const Variable& variable : *variables) {
      const auto [lower, upper] = range_of(variable, reach_of_samples);
      dimensions_.push_back({variable.name, lower, upper, variable.scale});
    }
}

Samples::Point Samples::sample(int index) {
  Point z(dimensions_.size());
  const double share = index % 2 == 0 ? 0.0 : random_.uniform();
  const bool at_zero = index == 0;
  for (std::size_t j = 0; j < z.size(); ++j) {
    const Dimension& d = dimensions_[j];
    const double choice = random_.uniform();
    z[j] = draw(static_cast<int>(j));
    if (at_zero || choice < share / 3.0) {
      z[j] = std::clamp(0.0, d.lower, d.upper);
    } else if (choice < share) {
      z[j] = choice < share * 2.0 / 3.0 ? d.lower : d.upper;
    }
  }
  return z;
}

Samples::Point Samples::redrawn(Point z, int j) {
  z[j] = draw(j);
  return z;
}

std::string Samples::text_of(const Point& z) const {
  std::string text;
  for (std::size_t j = 0; j < dimensions_.size(); ++j)
    text += fmt::format("{}{} {:.4g}", j > 0 ? ", " : "", dimensions_[j].name, z[j]);
  return text;
}

std::string region_of(Samples& samples, const std::vector<Samples::Point>& bad, const PointsAreBad& are_bad) {
  std::string text;
  const std::size_t step = std::max<std::size_t>(1, bad.size() / looked_into);
  for (std::size_t j = 0; j < samples.dimensions().size(); ++j) {
    int mended = 0, drawn = 0;
    std::vector<double> values;
    values.reserve(bad.size());
    for (const auto& point : bad) values.push_back(point[j]);
    for (std::size_t k = 0; k < bad.size(); k += step) {
      std::vector<Samples::Point> others;
      others.reserve(redraws);
      for (int i = 0; i < redraws; ++i) others.push_back(samples.redrawn(bad[k], static_cast<int>(j)));
      const std::vector<bool> judged = are_bad(others);
      for (std::size_t i = 0; i < others.size(); ++i) {
        ++drawn;
        if (judged[i])
          values.push_back(others[i][j]);
        else
          ++mended;
      }
    }
    if (mended < 0.2 * drawn) continue;
    const std::string part = intervals_of(std::move(values), samples.dimensions()[j]);
    if (!part.empty()) text += (text.empty() ? "" : "; ") + part;
  }
  return text;
}

}  // namespace rhec::sim
