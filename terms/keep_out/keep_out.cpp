// The vehicle stays on one side of lines (docs/terms.md).
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_options.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

struct Line {
  double x = 0.0, y = 0.0, direction = 0.0;

  static const OptionTable<Line>& table() {
    static const auto options =
        OptionTable<Line>()
            .number("x", &Line::x, "of a point on the line [m]")
            .number("y", &Line::y, "of a point on the line [m]")
            .number("direction", &Line::direction,
                    "in which one looks along the line with the vehicle's side on the left [rad]");
    return options;
  }
};

struct KeepOutOptions : LimitOptions {
  double vehicle_radius = 0.5;
  Settings lines;

  static const OptionTable<KeepOutOptions>& table() {
    using K = KeepOutOptions;
    static const auto options = with_limit_options(
        OptionTable<K>()
            .number("vehicle_radius", &K::vehicle_radius,
                    "how far the point that follows the path stays from the lines [m]", at_least(0.0))
            .map("lines", &K::lines, Line::table().schema()));
    return options;
  }
};

class KeepOut final : public Term {
 public:
  using Options = KeepOutOptions;
  explicit KeepOut(const Options& options) : options_(options) {
    const Settings& list = options.lines;
    if (!list.is_null() && list.kind() != Settings::Kind::list)
      throw list.mismatch("a list of lines, e.g. [{x: 0, y: -5, direction: 0}]");
    for (const Settings& item : list.items()) lines_.push_back(Line::table().parse(item, "term 'keep_out'"));
  }

  /// The distance from each line to the left of it.
  void write(TermWriter& writer) const override {
    for (std::size_t k = 0; k < lines_.size(); ++k) {
      const Line& line = lines_[k];
      const double sine = std::sin(line.direction), cosine = std::cos(line.direction);
      writer.limit(cosine * (writer.position_y() - line.y) - sine * (writer.position_x() - line.x), options_.softness(),
                   "line " + std::to_string(k + 1));
    }
  }
  void write_data(const TermPlace&, double*, double* lower, double* upper) const noexcept override {
    for (std::size_t k = 0; k < lines_.size(); ++k) {
      lower[k] = options_.vehicle_radius;
      upper[k] = std::numeric_limits<double>::infinity();
    }
  }

 private:
  Options options_;
  std::vector<Line> lines_;
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::term, rhec::KeepOut,
            {.name = "keep_out",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "keeps the vehicle on one side of lines"});
