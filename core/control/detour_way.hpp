#pragma once

#include <optional>

#include "dubins_path.hpp"
#include "rhec/core/control/path.hpp"

namespace rhec {

/// What a vehicle drives for a while in place of its path. Its places are arc lengths [m], of which each way says how
/// they are counted. Nothing here allocates or throws.
class DetourWay {
 public:
  virtual bool is_under_way() const noexcept = 0;
  virtual void end() noexcept = 0;
  /// Moves on with the vehicle, whose direction is its heading, and for which a time has passed [s]. It ends where the
  /// vehicle has arrived, or is not on this way any more; then `is_under_way` is false. True: it leads the other way
  /// from here on, so that a plan of before is none.
  virtual bool advance(const Path& path, const Pose& vehicle, double time) noexcept = 0;
  virtual bool has_arrived() const noexcept = 0;   ///< once it has ended: at its end, and not off it
  virtual double arc_length() const noexcept = 0;  ///< where the vehicle is
  /// Where the reference is after a time [s].
  virtual double arc_length_after(double arc_length, double time) const noexcept = 0;
  virtual PathPoint point_at(const Path& path, double arc_length) const noexcept = 0;
  /// The arc length of the path beside a place of this way.
  virtual double path_beside(const Path& path, double arc_length) const noexcept = 0;
  /// Whether the reference rests here for now.
  virtual bool waits() const noexcept { return false; }
  /// Where on its path a vehicle at a place goes on once this way has ended; without a value: where it left the path.
  virtual std::optional<double> goes_on_at(const Path& path, double x, double y) const noexcept = 0;

 protected:
  DetourWay() = default;
  DetourWay(const DetourWay&) = default;
  DetourWay& operator=(const DetourWay&) = default;
  ~DetourWay() = default;
};

}  // namespace rhec
