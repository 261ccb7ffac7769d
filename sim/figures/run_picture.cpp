#include "rhec/sim/figures/run_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {
namespace {

// Sizes of the drawing [pixels].
constexpr double margin = 24.0, header_height = 22.0, axis_height = 42.0, axis_width = 52.0;
constexpr double map_width = 540.0, bar_width = 12.0, bar_space = 64.0, gutter = 16.0;
constexpr double panel_width = 560.0, panel_gap = 12.0;

constexpr int palette_levels = 48;

constexpr const char* grid_style = R"(stroke="#e3e5e8" stroke-width="1")";
constexpr const char* frame_style = R"(fill="none" stroke="#9aa0a6" stroke-width="1")";
constexpr const char* small_text = R"(font-size="11" fill="#5f6368")";
constexpr const char* head_text = R"(font-size="12.5" font-weight="bold" fill="#222")";

constexpr const char* truth_colour = "#222222";
constexpr const char* estimate_colour = "#d1341f";
constexpr const char* reference_colour = "#7a8088";
constexpr const char* other_colours[] = {"#2563c4", "#1b8a5a", "#8a3fb0", "#b7791f"};

struct Interval {
  double lower = std::numeric_limits<double>::infinity();
  double upper = -std::numeric_limits<double>::infinity();
  void include(double value) {
    if (!std::isfinite(value)) return;
    lower = std::min(lower, value);
    upper = std::max(upper, value);
  }
  bool empty() const { return lower > upper; }
  double width() const { return upper - lower; }
  double middle() const { return 0.5 * (lower + upper); }
  Interval padded(double share) const { return {lower - share * width(), upper + share * width()}; }
  // A valid axis interval for any input.
  Interval usable() const {
    if (empty()) return {0.0, 1.0};
    if (width() > 1e-9 * std::max(std::abs(lower), std::abs(upper))) return *this;
    const double half = lower == 0.0 ? 1.0 : 0.1 * std::abs(lower);
    return {lower - half, upper + half};
  }
};

// A rectangle of the drawing and the data range that it shows.
struct Frame {
  Point corner;
  double width, height;
  Interval x, y;

