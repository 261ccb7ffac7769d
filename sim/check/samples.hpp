#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/model/model.hpp"
#include "rhec/sim/numbers/random.hpp"

// Random points [x; u; p] within bounds, and which of their variables decide whether something is wrong there.
namespace rhec::sim {

inline constexpr double reach_of_samples = 3.0;  ///< of variables without bounds, in scales

/// Points may be longer than [x; u; p]: what stands behind is never drawn anew.
class Samples {
 public:
  using Point = std::vector<double>;
  struct Dimension {
    std::string name;
    double lower, upper, scale;
  };

  Samples(const ModelDescription& about, std::uint64_t seed, std::string_view stream);

  const std::vector<Dimension>& dimensions() const { return dimensions_; }
  RandomStream& random() { return random_; }
  /// Half of the samples are uniform; the others have some or all variables at a bound or at zero. The first one is
  /// zero, or as close to it as bounds allow.
  Point sample(int index);
  /// The same point with one variable drawn anew.
  Point redrawn(Point z, int j);
  /// "kappa 0.5, u1 2"
  std::string text_of(const Point& z) const;

 private:
  double draw(int j) { return random_.uniform(dimensions_[j].lower, dimensions_[j].upper); }

  std::vector<Dimension> dimensions_;
  RandomStream random_;
};

using PointsAreBad = std::function<std::vector<bool>(std::span<const Samples::Point> points)>;

/// The variables that decide whether a sample is bad, and the ranges where it is, as "v in [-1.6, -1.5] or [1.5, 1.6]";
/// empty if there are none. A variable decides if drawing it alone anew often mends a bad sample.
std::string region_of(Samples& samples, const std::vector<Samples::Point>& bad, const PointsAreBad& are_bad);

}  // namespace rhec::sim
