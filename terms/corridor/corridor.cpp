// The vehicle stays between two edges beside the path (docs/terms.md).
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_options.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct CorridorOptions : LimitOptions {
  double left = 2.0, right = 2.0, margin = 0.0;
  std::vector<double> along, left_along, right_along;

  static const OptionTable<CorridorOptions>& table() {
    using C = CorridorOptions;
    static const auto options = with_limit_options(
        OptionTable<C>()
            .number("left", &C::left, "distance of the left edge from the path, where its waypoints do not say it [m]",
                    or_infinite(any()))
            .number("right", &C::right,
                    "distance of the right edge from the path, where its waypoints do not say it [m]",
                    or_infinite(any()))
            .number("margin", &C::margin, "how far the point that follows the path stays from either edge [m]",
                    at_least(0.0))
            .numbers("along", &C::along,
                     "distances along the path [m], increasing, at which left_along and right_along are given; between "
                     "them edges are straight, beyond them as at the nearest")
            .numbers("left_along", &C::left_along, "instead of left, one for each of along [m]", or_infinite(any()))
            .numbers("right_along", &C::right_along, "instead of right, one for each of along [m]",
                     or_infinite(any())));
    return options;
  }
};

class Corridor final : public Term {
 public:
  using Options = CorridorOptions;
  explicit Corridor(const Options& options) : options_(options) {
    const std::size_t count = options_.along.size();
    if (std::ranges::adjacent_find(options_.along, std::greater_equal<>()) != options_.along.end())
      throw Error("along: expected distances that increase");
    for (const auto* edge : {&options_.left_along, &options_.right_along})
      if (!edge->empty() && edge->size() != count)
        throw Error("left_along, right_along: expected one number for each of along");
    if (count > 0 && options_.left_along.empty() && options_.right_along.empty())
      throw Error("along: expected left_along or right_along beside it");
    for (std::size_t k = 0; k < std::max<std::size_t>(count, 1); ++k)
      if (at(k, options_.left_along, options_.left) + at(k, options_.right_along, options_.right) <=
          2.0 * options_.margin)
        throw Error(
            "left, right: no room is left between the edges and their margins; expected left + right above "
            "2 margin");
  }

  /// The signed distance from the tangent of the path at the reference position.
  void write(TermWriter& writer) const override {
    const Expression sine = writer.data("sine"), cosine = writer.data("cosine"), origin = writer.data("origin");
    writer.limit(cosine * writer.position_y() - sine * writer.position_x() - origin, options_.softness(), "lateral");
  }
  void write_data(const TermPlace& place, double* data, double* lower, double* upper) const noexcept override {
    const double sine = std::sin(place.heading), cosine = std::cos(place.heading);
    data[0] = sine;
    data[1] = cosine;
    data[2] = cosine * place.y - sine * place.x;
    const auto room = [&](double of_path, const std::vector<double>& along, double constant) {
      return std::isfinite(of_path) ? of_path : edge(place.arc_length, along, constant);
    };
    *lower = options_.margin - room(place.right, options_.right_along, options_.right);
    *upper = room(place.left, options_.left_along, options_.left) - options_.margin;
  }

 private:
  static double at(std::size_t k, const std::vector<double>& edge, double constant) {
    return edge.empty() ? constant : edge[k];
  }
  double edge(double arc_length, const std::vector<double>& values, double constant) const noexcept {
    if (values.empty()) return constant;
    const std::vector<double>& along = options_.along;
    const auto next = std::ranges::upper_bound(along, arc_length);
    if (next == along.begin()) return values.front();
    if (next == along.end()) return values.back();
    const auto k = static_cast<std::size_t>(next - along.begin());
    const double share = (arc_length - along[k - 1]) / (along[k] - along[k - 1]);
    return (1.0 - share) * values[k - 1] + share * values[k];
  }

  Options options_;
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::term, rhec::Corridor,
            {.name = "corridor",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "keeps the vehicle between two edges beside the path"});