  Point at(double data_x, double data_y) const {
    return {corner.x + (data_x - x.lower) / x.width() * width, corner.y + (y.upper - data_y) / y.width() * height};
  }
  double right() const { return corner.x + width; }
  double bottom() const { return corner.y + height; }
};

struct LegendEntry {
  std::string label;
  std::string style;  // of a short line sample
  bool is_dot = false;
};

// An estimate that avoids overlaps; font metrics are not available.
double text_width(std::string_view text, double font_size) {
  const auto letters = std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
  return 0.57 * font_size * static_cast<double>(letters);
}

constexpr double legend_line = 18.0, legend_gap = 14.0;
double width_of(const std::vector<LegendEntry>& legend) {
  double width = 0.0;
  for (const LegendEntry& entry : legend) width += legend_line + 5.0 + text_width(entry.label, 11.0) + legend_gap;
  return width;
}

void draw_legend(Svg& svg, const std::vector<LegendEntry>& legend, Point at) {
  for (const LegendEntry& entry : legend) {
    const Point from{at.x, at.y - 4.0}, to{at.x + legend_line, at.y - 4.0};
    if (entry.is_dot) {
      const Point dot{0.5 * (from.x + to.x), from.y};
      svg.dots({&dot, 1}, entry.style);
    } else {
      svg.line(from, to, entry.style);
    }
    svg.text({to.x + 5.0, at.y}, entry.label, small_text);
    at.x = to.x + 5.0 + text_width(entry.label, 11.0) + legend_gap;
  }
}

// Heading on the left and legend on the right of one line; the legend gets its own line if both do not fit.
bool fits(const std::string& title, const std::vector<LegendEntry>& legend, double width) {
  return text_width(title, 12.5) + 16.0 + width_of(legend) <= width;
}
double head_height(const std::string& title, const std::vector<LegendEntry>& legend, double width) {
  return (fits(title, legend, width) ? 1.0 : 1.8) * header_height;
}
void draw_head(Svg& svg, const std::string& title, const std::vector<LegendEntry>& legend, Point corner, double width) {
  const bool one_line = fits(title, legend, width);
  svg.text({corner.x, corner.y + 14.0}, title, head_text);
  if (one_line) {
    draw_legend(svg, legend, {corner.x + width - width_of(legend) + legend_gap, corner.y + 14.0});
  } else {
    draw_legend(svg, legend, {corner.x, corner.y + 14.0 + 0.8 * header_height});
  }
}

enum class Grid { shown, hidden };

void draw_x_axis(Svg& svg, const Frame& frame, int wanted, Grid grid, const char* title) {
  const Ticks ticks = nice_ticks(frame.x.lower, frame.x.upper, wanted);
  for (std::size_t i = 0; i < ticks.values.size(); ++i) {
    const double x = frame.at(ticks.values[i], frame.y.lower).x;
    if (grid == Grid::shown) svg.line({x, frame.corner.y}, {x, frame.bottom()}, grid_style);
    if (!title) continue;
    svg.line({x, frame.bottom()}, {x, frame.bottom() + 4.0}, R"(stroke="#9aa0a6")");
    svg.text({x, frame.bottom() + 16.0}, ticks.labels[i], fmt::format("{} text-anchor=\"middle\"", small_text));
  }
  if (title) {
    svg.text({0.5 * (frame.corner.x + frame.right()), frame.bottom() + 33.0}, title,
             fmt::format("{} text-anchor=\"middle\"", small_text));
  }
}

void draw_y_axis(Svg& svg, const Frame& frame, int wanted, Grid grid, const std::string& title) {
  const Ticks ticks = nice_ticks(frame.y.lower, frame.y.upper, wanted);
  for (std::size_t i = 0; i < ticks.values.size(); ++i) {
    const double y = frame.at(frame.x.lower, ticks.values[i]).y;
    if (grid == Grid::shown) svg.line({frame.corner.x, y}, {frame.right(), y}, grid_style);
    svg.line({frame.corner.x - 4.0, y}, {frame.corner.x, y}, R"(stroke="#9aa0a6")");
    svg.text({frame.corner.x - 7.0, y + 4.0}, ticks.labels[i], fmt::format("{} text-anchor=\"end\"", small_text));
  }
  if (!title.empty()) {
    const Point at{frame.corner.x - axis_width + 12.0, 0.5 * (frame.corner.y + frame.bottom())};
    svg.text(at, title,
             fmt::format("{} text-anchor=\"middle\" transform=\"rotate(-90 {:.1f} {:.1f})\"", small_text, at.x, at.y));
  }
}

void draw_base(Svg& svg, const Frame& frame, const BaseMap& base) {
  constexpr double cell = 4.0;
  const int columns = static_cast<int>(std::ceil(frame.width / cell)),
            rows = static_cast<int>(std::ceil(frame.height / cell));
  const auto level_at = [&](int row, int column) {
    const double x = frame.x.lower + (column + 0.5) * cell / frame.width * frame.x.width();
    const double y = frame.y.upper - (row + 0.5) * cell / frame.height * frame.y.width();
    const double share = (base.value(x, y) - base.lower) / (base.upper - base.lower);
    return std::isnan(share) ? -1 : static_cast<int>(std::clamp(share * palette_levels, 0.0, palette_levels - 1.0));
  };
  // One shape per colour, composed of runs of equal cells in cell units, keeps the file small.
  std::vector<std::string> shapes(palette_levels);
  for (int row = 0; row < rows; ++row) {
    int run_start = 0, run_level = level_at(row, 0);
    for (int column = 1; column <= columns; ++column) {
      const int level = column < columns ? level_at(row, column) : -2;
      if (level == run_level) continue;
      if (run_level >= 0) {
        const int run = column - run_start;
        fmt::format_to(std::back_inserter(shapes[run_level]), "M{} {}h{}v1h-{}z", run_start, row, run, run);
      }
      run_start = column;
      run_level = level;
    }
  }
  svg.begin_group(fmt::format("transform=\"translate({:.1f} {:.1f}) scale({})\" shape-rendering=\"crispEdges\"",
                              frame.corner.x, frame.corner.y, cell));
  for (int level = 0; level < palette_levels; ++level) {
    if (shapes[level].empty()) continue;
    svg.raw(fmt::format("<path fill=\"{}\" d=\"{}\"/>\n", hex(slip_palette((level + 0.5) / palette_levels)),
                        shapes[level]));
  }
  svg.end_group();
}

void draw_colour_bar(Svg& svg, const Frame& frame, const BaseMap& base) {
  constexpr int levels = palette_levels;
  const Frame bar{
      {frame.right() + gutter, frame.corner.y}, bar_width, frame.height, {0.0, 1.0}, {base.lower, base.upper}};
  for (int level = 0; level < levels; ++level) {
    const double top = bar.bottom() - (level + 1) * bar.height / levels;
    // An extra half pixel closes the seams between neighbours.
    svg.rectangle({bar.corner.x, top}, bar.width, bar.height / levels + (level > 0 ? 0.5 : 0.0),
                  fmt::format("fill=\"{}\"", hex(slip_palette((level + 0.5) / levels))));
  }
  svg.rectangle(bar.corner, bar.width, bar.height, frame_style);
  const Ticks ticks = nice_ticks(base.lower, base.upper, 6);
  for (std::size_t i = 0; i < ticks.values.size(); ++i) {
    const double y = bar.at(0.0, ticks.values[i]).y;
    svg.line({bar.right(), y}, {bar.right() + 4.0, y}, R"(stroke="#9aa0a6")");
    svg.text({bar.right() + 7.0, y + 4.0}, ticks.labels[i], small_text);
  }
  svg.text({bar.corner.x + bar.width, bar.bottom() + 20.0}, base.title,
           fmt::format("{} text-anchor=\"middle\"", small_text));
}

std::vector<LegendEntry> map_legend(const RunPicture& picture) {
  std::vector<LegendEntry> legend;
  if (!picture.path.empty()) legend.push_back({"path (white)", R"(stroke="#a3a8ae" stroke-width="5")"});
  if (!picture.driven.empty())
    legend.push_back({"driven", fmt::format("stroke=\"{}\" stroke-width=\"2.4\"", truth_colour)});
  if (!picture.estimated.empty()) {
    legend.push_back({"estimated", fmt::format("stroke=\"{}\" stroke-width=\"1.2\"", estimate_colour)});
  }
  if (!picture.fixes.empty()) legend.push_back({"position fixes", R"(stroke="#1d4fa3" stroke-width="4")", true});
  return legend;
}

void draw_map(Svg& svg, const RunPicture& picture, Point corner, double height) {
  const std::vector<LegendEntry> legend = map_legend(picture);
  const double head = head_height("Map", legend, map_width);
  draw_head(svg, "Map", legend, corner, map_width);

  Frame frame{{corner.x, corner.y + head}, map_width, height - head, {}, {}};
  for (const auto* track : {&picture.path, &picture.driven, &picture.estimated}) {
    for (Point point : *track) {
      frame.x.include(point.x);
      frame.y.include(point.y);
    }
  }
  if (frame.x.empty()) {
    for (Point point : picture.fixes) {
      frame.x.include(point.x);
      frame.y.include(point.y);
    }
  }
  // Equal scale on both axes; the shorter one shows a wider surrounding area.
  frame.x = frame.x.usable();
  frame.y = frame.y.usable();
  const double metres = 1.1 * std::max(frame.x.width() / frame.width, frame.y.width() / frame.height);  // per pixel
  frame.x = Interval{frame.x.middle(), frame.x.middle()};
  frame.y = Interval{frame.y.middle(), frame.y.middle()};
  frame.x = {frame.x.lower - 0.5 * metres * frame.width, frame.x.upper + 0.5 * metres * frame.width};
  frame.y = {frame.y.lower - 0.5 * metres * frame.height, frame.y.upper + 0.5 * metres * frame.height};

  svg.begin_clip(frame.corner, frame.width, frame.height);
  if (picture.base) draw_base(svg, frame, *picture.base);
  svg.end_group();
  if (picture.base) draw_colour_bar(svg, frame, *picture.base);
  const Grid grid = picture.base ? Grid::hidden : Grid::shown;
  draw_x_axis(svg, frame, 8, grid, "x [m]");
  draw_y_axis(svg, frame, 8, grid, "y [m]");

  const auto drawn = [&](const std::vector<Point>& track) {
    std::vector<Point> points;
    points.reserve(track.size());
    for (Point point : track) points.push_back(frame.at(point.x, point.y));
    return thin_track(points, 0.3);
  };
  svg.begin_clip(frame.corner, frame.width, frame.height);
  const std::vector<Point> path = drawn(picture.path);
  svg.polyline(path, R"(stroke="#a3a8ae" stroke-width="6.4")");
  svg.polyline(path, R"(stroke="#ffffff" stroke-width="4.8")");
  svg.polyline(drawn(picture.driven), fmt::format("stroke=\"{}\" stroke-width=\"2.4\"", truth_colour));
  svg.dots(drawn(picture.fixes), R"(stroke="#1d4fa3" stroke-opacity="0.6" stroke-width="3")");
  svg.polyline(drawn(picture.estimated), fmt::format("stroke=\"{}\" stroke-width=\"1.1\"", estimate_colour));
  if (!path.empty()) {
    const Point start = path.front();
    svg.dots({&start, 1}, fmt::format("stroke=\"{}\" stroke-width=\"11\"", truth_colour));
    svg.dots({&start, 1}, R"(stroke="#ffffff" stroke-width="7")");
    svg.text(
        {start.x + 9.0, start.y - 8.0}, "start",
        R"(font-size="11" font-weight="bold" stroke="#fff" stroke-width="3" paint-order="stroke" stroke-linejoin="round")");
  }
  svg.end_group();
  svg.rectangle(frame.corner, frame.width, frame.height, frame_style);
}

// The colour and stroke of each curve of a panel.
std::vector<LegendEntry> panel_legend(const Panel& panel) {
  std::vector<LegendEntry> legend;
  std::size_t others = 0;
  for (const Curve& curve : panel.curves) {
    std::string style;
    switch (curve.role) {
      case CurveRole::truth:
        style = fmt::format("stroke=\"{}\" stroke-width=\"1.4\"", truth_colour);
        break;
      case CurveRole::estimate:
        style = fmt::format("stroke=\"{}\" stroke-width=\"1.5\"", estimate_colour);
        break;
      case CurveRole::reference:
        style = fmt::format("stroke=\"{}\" stroke-width=\"1.3\" stroke-dasharray=\"5 3\"", reference_colour);
        break;
      case CurveRole::other:
        style = fmt::format("stroke=\"{}\" stroke-width=\"1.3\"", other_colours[others++ % std::size(other_colours)]);
        break;
    }
    legend.push_back({curve.label, style});
  }
  return legend;
}

std::string heading_of(const Panel& panel) {
  return panel.unit.empty() || panel.unit == "1" ? panel.title : fmt::format("{} [{}]", panel.title, panel.unit);
}

Interval value_range(const Panel& panel) {
  Interval lines;
  for (const Curve& curve : panel.curves) {
    for (double value : curve.values) lines.include(value);
  }
  lines = lines.usable();
  // A band may widen the axis somewhat; anything beyond (as at the start of a run) is clipped.
  const Interval most = lines.padded(0.25);
  Interval range = lines;
  for (const Curve& curve : panel.curves) {
    for (std::size_t i = 0; i < curve.sigmas.size(); ++i) {
      range.include(std::clamp(curve.values[i] - 2.0 * curve.sigmas[i], most.lower, most.upper));
      range.include(std::clamp(curve.values[i] + 2.0 * curve.sigmas[i], most.lower, most.upper));
    }
  }
  range = range.padded(0.06);
  if (std::isfinite(panel.lower)) range.lower = panel.lower;
  if (std::isfinite(panel.upper)) range.upper = panel.upper;
  return range.lower < range.upper ? range : Interval{range.lower, range.lower + 1.0};
}

void draw_band(Svg& svg, const Frame& frame, const Curve& curve, std::string_view style) {
  // Avoid infinite coordinates: a band that leaves the panel is drawn only slightly beyond it.
  const Interval most = frame.y.padded(0.2);
  std::vector<double> sides[2];
  for (std::size_t i = 0; i < curve.values.size(); ++i) {
    for (int side = 0; side < 2; ++side) {
      const double value = curve.values[i] + (side == 0 ? -2.0 : 2.0) * curve.sigmas[i];
      sides[side].push_back(std::isnan(value) ? value : std::clamp(value, most.lower, most.upper));
    }
  }
  std::size_t begin = 0;
  while (begin < curve.values.size()) {
    std::size_t end = begin;
    while (end < curve.values.size() && !std::isnan(sides[0][end])) ++end;
    const std::size_t share = 2000 * (end - begin) / curve.values.size() + 8;  // maximum number of points per side
    std::vector<Point> outline;
    for (int side = 0; side < 2; ++side) {
      std::vector<std::size_t> kept = thin_curve(std::span(sides[side]).subspan(begin, end - begin), share);
      if (side == 1) std::reverse(kept.begin(), kept.end());
      for (std::size_t i : kept) outline.push_back(frame.at(curve.times[begin + i], sides[side][begin + i]));
    }
    svg.polygon(outline, style);
    begin = std::max(end, begin + 1);
  }
}

void draw_spans(Svg& svg, const Frame& frame, const std::vector<Span>& spans) {
  constexpr double least_width = 1.0;
  for (const Span& span : spans) {
    const double left = frame.at(span.from, frame.y.upper).x, right = frame.at(span.to, frame.y.upper).x;
    svg.rectangle(
        {left, frame.corner.y}, std::max(right - left, least_width), frame.height,
        span.is_suspected ? R"(fill="#f9ab00" fill-opacity="0.16")" : R"(fill="#d93025" fill-opacity="0.12")");
  }
}

void draw_panel(Svg& svg, const Panel& panel, const std::vector<Span>& spans, Point corner, double height,
                Interval times, bool is_last) {
  const std::vector<LegendEntry> legend = panel_legend(panel);
  const double head = head_height(heading_of(panel), legend, panel_width);
  draw_head(svg, heading_of(panel), legend, corner, panel_width);
  const Frame frame{{corner.x, corner.y + head}, panel_width, height - head, times, value_range(panel)};
  draw_x_axis(svg, frame, 8, Grid::shown, is_last ? "time [s]" : nullptr);
  draw_y_axis(svg, frame, static_cast<int>(std::clamp(frame.height / 28.0, 3.0, 7.0)), Grid::shown, "");

  svg.begin_clip(frame.corner, frame.width, frame.height);
  draw_spans(svg, frame, spans);
  for (std::size_t i = 0; i < panel.curves.size(); ++i) {
    if (panel.curves[i].sigmas.empty()) continue;
    // The colour of the line, thinned: its style begins with stroke="#rrggbb".
    const std::string colour = legend[i].style.substr(legend[i].style.find('#'), 7);
    draw_band(svg, frame, panel.curves[i], fmt::format("fill=\"{}\" fill-opacity=\"0.16\"", colour));
  }
  for (CurveRole role : {CurveRole::reference, CurveRole::other, CurveRole::truth, CurveRole::estimate}) {
    for (std::size_t i = 0; i < panel.curves.size(); ++i) {
      const Curve& curve = panel.curves[i];
      if (curve.role != role) continue;
      std::vector<Point> points;
      for (std::size_t k : thin_curve(curve.values)) points.push_back(frame.at(curve.times[k], curve.values[k]));
      svg.polyline(points, legend[i].style);
    }
  }
  svg.end_group();
  svg.rectangle(frame.corner, frame.width, frame.height, frame_style);
}

void check(const RunPicture& picture) {
  for (const Panel& panel : picture.panels) {
    for (const Curve& curve : panel.curves) {
      const bool sigmas_fit = curve.sigmas.empty() || curve.sigmas.size() == curve.values.size();
      if (curve.times.size() != curve.values.size() || !sigmas_fit) {
        throw Error(
            fmt::format("run picture: curve '{}' of panel '{}' has {} times, {} values and {} sigmas; expected as many "
                        "of each (sigmas may be left out)",
                        curve.label, panel.title, curve.times.size(), curve.values.size(), curve.sigmas.size()));
      }
    }
  }
  if (picture.base && (!picture.base->value || !(picture.base->lower < picture.base->upper))) {
    throw Error("run picture: the base map needs a function and a range with lower < upper");
  }
}

}  // namespace

std::string draw_run(const RunPicture& picture) {
  check(picture);
  const auto panel_count = static_cast<double>(picture.panels.size());
  const double map_corner = margin + axis_width;
  const double map_end = map_corner + map_width + (picture.base ? gutter + bar_width + bar_space : margin);
  const double panel_corner = map_end + axis_width;
  const double width = picture.panels.empty() ? map_end : panel_corner + panel_width + margin;
  const double top = margin + (picture.title.empty() ? 0.0 : 26.0) + (picture.subtitle.empty() ? 0.0 : 20.0);
  const double body = std::clamp(170.0 * panel_count, 520.0, 1000.0);  // without the axis below
  const double height = top + body + axis_height + margin;

  Svg svg(width, height);
  double line = margin + 12.0;
  if (!picture.title.empty()) {
    svg.text({margin, line}, picture.title, R"(font-size="18" font-weight="bold" fill="#222")");
    line += 21.0;
  }
  if (!picture.subtitle.empty()) svg.text({margin, line}, picture.subtitle, R"(font-size="12.5" fill="#5f6368")");
  draw_map(svg, picture, {map_corner, top}, body);

  Interval times;
  for (const Panel& panel : picture.panels) {
    for (const Curve& curve : panel.curves) {
      for (double time : curve.times) times.include(time);
    }
  }
  times = times.usable();
  const double panel_height = (body - panel_gap * (panel_count - 1.0)) / panel_count;
  for (std::size_t i = 0; i < picture.panels.size(); ++i) {
    const Point corner{panel_corner, top + static_cast<double>(i) * (panel_height + panel_gap)};
    draw_panel(svg, picture.panels[i], picture.spans, corner, panel_height, times, i + 1 == picture.panels.size());
  }
  return svg.document();
}

}  // namespace rhec::sim
