#include "layered_layout.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace rhec::sim {
namespace {

/// What stands in a column: a node, or the place where a longer edge passes.
struct Item {
  int column = 0;
  double width = 0.0, height = 0.0;
  std::vector<int> before, after;  ///< items in the columns beside it
  double y = 0.0;                  ///< of its centre
};

/// The values closest to `wanted`, in the sense of least squares, that keep their order and distances: isotonic
/// regression by pooling adjacent violators (Ayer et al. 1955).
std::vector<double> kept_apart(const std::vector<double>& wanted, const std::vector<double>& distances) {
  struct Pool {
    double sum;
    int count;
    double mean() const { return sum / count; }
  };
  std::vector<Pool> pools;
  std::vector<double> shifts(wanted.size(), 0.0);
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    if (k > 0) shifts[k] = shifts[k - 1] + distances[k - 1];
    pools.push_back({wanted[k] - shifts[k], 1});
    while (pools.size() > 1 && pools[pools.size() - 2].mean() >= pools.back().mean()) {
      pools[pools.size() - 2].sum += pools.back().sum;
      pools[pools.size() - 2].count += pools.back().count;
      pools.pop_back();
    }
  }
  std::vector<double> found;
  for (const Pool& pool : pools)
    for (int k = 0; k < pool.count; ++k) found.push_back(pool.mean() + shifts[found.size()]);
  return found;
}

class Layout {
 public:
  Layout(std::span<const LayoutNode> nodes, std::span<const LayoutEdge> edges, double column_gap, double row_gap)
      : nodes_(nodes), edges_(edges), column_gap_(column_gap), row_gap_(row_gap) {
    place_in_columns();
    split_edges();
    order_columns();
    place_in_rows();
  }

