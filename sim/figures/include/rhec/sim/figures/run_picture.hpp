#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/sim/figures/svg.hpp"

namespace rhec::sim {

/// What a curve shows; sets its colour and stroke.
enum class CurveRole { estimate, truth, reference, other };

/// One curve over time. NaNs interrupt it.
struct Curve {
  std::string label;
  std::vector<double> times;   ///< [s]
  std::vector<double> values;  ///< one per time
  std::vector<double> sigmas;  ///< standard deviations, drawn as a band of 2 sigma; empty: no band
  CurveRole role = CurveRole::estimate;
};

/// A diagram of curves over time.
struct Panel {
  std::string title;  ///< e.g. "Longitudinal slip kappa"
  std::string unit;   ///< e.g. "m"; "1" and empty are not shown
  std::vector<Curve> curves;
  double lower = std::numeric_limits<double>::quiet_NaN();  ///< axis limit; NaN: chosen from the values
  double upper = std::numeric_limits<double>::quiet_NaN();
};

/// Values over the plane, drawn beneath the map.
struct BaseMap {
  std::string title;                                ///< of the colour bar, e.g. "true kappa"
  std::function<double(double x, double y)> value;  ///< at a position [m]; NaN leaves a gap
  double lower = 0.0, upper = 1.0;                  ///< values at the ends of the colour bar
};

/// A part of the time.
struct Span {
  double from, to;            ///< [s]
  bool is_suspected = false;  ///< something was suspected then; else it was so
};

/// What a run looked like: the map on the left, diagrams over time on the right.
struct RunPicture {
  std::string title;
  std::string subtitle;
  std::vector<Point> path;       ///< reference path [m]
  std::vector<Point> driven;     ///< true track [m]; may be empty
  std::vector<Point> estimated;  ///< estimated track [m]; may be empty
  std::vector<Point> fixes;      ///< measured positions [m]; may be empty
  std::optional<BaseMap> base;
  std::vector<Panel> panels;
  std::vector<Span> spans = {};  ///< shaded in all panels: when something went wrong, or was thought to
};

/// The picture as an SVG document. `thin_curve` and `thin_track` thin the curves, so that files of long runs stay
/// small. Throws Error for a curve whose times, values and sigmas differ in number.
RHEC_EXPORT std::string draw_run(const RunPicture& picture);

}  // namespace rhec::sim
