#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>

#include "lattice_sum.hpp"
#include "piecewise_polynomial.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/numbers/random.hpp"
#include "rhec/sim/world/slip_field.hpp"

namespace rhec::sim {
namespace {

void check_channels(const char* field, const std::vector<SlipRange>& channels) {
  if (channels.empty()) {
    throw Error(fmt::format("{} slip field: no channels; give one range per parameter of the model", field));
  }
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const auto [lower, upper] = channels[i];
    if (!(std::isfinite(lower) && std::isfinite(upper) && lower <= upper)) {
      throw Error(fmt::format("{} slip field: channel {} has the range [{}, {}]; expected lower <= upper", field, i,
                              lower, upper));
    }
  }
}

void check_length(const char* field, const char* key, double value) {
  if (!(std::isfinite(value) && value > 0.0)) {
    throw Error(fmt::format("{} slip field: {} is {}; expected a length greater than 0 m", field, key, value));
  }
}

class Gaussian final : public SlipField {
 public:
  explicit Gaussian(const GaussianField& options)
      : tables_(&shared_tables()), ranges_(options.channels), spacing_(lattice_step * options.correlation_length) {
    const double wanted = std::ceil(options.period / spacing_);
    if (wanted * wanted > 1e7) {
      throw Error(
          fmt::format("gaussian slip field: a period of {} m takes {:.4g} x {:.4g} lattice points at a correlation "
                      "length of {} m; choose a shorter period or a longer correlation length",
                      options.period, wanted, wanted, options.correlation_length));
    }
    // With fewer points than the kernel, the field would be correlated with its periodic repetition.
    side_ = std::max<std::ptrdiff_t>(static_cast<int>(wanted), 2 * taps);
    // The lattice is padded by the kernel's width, so that no kernel wraps around.
    stride_ = side_ + taps - 1;
    noise_.resize(ranges_.size() * stride_ * stride_);
    // Each channel has its own stream: adding a channel does not change the others. Scaling the noise by the kernel's
    // norm, the square root of sum exp(-2 d^2 / L^2) = pi L^2 / (2 spacing^2), gives unit variance.
    const double scale = lattice_step * std::sqrt(2.0 / std::numbers::pi);
    for (std::size_t channel = 0; channel < ranges_.size(); ++channel) {
      RandomStream random(options.seed, fmt::format("gaussian slip field, channel {}", channel));
      double *const noise = noise_.data() + channel * stride_ * stride_, *const end = noise + side_ * stride_;
      for (double* row = noise; row < end; row += stride_) {
        for (int column = 0; column < side_; ++column) row[column] = scale * random.normal();
        std::copy_n(row, stride_ - side_, row + side_);
      }
      std::copy_n(noise, (stride_ - side_) * stride_, end);
    }
    for (int tap = 0; tap < taps; ++tap) fixed_weights_[tap] = std::exp(-std::pow(lattice_step * offset(tap), 2));
  }

  int channels() const noexcept override { return static_cast<int>(ranges_.size()); }
  bool is_smooth() const noexcept override { return true; }

 private:
  static constexpr double lattice_step = 0.7;  // in correlation lengths
  static constexpr int taps = lattice_taps;    // beyond these the kernel is below 1e-7
  static constexpr int offset(int tap) { return tap - (taps / 2 - 1); }
  static constexpr double farthest = 8.5;  // standard deviations; the probability beyond is below rounding

  using Taps = std::array<double, taps>;
  // Two neighbours at once, which every machine supports; the compiler does not vectorise this on its own.
  using Pair [[gnu::vector_size(2 * sizeof(double))]] = double;

  // Tables that replace exponential and error functions at every look-up.
  struct Tables {
    PiecewisePolynomial share_below{-farthest, farthest, 544,
                                    [](double g) { return 0.5 * std::erfc(-g / std::numbers::sqrt2); }};
    PiecewisePolynomial first_weight{
        0.0, 1.0, 128, [](double f) { return std::exp(-lattice_step * lattice_step * f * (f - 2.0 * offset(0))); }};
    PiecewisePolynomial ratio{0.0, 1.0, 32, [](double f) { return std::exp(2.0 * lattice_step * lattice_step * f); }};
  };
  static const Tables& shared_tables() {
    static const Tables tables;
    return tables;
  }