  LayeredLayout take() {
    LayeredLayout made;
    made.crossings = crossings();
    std::vector<double> lefts;
    double x = 0.0;
    for (const std::vector<int>& column : columns_) {
      lefts.push_back(x);
      x += width_of(column) + column_gap_;
    }
    made.width = x - column_gap_;
    double top = 0.0, bottom = 0.0;
    for (std::size_t k = 0; k < items_.size(); ++k) {
      const Item& item = items_[k];
      top = k == 0 ? item.y - item.height / 2 : std::min(top, item.y - item.height / 2);
      bottom = k == 0 ? item.y + item.height / 2 : std::max(bottom, item.y + item.height / 2);
    }
    made.height = bottom - top;
    const auto centre = [&](int item) {
      const Item& of = items_[item];
      return Point{lefts[of.column] + width_of(columns_[of.column]) / 2, of.y - top};
    };
    for (std::size_t k = 0; k < nodes_.size(); ++k) made.centres.push_back(centre(static_cast<int>(k)));
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      std::vector<Point> route;
      const auto add = [&](int item, double side) {
        const Point at = centre(item);
        route.push_back({at.x + side, at.y});
      };
      add(edges_[e].from, nodes_[edges_[e].from].width / 2);
      for (const int item : passes_[e]) {
        const double half = width_of(columns_[items_[item].column]) / 2;
        add(item, -half);
        add(item, half);
      }
      add(edges_[e].to, -nodes_[edges_[e].to].width / 2);
      made.routes.push_back(std::move(route));
    }
    return made;
  }

 private:
  double width_of(const std::vector<int>& column) const {
    double widest = 0.0;
    for (const int item : column) widest = std::max(widest, items_[item].width);
    return widest;
  }

  /// By the longest chain before it; then to the right, as far as what follows it allows, but for what nothing
  /// precedes.
  void place_in_columns() {
    for (const LayoutNode& node : nodes_) items_.push_back({0, node.width, node.height, {}, {}, 0.0});
    std::vector<std::vector<int>> after(nodes_.size()), before(nodes_.size());
    for (const LayoutEdge& edge : edges_) {
      after[edge.from].push_back(edge.to);
      before[edge.to].push_back(edge.from);
    }
    int last = 0;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      for (const int from : before[k]) items_[k].column = std::max(items_[k].column, items_[from].column + 1);
      last = std::max(last, items_[k].column);
    }
    for (std::size_t k = 0; k < nodes_.size(); ++k)
      if (nodes_[k].is_last) items_[k].column = last;
    for (std::size_t k = nodes_.size(); k-- > 0;) {
      if (before[k].empty() || after[k].empty()) continue;
      int earliest = last;
      for (const int to : after[k])
        if (!nodes_[to].is_last) earliest = std::min(earliest, items_[to].column);
      if (earliest < last) items_[k].column = earliest - 1;
    }
    columns_.resize(static_cast<std::size_t>(last) + 1);
  }

  void split_edges() {
    for (const LayoutEdge& edge : edges_) {
      std::vector<int> passed;
      int from = edge.from;
      for (int column = items_[edge.from].column + 1; column < items_[edge.to].column; ++column) {
        const int made = static_cast<int>(items_.size());
        items_.push_back({column, 0.0, row_gap_ / 2, {}, {}, 0.0});
        connect(from, made);
        passed.push_back(made);
        from = made;
      }
      connect(from, edge.to);
      passes_.push_back(std::move(passed));
    }
    for (std::size_t k = 0; k < items_.size(); ++k) columns_[items_[k].column].push_back(static_cast<int>(k));
  }
  void connect(int from, int to) {
    items_[from].after.push_back(to);
    items_[to].before.push_back(from);
  }

  std::vector<int> ranks() const {
    std::vector<int> ranks(items_.size());
    for (const std::vector<int>& column : columns_)
      for (std::size_t k = 0; k < column.size(); ++k) ranks[column[k]] = static_cast<int>(k);
    return ranks;
  }

  /// Pairs of edges between neighbouring columns whose ends are in unlike orders.
  int crossings() const {
    const std::vector<int> rank = ranks();
    int count = 0;
    for (const std::vector<int>& column : columns_) {
      std::vector<int> ends;  // sorted
      for (const int item : column) {
        std::vector<int> own;
        for (const int to : items_[item].after) own.push_back(rank[to]);
        std::sort(own.begin(), own.end());
        for (const int end : own)
          count += static_cast<int>(ends.end() - std::upper_bound(ends.begin(), ends.end(), end));
        for (const int end : own) ends.insert(std::upper_bound(ends.begin(), ends.end(), end), end);
      }
    }
    return count;
  }

  /// Each item goes where its neighbours are on average, column by column, there and back; the best order is kept.
  void order_columns() {
    std::vector<std::vector<int>> best = columns_;
    int fewest = crossings();
    constexpr int sweeps = 24;
    for (int sweep = 0; sweep < sweeps && fewest > 0; ++sweep) {
      const bool to_right = sweep % 2 == 0;
      for (std::size_t k = 1; k < columns_.size(); ++k)
        order(columns_[to_right ? k : columns_.size() - 1 - k], to_right);
      const int now = crossings();
      if (now >= fewest) continue;
      fewest = now;
      best = columns_;
    }
    columns_ = best;
  }
  void order(std::vector<int>& column, bool by_before) {
    const std::vector<int> rank = ranks();
    std::vector<double> means(items_.size(), 0.0);
    for (const int item : column) {
      const std::vector<int>& beside = by_before ? items_[item].before : items_[item].after;
      double sum = 0.0;
      for (const int other : beside) sum += rank[other];
      means[item] = beside.empty() ? rank[item] : sum / static_cast<double>(beside.size());
    }
    std::stable_sort(column.begin(), column.end(), [&](int a, int b) { return means[a] < means[b]; });
  }

  void place_in_rows() {
    for (const std::vector<int>& column : columns_) {
      double y = 0.0;
      for (const int item : column) {
        items_[item].y = y + items_[item].height / 2;
        y += items_[item].height + row_gap_;
      }
    }
    constexpr int rounds = 16;
    for (int round = 0; round < rounds; ++round)
      for (std::size_t k = 0; k < columns_.size(); ++k)
        align(columns_[round % 2 == 0 ? k : columns_.size() - 1 - k], round + 2 < rounds, round % 2 == 0);
  }
  /// Towards the neighbours: those on one side, in the end those on both.
  void align(const std::vector<int>& column, bool one_side, bool by_before) {
    std::vector<double> wanted, distances;
    for (std::size_t k = 0; k < column.size(); ++k) {
      const Item& item = items_[column[k]];
      double sum = 0.0;
      int count = 0;
      const auto add = [&](const std::vector<int>& beside) {
        for (const int other : beside) sum += items_[other].y;
        count += static_cast<int>(beside.size());
      };
      if (!one_side || by_before) add(item.before);
      if (!one_side || !by_before) add(item.after);
      wanted.push_back(count > 0 ? sum / count : item.y);
      if (k > 0) distances.push_back((items_[column[k - 1]].height + item.height) / 2 + row_gap_);
    }
    const std::vector<double> found = kept_apart(wanted, distances);
    for (std::size_t k = 0; k < column.size(); ++k) items_[column[k]].y = found[k];
  }

  std::span<const LayoutNode> nodes_;
  std::span<const LayoutEdge> edges_;
  double column_gap_, row_gap_;
  std::vector<Item> items_;  ///< the nodes, then the passes of edges
  std::vector<std::vector<int>> columns_, passes_;
};

}  // namespace

LayeredLayout layered_layout(std::span<const LayoutNode> nodes, std::span<const LayoutEdge> edges, double column_gap,
                             double row_gap) {
  if (nodes.empty()) return {};
  return Layout(nodes, edges, column_gap, row_gap).take();
}

}  // namespace rhec::sim
