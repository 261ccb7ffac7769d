#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "rhec/core/estimation/stamped_rows.hpp"
#include "rhec/core/horizon/measured_interval.hpp"

namespace rhec {

/// Where the nodes of an estimator lie, and what was measured at them and between them.
///
/// Nodes lie on a grid: at the stamp of the first measurement, and every `step` from there on, however often there are
/// measurements. Where there is a measurement no farther from such a place than a twentieth of the step, the node lies
/// there, and the grid goes on from there; so measurements at the step itself, with some jitter, are at nodes. Where no
/// measurement comes for longer than a step, the gap is divided into equal parts of at most a step, and the grid goes
/// on from the measurement behind it; so those of a slow sensor are at nodes. The newest measurement is at a node too,
/// which gives way when later ones come. All others lie between two nodes, at times of their own. An interval that has
/// more of them than there is room for ends early, in a further node.
///
/// Rows are kept as long as nodes can be taken back, so that all that was measured has its place whenever it arrives:
/// the nodes from there on are made anew, as if it had come in time. Only the constructor allocates.
class RHEC_EXPORT NodeGrid {
 public:
  struct Setup {
    double step = 0.2;            ///< [s]; a gap has 1000 parts at most, then longer ones
    double tolerance = 1e-6;      ///< measurements with stamps closer than this are one [s]
    std::size_t capacity = 4096;  ///< rows of inputs, and of measurements
    int outputs = 0, inputs = 0;  ///< n_y, n_u
    int noises = 0;               ///< the last inputs, which are not measured: they are 0
    int most_between = 0;         ///< measurements between two nodes
    int reach = 0;                ///< how many nodes can ever be taken back
  };
  explicit NodeGrid(const Setup& setup);

  /// What became of a measurement: it waits; it belongs to older nodes, which will be made anew; it is too old.
  enum class Place { waits, late, forgotten };
  /// `reach`: how many of the newest nodes can be taken back now.
  Place push_measurement(double time, Measured outputs, int reach) noexcept;
  /// What was measured at a time becomes this, instead of what there is of that stamp; as `push_measurement` if there
  /// is nothing.
  Place put_measurement(double time, Measured outputs, int reach) noexcept;
  /// Nodes from a time on are to be made anew.
  void outdate(double time) noexcept { changed_ = std::min(changed_, time); }
  void push_input(double time, const double* inputs) noexcept;
  /// The parameters have jumped soon after a time: at the last node up to there. Nothing happens if that is out of
  /// reach.
  void push_jump(double time, int reach) noexcept;
  /// Takes back the jumps from a time on, and what was measured behind another, not earlier one of the outputs that
  /// are not missing in y (n_y).
  void retract(double jumps_from, double outputs_from, const double* y) noexcept;

  /// How many of the newest nodes have to be taken back, at most `reach`, for what is stamped up to a time.
  int outdated(double until, int reach) const noexcept;
  /// Takes back so many of the newest nodes, for what is stamped up to a time.
  void take_back(int nodes, double until) noexcept;
  /// Whether a node follows of what is stamped up to a time; makes it.
  bool has_next(double until) const noexcept {
    return next_row() < measurements_.first_after(until + setup_.tolerance);
  }
  void make_next(double until) noexcept;
  /// Moves the newest node on to a time, as if nothing had been measured up to there.
  void skip_to(double time) noexcept;
  /// Drops the rows that no node needs any more if so many of the newest nodes can be taken back.
  void settle(int reach) noexcept;
  void clear() noexcept;

  std::int64_t count() const noexcept { return count_; }
  /// Of the first node of all.
  double start() const noexcept { return start_; }
  /// Of the newest node: its time, its outputs, and what was measured on the way to it.
  double time() const noexcept { return node(count_ - 1).time; }
  Measured outputs() const noexcept { return outputs_.measured(); }
  MeasuredInterval interval() const noexcept { return between_.over(duration_, mean_.data(), ends_with_jump_); }
  /// Whether the newest node gives way to the next measurement.
  bool ends_open() const noexcept { return count_ > 0 && node(count_ - 1).kind == Kind::end; }
  /// From now on an input holds for so long [s] where none follows; at first for ever.
  void hold_inputs(double seconds) noexcept { hold_ = seconds; }
  /// Means over a time of inputs that hold from their stamps on, n_u; NaN if none is known.
  const double* mean_input(double from, double to) noexcept;
  /// Measurements that no node has used, for lack of room.
  std::int64_t dropped() const noexcept { return dropped_; }

 private:
  enum class Kind : std::uint8_t { grid, end, extra, gap };
  struct Node {
    double time = 0.0, grid = 0.0;  ///< where it lies, and the last place of the grid up to there
    Kind kind = Kind::grid;
    int parts = 0;         ///< of a gap that is divided, those still to come
    double gap_end = 0.0;  ///< and where it ends
  };
  const Node& node(std::int64_t number) const noexcept {
    return nodes_[static_cast<std::size_t>(number) % nodes_.size()];
  }
  std::size_t next_row() const noexcept {
    return count_ > 0 ? measurements_.first_after(time() + setup_.tolerance) : 0;
  }
  std::int64_t oldest() const noexcept;
  std::int64_t last_before(double time) const noexcept;
  double last_node_up_to(double time) const noexcept;
  std::size_t group_end(std::size_t row) const noexcept;
  Node next_node(const Node& last, std::size_t from, std::size_t end) const noexcept;
  bool has_jump(const Node& next, std::size_t end) const noexcept;
  void collect(const Node& next, std::size_t from, std::size_t end) noexcept;

  Setup setup_;
  double near_;  ///< how far a node is moved at most [s]
  double hold_ = std::numeric_limits<double>::infinity();
  MeasuredRows measurements_;
  StampedRows inputs_;
  std::vector<Node> nodes_;  ///< the newest ones, in a ring
  std::int64_t count_ = 0;
  double start_ = 0.0;
  double changed_, changed_input_;  ///< stamps of the oldest rows, or jumps, that came behind nodes
  double lost_;                     ///< up to there rows are missing that nodes have used
  std::int64_t dropped_ = 0;
  std::vector<double> jumps_;  ///< their times, ascending
  double duration_ = 0.0;
  bool ends_with_jump_ = false;
  BetweenNodes between_;
  MeasuredOutputs outputs_;
  std::vector<double> mean_, weight_;
};

}  // namespace rhec
