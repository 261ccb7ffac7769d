#include "rhec/sim/figures/svg.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace rhec::sim {
namespace {

// Hundredths of a pixel are finer than the eye can see.
std::string number(double value) {
  std::string text = fmt::format("{:.2f}", value);
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

std::string escaped(std::string_view text) {
  std::string result;
  for (char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
    }
  }
  return result;
}

bool is_finite(Point point) { return std::isfinite(point.x) && std::isfinite(point.y); }

double to_srgb(double linear) {
  const double value = std::clamp(linear, 0.0, 1.0);
  return value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1.0 / 2.4) - 0.055;
}

// OKLCh to sRGB; hue in degrees.
Colour from_oklch(double lightness, double chroma, double hue) {
  const double a = chroma * std::cos(hue * std::numbers::pi / 180.0),
               b = chroma * std::sin(hue * std::numbers::pi / 180.0);
  const double l = std::pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3);
  const double m = std::pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3);
  const double s = std::pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3);
  return {to_srgb(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
          to_srgb(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
          to_srgb(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s)};
}

}  // namespace

std::string hex(Colour colour) {
  const auto byte = [](double part) { return static_cast<int>(std::lround(255.0 * std::clamp(part, 0.0, 1.0))); };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(colour.red), byte(colour.green), byte(colour.blue));
}

Colour slip_palette(double value) {
  const double t = std::isnan(value) ? 0.0 : std::clamp(value, 0.0, 1.0);
  return from_oklch(0.52 + 0.44 * t, 0.085 - 0.045 * t, 225.0 - 130.0 * t);
}

Svg::Svg(double width, double height) : width_(width), height_(height) {}

void Svg::line(Point from, Point to, std::string_view style) {
  fmt::format_to(std::back_inserter(body_), "<path d=\"M{} {}L{} {}\" {}/>\n", number(from.x), number(from.y),
                 number(to.x), number(to.y), style);
}

void Svg::rectangle(Point corner, double width, double height, std::string_view style) {
  fmt::format_to(std::back_inserter(body_), "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" {}/>\n",
                 number(corner.x), number(corner.y), number(width), number(height), style);
}

void Svg::polyline(std::span<const Point> points, std::string_view style) {
  std::string data;
  bool pen_down = false;
  for (Point point : points) {
    if (is_finite(point)) data += fmt::format("{}{} {}", pen_down ? 'L' : 'M', number(point.x), number(point.y));
    pen_down = is_finite(point);
  }
  if (!data.empty()) {
    fmt::format_to(std::back_inserter(body_), "<path d=\"{}\" fill=\"none\" stroke-linejoin=\"round\" {}/>\n", data,
                   style);
  }
}

void Svg::polygon(std::span<const Point> points, std::string_view style) {
  std::string data;
  for (Point point : points) {
    if (is_finite(point)) data += fmt::format("{}{} {}", data.empty() ? 'M' : 'L', number(point.x), number(point.y));
  }
  if (!data.empty()) fmt::format_to(std::back_inserter(body_), "<path d=\"{}Z\" {}/>\n", data, style);
}

void Svg::dots(std::span<const Point> points, std::string_view style) {
  std::string data;
  for (Point point : points) {
    if (is_finite(point)) data += fmt::format("M{} {}h0", number(point.x), number(point.y));
  }
  if (!data.empty()) {
    fmt::format_to(std::back_inserter(body_), "<path d=\"{}\" stroke-linecap=\"round\" {}/>\n", data, style);
  }
}

void Svg::text(Point at, std::string_view text, std::string_view style) {
  fmt::format_to(std::back_inserter(body_), "<text x=\"{}\" y=\"{}\" {}>{}</text>\n", number(at.x), number(at.y), style,
                 escaped(text));
}

void Svg::begin_clip(Point corner, double width, double height) {
  fmt::format_to(std::back_inserter(body_), "<clipPath id=\"clip{}\">", clips_);
  rectangle(corner, width, height, "");
  fmt::format_to(std::back_inserter(body_), "</clipPath>\n<g clip-path=\"url(#clip{})\">\n", clips_++);
}

void Svg::begin_group(std::string_view attributes) {
  fmt::format_to(std::back_inserter(body_), "<g {}>\n", attributes);
}

void Svg::end_group() { body_ += "</g>\n"; }

std::string Svg::document() const {
  return fmt::format(
      // Without width and height: it fills the window, the page or the cell of a notebook that it is shown in.
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"Helvetica Neue, Arial, Liberation Sans, DejaVu Sans, sans-serif\" font-size=\"12\" "
      "fill=\"#333\">\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n{2}</svg>\n",
      number(width_), number(height_), body_);
}

Ticks nice_ticks(double lower, double upper, int wanted) {
  Ticks ticks;
  if (!(std::isfinite(lower) && std::isfinite(upper) && upper > lower) || wanted < 1) return ticks;
  const double rough = (upper - lower) / wanted;
  const int exponent = static_cast<int>(std::floor(std::log10(rough)));
  const double power = std::pow(10.0, exponent);
  const double lead = rough / power;
  const int factor = lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10;
  const double step = factor * power;
  const int decimals = std::max(0, factor == 10 ? -(exponent + 1) : -exponent);
  for (double k = std::ceil(lower / step - 1e-9); k <= upper / step + 1e-9; k += 1.0) {
    ticks.values.push_back(k * step);
    ticks.labels.push_back(k == 0.0 ? "0" : fmt::format("{:.{}f}", k * step, decimals));
  }
  return ticks;
}

std::vector<std::size_t> thin_curve(std::span<const double> values, std::size_t most) {
  std::vector<std::size_t> kept;
  const std::size_t count = values.size(), stretches = std::max<std::size_t>(1, most / 4);
  if (count <= most) {
    kept.resize(count);
    for (std::size_t i = 0; i < count; ++i) kept[i] = i;
    return kept;
  }
  for (std::size_t stretch = 0; stretch < stretches; ++stretch) {
    const std::size_t begin = count * stretch / stretches, end = count * (stretch + 1) / stretches;
    std::size_t lowest = begin, highest = begin, gap = end;
    for (std::size_t i = begin; i < end; ++i) {
      if (std::isnan(values[i])) {
        gap = std::min(gap, i);
        continue;
      }
      if (!(values[i] >= values[lowest])) lowest = i;
      if (!(values[i] <= values[highest])) highest = i;
    }
    std::vector<std::size_t> chosen = {begin, lowest, highest, end - 1};
    if (gap < end) chosen.push_back(gap);
    std::sort(chosen.begin(), chosen.end());
    chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
    kept.insert(kept.end(), chosen.begin(), chosen.end());
  }
  return kept;
}

std::vector<Point> thin_track(std::span<const Point> track, double tolerance, std::size_t most) {
  constexpr double farthest = 1e9;  // a track with more than `most` pieces cannot be thinned to `most` points
  while (true) {
    std::vector<Point> kept;
    bool last_is_kept = true;
    for (Point point : track) {
      last_is_kept = kept.empty() || !is_finite(point) || !is_finite(kept.back()) ||
                     std::hypot(point.x - kept.back().x, point.y - kept.back().y) >= tolerance;
      // Merge consecutive gaps.
      if (last_is_kept && (is_finite(point) || (!kept.empty() && is_finite(kept.back())))) kept.push_back(point);
    }
    if (!last_is_kept) kept.push_back(track.back());
    if (kept.size() <= most || tolerance > farthest) return kept;
    tolerance = tolerance > 0.0 ? 2.0 * tolerance : 1e-3;
  }
}

}  // namespace rhec::sim
