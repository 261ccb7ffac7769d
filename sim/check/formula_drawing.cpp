#include "rhec/sim/check/formula_drawing.hpp"

#include <algorithm>
#include <cstddef>
#include <map>

#include <fmt/format.h>

#include "layered_layout.hpp"
#include "node_labels.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_copy.hpp"
#include "rhec/sim/figures/svg.hpp"

namespace rhec::sim {
namespace {

constexpr double letter = 7.3, line_height = 15.0, page_margin = 24.0, head = 64.0;  // [pixels], of a font of 12
constexpr const char* font = "font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"12\"";

/// What a box is coloured by.
struct Kind {
  const char *name, *meaning, *fill, *line;
};
constexpr Kind kinds[] = {
    {"state", "state", "#dbe9f6", "#3a6ea5"},
    {"input", "input", "#e3f2e1", "#3d8b40"},
    {"parameter", "slip parameter", "#fdeacc", "#c77d0a"},
    {"option", "option", "#eeeeee", "#808080"},
    {"named", "definition", "#ffffff", "#333333"},
    {"operation", "operation", "#ffffff", "#b0b0b0"},
    {"result", "derivative of a state, output", "#f3e3f3", "#8b3d8b"},
};
const Kind& kind_named(const std::string& name) {
  return *std::find_if(std::begin(kinds), std::end(kinds), [&](const Kind& kind) { return name == kind.name; });
}

struct Box {
  std::string title, term, kind;  ///< the title stands out
  LayoutNode size() const {
    const std::size_t letters = std::max(title.size(), term.size());
    const int lines = (title.empty() ? 0 : 1) + (term.empty() ? 0 : 1);
    return {letter * static_cast<double>(letters) + 14.0, line_height * lines + 9.0, kind == "result"};
  }
};

/// The boxes of a formula, and which is computed of which.
struct Boxes {
  std::vector<Box> all;
  std::vector<LayoutEdge> edges;

  Boxes(const VehicleGraph& vehicle, const ModelDescription& about) {
    const Graph& graph = *vehicle.graph;
    const NodeLabels labels(vehicle, about);
    std::vector<int> targets = vehicle.rates;
    targets.insert(targets.end(), vehicle.outputs.begin(), vehicle.outputs.end());
    for (const auto* variables : {&vehicle.states, &vehicle.inputs, &vehicle.parameters})
      targets.insert(targets.end(), variables->begin(), variables->end());
    std::map<int, int> box_of;
    for (const int node : graph.reach(targets)) {
      if (graph.is_constant(node)) continue;  // written where it is used
      box_of.emplace(node, static_cast<int>(all.size()));
      const std::string kind = labels.kind(node), own = graph.name_of(node);
      if (!kind.empty()) {
        all.push_back({labels.name(node), {}, kind});
        continue;
      }
      // Results have boxes of their own; here stands what a definition is called.
      all.push_back({labels.word(node), labels.term(node), own.empty() ? "operation" : "named"});
      const Graph::Node& of = graph[node];
      for (const int operand : {of.a, operand_count(of.operation) > 1 && of.b != of.a ? of.b : -1})
        if (operand >= 0 && box_of.contains(operand)) edges.push_back({box_of.at(operand), box_of.at(node)});
    }
    const auto add_results = [&](const std::vector<int>& nodes, const std::vector<Variable>& variables,
                                 const char* mark) {
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        Box box{variables[k].name + mark, {}, "result"};
        if (graph.is_constant(nodes[k])) box.term = labels.word(nodes[k]);
        if (!graph.is_constant(nodes[k])) edges.push_back({box_of.at(nodes[k]), static_cast<int>(all.size())});
        all.push_back(std::move(box));
      }
    };
    add_results(vehicle.rates, about.states, "'");
    add_results(vehicle.outputs, about.outputs, "");
  }
};

void draw_route(Svg& svg, const std::vector<Point>& route, Point origin) {
  std::string path;
  for (std::size_t k = 0; k < route.size(); ++k) {
    const Point to{route[k].x + origin.x, route[k].y + origin.y};
    if (k == 0) {
      path = fmt::format("M{:.1f} {:.1f}", to.x, to.y);
    } else {
      const Point from{route[k - 1].x + origin.x, route[k - 1].y + origin.y};
      const double middle = (from.x + to.x) / 2;
      path += fmt::format("C{0:.1f} {1:.1f} {0:.1f} {2:.1f} {3:.1f} {2:.1f}", middle, from.y, to.y, to.x);
    }
  }
  svg.raw(fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"#9aa5b1\" marker-end=\"url(#arrow)\"/>\n", path));
}

void draw_box(Svg& svg, const Box& box, Point centre) {
  const LayoutNode size = box.size();
  const Kind& kind = kind_named(box.kind);
  svg.rectangle({centre.x - size.width / 2, centre.y - size.height / 2}, size.width, size.height,
                fmt::format("rx=\"4\" fill=\"{}\" stroke=\"{}\"", kind.fill, kind.line));
  double y = centre.y - size.height / 2 + line_height + 1.0;
  const bool stands_out = box.kind != "operation";
  if (!box.title.empty()) {
    svg.text(
        {centre.x, y}, box.title,
        fmt::format("{} text-anchor=\"middle\" {}", font, stands_out ? "font-weight=\"bold\"" : "fill=\"#909090\""));
    y += line_height;
  }
  if (!box.term.empty()) svg.text({centre.x, y}, box.term, fmt::format("{} text-anchor=\"middle\"", font));
}

