#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// A point of a drawing [pixels], y downwards; or a pair of data values.
struct Point {
  double x = 0.0, y = 0.0;
};

/// A colour as red, green and blue in [0, 1].
struct Colour {
  double red = 0.0, green = 0.0, blue = 0.0;
};
/// As '#rrggbb'.
RHEC_EXPORT std::string hex(Colour colour);
/// A palette for values in [0, 1] with uniformly increasing lightness, from deep blue-green (0) to pale sand (1):
/// everybody can see its order, and dark lines stand out on it. Interpolated in OKLCh (Ottosson 2020).
RHEC_EXPORT Colour slip_palette(double value);

/// Collects the elements of an SVG document. Styles are SVG attributes, e.g. `fill="none" stroke="#333"`.
class RHEC_EXPORT Svg {
 public:
  Svg(double width, double height);

  void line(Point from, Point to, std::string_view style);
  void rectangle(Point corner, double width, double height, std::string_view style);
  /// Points that are not finite interrupt the line.
  void polyline(std::span<const Point> points, std::string_view style);
  void polygon(std::span<const Point> points, std::string_view style);
  /// A round dot of the stroke's width at each point.
  void dots(std::span<const Point> points, std::string_view style);
  /// Escapes the text; `style` may set font-size, text-anchor, fill, transform.
  void text(Point at, std::string_view text, std::string_view style = {});
  /// Clips what is drawn before `end_group` to this rectangle.
  void begin_clip(Point corner, double width, double height);
  void begin_group(std::string_view attributes);
  void end_group();
  /// Appends a complete element as is.
  void raw(std::string_view element) { body_ += element; }

  /// The whole document.
  std::string document() const;

 private:
  double width_, height_;
  int clips_ = 0;
  std::string body_;
};

/// Round values (1, 2 or 5 times a power of ten) from lower to upper, about `wanted` of them, and their labels with no
/// more digits than they need.
struct Ticks {
  std::vector<double> values;
  std::vector<std::string> labels;
};
RHEC_EXPORT Ticks nice_ticks(double lower, double upper, int wanted);

/// Thins a curve to about `most` points, without hiding a peak: the indices of the first, last, lowest and highest
/// value of each of `most` / 4 equal stretches, in order. Short curves keep every point. NaNs that interrupt the curve
/// are kept.
RHEC_EXPORT std::vector<std::size_t> thin_curve(std::span<const double> values, std::size_t most = 2000);

/// Thins a track to `most` points (not counting gaps): drops points closer than a tolerance to the last one kept. The
/// tolerance starts at `tolerance` and doubles until few enough points remain; it bounds the error of the drawn track.
RHEC_EXPORT std::vector<Point> thin_track(std::span<const Point> track, double tolerance, std::size_t most = 2000);

}  // namespace rhec::sim
