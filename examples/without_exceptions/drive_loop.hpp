#pragma once

#include <memory>

/// The estimator and the controller of one robot, for programs that are compiled without exceptions: this header
/// includes nothing of rhec, and none of its functions throws. Times are seconds, any clock that goes forward.
class DriveLoop {
 public:
  struct Waypoint {
    double x, y, speed;  ///< [m], [m/s]
  };

  DriveLoop() noexcept;
  ~DriveLoop();
  /// May take long and allocates. False if something is wrong; `problem` says what.
  bool set_up(const char* robot_file, const Waypoint* path, int count) noexcept;
  const char* problem() const noexcept { return problem_; }

  double step() const noexcept;
  /// What the sensors say, in the order of the model's outputs; NaN: missing.
  void measure(double time, const double* outputs) noexcept;
  /// The inputs to apply from now on, in the order of the model; valid until the next call.
  const double* inputs(double time) noexcept;
  /// Between two samples: work that does not need the next one.
  void prepare() noexcept;
  bool finished() const noexcept;
  /// The estimate of the last call of `inputs`.
  double slip(int parameter) const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
  char problem_[512] = "";
};
