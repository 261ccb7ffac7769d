#pragma once

#include <span>
#include <vector>

#include "rhec/sim/figures/svg.hpp"

namespace rhec::sim {

/// A directed graph without circles, laid out in columns from left to right (Sugiyama, Tagawa and Toda, Methods for
/// visual understanding of hierarchical system structures, 1981): each edge leads to the right.
struct LayoutNode {
  double width = 0.0, height = 0.0;
  bool is_last = false;  ///< stands in the last column; nothing follows it
};
struct LayoutEdge {
  int from = 0, to = 0;  ///< from < to
};
struct LayeredLayout {
  std::vector<Point> centres;              ///< by node
  std::vector<std::vector<Point>> routes;  ///< by edge: from the right side of `from` to the left side of `to`
  double width = 0.0, height = 0.0;        ///< of all, from (0, 0)
  int crossings = 0;                       ///< of edges
};

LayeredLayout layered_layout(std::span<const LayoutNode> nodes, std::span<const LayoutEdge> edges, double column_gap,
                             double row_gap);

}  // namespace rhec::sim
