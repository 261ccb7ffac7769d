#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "rhec/core/estimation/health.hpp"

namespace rhec {

/// Of what a sensor measures by the position [x; y].
using PositionDerivatives = Eigen::Matrix<double, Eigen::Dynamic, 2, 0, most_sensor_outputs, 2>;

/// By how much a position has moved, and the covariance of that [m], [m^2].
struct Displacement {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
};

/// The displacement that a position's innovation nu with the covariance S says, by weighted least squares:
/// (C' S^-1 C)^-1 C' S^-1 nu with the covariance (C' S^-1 C)^-1. `derivatives` C: of what the innovation is of, in its
/// order, by the position. False, and nothing else, where they do not determine it.
bool displacement_of(const Innovation::OfSensor<1>& value, const Innovation::OfSensor<Eigen::Dynamic>& covariance,
                     const PositionDerivatives& derivatives, Displacement& result) noexcept;

/// How much more probable an innovation is if its mean is zero, with its covariance, than if something has moved by an
/// unknown distance: a logarithm. `jump`: what it would be if nothing had moved. The unknown displacement has the
/// isotropic variance that suits `jump` best, |jump|^2 / n.
double log_odds_of_return(const Innovation::OfSensor<1>& value, const Innovation::OfSensor<Eigen::Dynamic>& covariance,
                          const Innovation::OfSensor<1>& jump) noexcept;

/// Where a sensor's position was before it moved, and was followed: a path of steps, of which the last ones are
/// remembered, for some time.
class PastPlaces {
 public:
  static constexpr std::size_t capacity = 2;
  static constexpr double longest_memory = 300.0;  ///< of a place after it was left [s]

  void clear() noexcept { count_ = 0; }
  /// Of which sensor; only while there are some.
  int sensor() const noexcept { return sensor_; }
  std::size_t count() const noexcept { return count_; }
  /// A sensor has moved at a time [s]. Those of another one are forgotten.
  void leave(int sensor, const Displacement& step, double time) noexcept;
  /// Forgets what was left too long before a time.
  void forget_before(double time) noexcept;
  /// The displacement from here to a place, 0: the oldest.
  Displacement to(std::size_t place) const noexcept;
  /// It has come back to a place: what it was away from there for is forgotten.
  void come_back(std::size_t place) noexcept { count_ = place; }

 private:
  struct Step {
    Displacement displacement;
    double time = 0.0;  ///< [s]
  };
  void forget_oldest() noexcept;

  std::array<Step, capacity> steps_;
  std::size_t count_ = 0;
  int sensor_ = -1;
};

}  // namespace rhec