constexpr double cell = 14.0;

Point size_of(const DerivativePattern& pattern) {
  std::size_t widest = 0, highest = 0;
  for (const std::string& row : pattern.rows) widest = std::max(widest, row.size());
  for (const std::string& column : pattern.columns) highest = std::max(highest, column.size());
  return {letter * static_cast<double>(widest) + 8.0 + cell * static_cast<double>(pattern.columns.size()),
          30.0 + letter * static_cast<double>(highest) + cell * static_cast<double>(pattern.rows.size())};
}

void draw_pattern(Svg& svg, const DerivativePattern& pattern, const std::string& title, Point corner, bool is_lower) {
  const Point size = size_of(pattern);
  svg.text({corner.x, corner.y + 12.0}, title, fmt::format("{} font-weight=\"bold\"", font));
  const Point grid{corner.x + size.x - cell * static_cast<double>(pattern.columns.size()),
                   corner.y + size.y - cell * static_cast<double>(pattern.rows.size())};
  for (std::size_t c = 0; c < pattern.columns.size(); ++c) {
    const Point at{grid.x + cell * (static_cast<double>(c) + 0.8), grid.y - 4.0};
    svg.text(at, pattern.columns[c], fmt::format("{} transform=\"rotate(-90 {:.1f} {:.1f})\"", font, at.x, at.y));
  }
  for (std::size_t r = 0; r < pattern.rows.size(); ++r) {
    const double y = grid.y + cell * static_cast<double>(r);
    svg.text({grid.x - 5.0, y + 11.0}, pattern.rows[r], fmt::format("{} text-anchor=\"end\"", font));
    for (std::size_t c = 0; c < pattern.columns.size() && (!is_lower || c <= r); ++c) {
      const char* const fills[] = {"#ffffff", "#a9c4de", "#1f4e79"};
      svg.rectangle({grid.x + cell * static_cast<double>(c), y}, cell, cell,
                    fmt::format("fill=\"{}\" stroke=\"#cccccc\"", fills[static_cast<int>(pattern.at(r, c))]));
    }
  }
}

}  // namespace

std::string formula_drawing(const VehicleGraph& vehicle, const ModelDescription& about, const FormulaSize& size) {
  const VehicleGraph copy = formula_copy(vehicle);
  const Boxes boxes(copy, about);
  std::vector<LayoutNode> nodes;
  for (const Box& box : boxes.all) nodes.push_back(box.size());
  const auto operations = std::count_if(boxes.all.begin(), boxes.all.end(),
                                        [](const Box& box) { return box.kind == "operation" || box.kind == "named"; });
  if (operations > most_drawn)
    throw Error(
        fmt::format("model '{}': its formula has {} operations, too many for a drawing of at most {}; the table "
                    "of --graph has no limit",
                    about.name, operations, most_drawn));
  const LayeredLayout layout = layered_layout(nodes, boxes.edges, 44.0, 12.0);

  struct Shown {
    const DerivativePattern* pattern;
    std::string title;
    bool is_lower;
  };
  const Shown shown[] = {
      {&size.rates, "df/dz", false}, {&size.outputs, "dh/dx", false}, {&size.hessian, "Hessian of f", true}};
  double below_width = 0.0, below_height = 0.0;
  for (const Shown& each : shown) {
    below_width += size_of(*each.pattern).x + 2 * page_margin;
    below_height = std::max(below_height, size_of(*each.pattern).y);
  }
  double legend_width = 0.0;
  for (const Kind& kind : kinds)
    legend_width += 26.0 + letter * static_cast<double>(std::string_view(kind.meaning).size());
  const double width = std::max({layout.width, below_width, legend_width, 420.0}) + 2 * page_margin;
  const double top = page_margin + head, below = top + layout.height + 2 * page_margin;
  Svg svg(width, below + below_height + page_margin + 24.0);
  svg.raw(
      "<defs><marker id=\"arrow\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"7\" markerHeight=\"7\" "
      "orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" fill=\"#9aa5b1\"/></marker></defs>\n");
  svg.text({page_margin, page_margin + 8.0},
           fmt::format("{}: {} operations, depth {}", about.name, operations, size.depth),
           "font-family=\"DejaVu Sans, sans-serif\" font-size=\"16\" font-weight=\"bold\"");
  double x = page_margin;
  for (const Kind& kind : kinds) {
    svg.rectangle({x, page_margin + 22.0}, 12.0, 12.0,
                  fmt::format("rx=\"2\" fill=\"{}\" stroke=\"{}\"", kind.fill, kind.line));
    svg.text({x + 17.0, page_margin + 32.0}, kind.meaning, font);
    x += 26.0 + letter * static_cast<double>(std::string_view(kind.meaning).size());
  }
  const Point origin{page_margin, top};
  for (const std::vector<Point>& route : layout.routes) draw_route(svg, route, origin);
  for (std::size_t k = 0; k < boxes.all.size(); ++k)
    draw_box(svg, boxes.all[k], {layout.centres[k].x + origin.x, layout.centres[k].y + origin.y});
  x = page_margin;
  for (const Shown& each : shown) {
    draw_pattern(svg, *each.pattern, each.title, {x, below}, each.is_lower);
    x += size_of(*each.pattern).x + 2 * page_margin;
  }
  svg.text({page_margin, below + below_height + 24.0},
           "dark: varies with the variables; light: a number, once options are known; white: always zero", font);
  return svg.document();
}

}  // namespace rhec::sim
