#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// Slip of the ground: the model's parameters (one channel each, in the model's order) as a function of position.
/// Const, thread-safe, allocation-free.
class RHEC_EXPORT SlipField {
 public:
  virtual ~SlipField() = default;
  virtual int channels() const noexcept = 0;
  /// True for a field without edges and kinks, on which an integrator may choose its steps by error control.
  virtual bool is_smooth() const noexcept { return false; }
  /// Writes `channels()` values for any position (x, y) [m]; NaNs if the position is invalid.
  void sample(double x, double y, double* values) const noexcept;

 private:
  /// The same for finite coordinates below 1e9 m.
  virtual void look_up(double x, double y, double* values) const noexcept = 0;
};

/// Range of values of one channel of a random field.
struct SlipRange {
  double lower = 0.5;
  double upper = 1.0;
};

/// The same values everywhere.
RHEC_EXPORT std::unique_ptr<const SlipField> constant_field(std::vector<double> values);

/// A smooth random field. Each channel is an independent stationary Gaussian field g of unit variance with
///
///     E[g(a) g(b)] = exp(-|a - b|^2 / (2 L^2)),      value = lower + (upper - lower) * Phi(g),
///
/// where L is the correlation length and Phi the normal distribution function. Values are uniform in [lower, upper].
///
/// g is white noise on a square lattice, smoothed by the kernel exp(-d^2 / L^2), whose convolution with itself is the
/// required correlation. Values are therefore exactly normal, not only in the limit of many terms as with random
/// Fourier features, at about a tenth of their cost. A lattice of 0.7 L leaves ripples below 2e-4 in the variance. The
/// lattice is periodic: the field repeats itself after at least `period`.
struct GaussianField {
  std::uint64_t seed = 1;
  std::vector<SlipRange> channels = {{}, {}};
  double correlation_length = 10.0;  ///< L [m]
  double period = 500.0;             ///< [m]; memory grows with its square
};
/// Throws Error for no channels, lower > upper, lengths that are not positive, or a lattice of more than 10^7 points.
RHEC_EXPORT std::unique_ptr<const SlipField> gaussian_random_field(const GaussianField& options);

/// Patches with sharp edges: the Voronoi cells of seeded sites, each with its own value per channel, uniform in the
/// channel's range. Each square of side `patch_size` in the plane has one uniformly placed site.
struct PatchField {
  std::uint64_t seed = 1;
  std::vector<SlipRange> channels = {{}, {}};
  double patch_size = 10.0;  ///< [m]
};
/// Throws Error for no channels, lower > upper, or a size that is not positive.
RHEC_EXPORT std::unique_ptr<const SlipField> patch_field(const PatchField& options);

/// Values on a grid, one CSV file per channel:
///
///     origin_x,origin_y,cell_size       these names
///     -50,-70,2.5                       position of the first value, distance between values [m]
///     0.8,0.81,0.79, ...                values at y = origin_y, x growing
///     0.8,0.82,0.80, ...                values at y = origin_y + cell_size, and so on
///
/// Outside the grid the edge values continue. Files of different channels may have different grids.
struct RasterField {
  enum class Interpolation { bilinear, nearest };
  std::vector<std::filesystem::path> files;
  Interpolation interpolation = Interpolation::bilinear;
};
/// Throws Error, naming file and line, for other names, rows that are ragged, not numeric or have missing values, a
/// cell size that is not positive, and a file without values.
RHEC_EXPORT std::unique_ptr<const SlipField> raster_field(const RasterField& options);

/// Two grounds with a straight border: `below` where the coordinate is less than `border`, else `above`. A side may be
/// split again.
struct SplitField {
  enum class Across { x, y };
  Across across = Across::x;  ///< the coordinate that decides
  double border = 0.0;        ///< [m]
  std::unique_ptr<const SlipField> below, above;
};
/// Throws Error for a side that is missing, different numbers of channels, or a border that is not finite.
RHEC_EXPORT std::unique_ptr<const SlipField> split_field(SplitField options);

}  // namespace rhec::sim