  // The lattice lines that contribute to a coordinate, and their weights.
  struct Axis {
    Taps weights;
    std::ptrdiff_t first;
  };

  Axis look_at(double coordinate) const noexcept {
    const double whole = std::floor(coordinate), fraction = coordinate - whole;
    // exp(-a^2 (f - m)^2) = exp(-a^2 f^2) * exp(2 a^2 f)^m * exp(-a^2 m^2) avoids an exponential per tap.
    const double ratio = tables_->ratio(fraction), square = ratio * ratio;
    Axis axis;
    Pair factor = tables_->first_weight(fraction) * Pair{1.0, ratio};
    for (int tap = 0; tap < taps; tap += 2, factor *= square) {
      Pair weights;
      std::memcpy(&weights, &fixed_weights_[tap], sizeof weights);
      weights *= factor;
      std::memcpy(&axis.weights[tap], &weights, sizeof weights);
    }
    const double first = whole + offset(0);
    axis.first = static_cast<std::ptrdiff_t>(first - side_ * std::floor(first / side_));
    return axis;
  }

  void look_up(double x, double y, double* values) const noexcept override {
    const Axis columns = look_at(x / spacing_), rows = look_at(y / spacing_);
    const double* corner = noise_.data() + rows.first * stride_ + columns.first;
    for (const auto& [lower, upper] : ranges_) {
      const double sum = lattice_sum_(corner, stride_, rows.weights.data(), columns.weights.data());
      const double g = std::min(std::max(sum, -farthest), farthest);
      *values++ = lower + (upper - lower) * tables_->share_below(g);
      corner += stride_ * stride_;
    }
  }

  const Tables* tables_;
  LatticeSum lattice_sum_ = available_lattice_sums().back();
  std::vector<SlipRange> ranges_;
  double spacing_;
  std::ptrdiff_t side_ = 0, stride_ = 0;
  std::vector<double> noise_;  // by channel, then by row
  Taps fixed_weights_;
};

class Patches final : public SlipField {
 public:
  explicit Patches(const PatchField& options)
      : seed_(scatter(options.seed)), ranges_(options.channels), size_(options.patch_size) {}

  int channels() const noexcept override { return static_cast<int>(ranges_.size()); }

  void look_up(double x, double y, double* values) const noexcept override {
    // A site lies within sqrt(2) squares of (x, y), so the nearest one is at most two squares away.
    const double column = std::floor(x / size_), row = std::floor(y / size_);
    double nearest = 1e300;
    std::uint64_t site = 0;
    for (int i = -2; i <= 2; ++i) {
      for (int j = -2; j <= 2; ++j) {
        const std::uint64_t candidate = number_of(column + i, row + j);
        const double dx = column + i + to_unit_interval(scatter(candidate + 1)) - x / size_;
        const double dy = row + j + to_unit_interval(scatter(candidate + 2)) - y / size_;
        const double square = dx * dx + dy * dy;
        if (square < nearest) {
          nearest = square;
          site = candidate;
        }
      }
    }
    for (std::size_t channel = 0; channel < ranges_.size(); ++channel) {
      const auto [lower, upper] = ranges_[channel];
      values[channel] = lower + (upper - lower) * to_unit_interval(scatter(site + 3 + channel));
    }
  }

 private:
  // A random number for each square, computed from its position alone, so that the plane needs no table.
  std::uint64_t number_of(double column, double row) const noexcept {
    const auto bits = [](double v) { return static_cast<std::uint64_t>(static_cast<std::int64_t>(v)); };
    return scatter(scatter(seed_ ^ bits(column)) + bits(row));
  }

  std::uint64_t seed_;
  std::vector<SlipRange> ranges_;
  double size_;
};

}  // namespace

std::unique_ptr<const SlipField> gaussian_random_field(const GaussianField& options) {
  check_channels("gaussian", options.channels);
  check_length("gaussian", "correlation_length", options.correlation_length);
  check_length("gaussian", "period", options.period);
  return std::make_unique<Gaussian>(options);
}

std::unique_ptr<const SlipField> patch_field(const PatchField& options) {
  check_channels("patch", options.channels);
  check_length("patch", "patch_size", options.patch_size);
  return std::make_unique<Patches>(options);
}

}  // namespace rhec::sim
