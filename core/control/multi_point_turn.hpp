#pragma once

#include <array>

#include "approach.hpp"
#include "detour_way.hpp"
#include "dubins_path.hpp"
#include "rhec/core/control/path.hpp"

namespace rhec {

/// A turn on one place, in several moves, for a vehicle that has no room to go round: arcs forwards and in reverse by
/// turns, all of which turn its heading in one sense. How far each of them leads is for its user to say, who knows the
/// limits.
///
/// Its places are arc lengths over all moves [m]. A move is driven to its end before the next one begins.
class MultiPointTurn final : public DetourWay {
 public:
  static constexpr int most_moves = 32;
  /// A move is over where less than this is left of it [m].
  static constexpr double least_way = 0.1;

  /// How a turn begins.
  struct Begin {
    Pose vehicle;                       ///< with its heading
    int rotation = 1;                   ///< of the heading: 1 to the left, -1 to the right
    bool in_reverse = false;            ///< the first move
    TurningCircle forwards, backwards;  ///< how the vehicle turns in moves of either kind
    int section = 0;                    ///< of the path
    double arc_length = 0.0;            ///< where the vehicle is on the path [m]
  };
  /// Without a move so far. It is under way from the first one on.
  void begin(const Begin& begin) noexcept;
  /// Adds a move in the other sense than the last one, that turns the heading by an angle > 0 [rad], and is the one to
  /// be driven. False: there are too many, or the vehicle does not turn so.
  bool add(double angle) noexcept;
  /// The last move ends at a place that is on it.
  void end_last_at(double arc_length) noexcept;
  /// The first move is the one to be driven.
  void set_off() noexcept;
  void end() noexcept override { move_ = count_ = 0; }
  bool is_under_way() const noexcept override { return move_ < count_; }
  bool has_arrived() const noexcept override { return count_ > 0 && move_ == count_; }
  int moves() const noexcept { return count_; }
  bool in_reverse() const noexcept { return is_under_way() && is_reverse(move_); }  ///< the move that is being driven

  double length() const noexcept { return count_ > 0 ? ends_[static_cast<std::size_t>(count_ - 1)] : 0.0; }
  /// By how much the last move turns [rad], and where it begins [m].
  double last_angle() const noexcept;
  double last_start() const noexcept { return start_of(count_ - 1); }
  double last_start_time() const noexcept { return time_of(count_ - 1); }  ///< [s]
  double time() const noexcept { return time_of(count_); }                 ///< for all moves [s]

  /// It ends after the last move, or where the vehicle has left its way. True: another move has begun.
  bool advance(const Path& path, const Pose& vehicle, double time) noexcept override;
  /// Before each move the reference rests for this share of the time that steering takes, from lock to lock but before
  /// the first one; the rest is steered while it drives.
  static constexpr double standing_share = 0.7;
  bool waits() const noexcept override { return wait_ > 0.0; }
  double arc_length() const noexcept override { return done_; }
  /// On the move that is at an arc length, and no further than to its end.
  double arc_length_after(double arc_length, double time) const noexcept override;
  PathPoint point_at(const Path& path, double arc_length) const noexcept override;
  double path_beside(const Path& path, double arc_length) const noexcept override;
  std::optional<double> goes_on_at(const Path& path, double x, double y) const noexcept override;
  /// The place of the path that is closest to one of this way.
  PathProjection beside(const Path& path, double x, double y) const noexcept;

 private:
  bool is_reverse(int move) const noexcept { return begin_.in_reverse != (move % 2 != 0); }
  const TurningCircle& turn_of(int move) const noexcept {
    return is_reverse(move) ? begin_.backwards : begin_.forwards;
  }
  double start_of(int move) const noexcept { return move > 0 ? ends_[static_cast<std::size_t>(move - 1)] : 0.0; }
  int move_at(double arc_length) const noexcept;
  double wait_of(int move) const noexcept;
  double time_of(int moves) const noexcept;                  ///< for the first ones of them [s]
  Pose pose_at(int move, double arc_length) const noexcept;  ///< with the direction of motion

  Begin begin_;
  std::array<Pose, most_moves> starts_{};  ///< with the heading
  std::array<double, most_moves> ends_{};  ///< [m]
  int count_ = 0, move_ = 0;               ///< moves, and which one is being driven
  double done_ = 0.0, wait_ = 0.0;         ///< [m], [s]
};

}  // namespace rhec
