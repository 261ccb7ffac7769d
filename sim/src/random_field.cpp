#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "rhec/core/error.hpp"
#include "rhec/sim/random.hpp"
#include "rhec/sim/slip_field.hpp"

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
      : ranges_(options.channels), spacing_(lattice_step * options.correlation_length) {
    const double wanted = std::ceil(options.period / spacing_);
    if (wanted * wanted > 1e7) {
      throw Error(
          fmt::format("gaussian slip field: a period of {} m takes {:.0f} x {:.0f} lattice points at a correlation "
                      "length of {} m; choose a shorter period or a longer correlation length",
                      options.period, wanted, wanted, options.correlation_length));
    }
    // With fewer points than the kernel has, the field would be correlated with its own repetition.
    side_ = std::max(static_cast<int>(wanted), 2 * taps);
    noise_.resize(ranges_.size() * side_ * side_);
    // Each channel has its own stream: a channel more leaves the others as they were. Scaling the noise by the kernel's
    // norm, the square root of sum exp(-2 d^2 / L^2) = pi L^2 / (2 spacing^2), gives unit variance.
    const double scale = lattice_step * std::sqrt(2.0 / std::numbers::pi);
    auto value = noise_.begin();
    for (std::size_t channel = 0; channel < ranges_.size(); ++channel) {
      RandomStream random(options.seed, fmt::format("gaussian slip field, channel {}", channel));
      for (int i = 0; i < side_ * side_; ++i) *value++ = scale * random.normal();
    }
    for (int tap = 0; tap < taps; ++tap) fixed_weights_[tap] = std::exp(-std::pow(lattice_step * offset(tap), 2));
  }

  int channels() const noexcept override { return static_cast<int>(ranges_.size()); }

  void look_up(double x, double y, double* values) const noexcept override {
    Axis columns, rows;
    look_at(x / spacing_, columns);
    look_at(y / spacing_, rows);
    for (std::size_t channel = 0; channel < ranges_.size(); ++channel) {
      const double* noise = noise_.data() + channel * side_ * side_;
      double g = 0.0;
      for (int i = 0; i < taps; ++i) {
        const double* row = noise + static_cast<std::ptrdiff_t>(rows.indices[i]) * side_;
        double sum = 0.0;
        for (int j = 0; j < taps; ++j) sum += columns.weights[j] * row[columns.indices[j]];
        g += rows.weights[i] * sum;
      }
      const auto [lower, upper] = ranges_[channel];
      values[channel] = lower + (upper - lower) * 0.5 * std::erfc(-g / std::numbers::sqrt2);
    }
  }

 private:
  static constexpr double lattice_step = 0.7;  // in correlation lengths
  static constexpr int taps = 12;              // beyond them the kernel is below 1e-7
  static constexpr int offset(int tap) { return tap - (taps / 2 - 1); }

  // The lattice lines that a coordinate sees, and how much of each.
  struct Axis {
    std::array<double, taps> weights;
    std::array<int, taps> indices;
  };

  void look_at(double coordinate, Axis& axis) const noexcept {
    const double whole = std::floor(coordinate), fraction = coordinate - whole;
    // exp(-a^2 (f - m)^2) = exp(-a^2 f^2) * exp(2 a^2 f)^m * exp(-a^2 m^2) spares an exponential per tap.
    constexpr double square = lattice_step * lattice_step;
    const double ratio = std::exp(2.0 * square * fraction);
    double factor = std::exp(-square * fraction * (fraction - 2.0 * offset(0)));
    int index = static_cast<int>(std::fmod(whole + offset(0), side_));
    if (index < 0) index += side_;
    for (int tap = 0; tap < taps; ++tap) {
      axis.weights[tap] = factor * fixed_weights_[tap];
      axis.indices[tap] = index;
      factor *= ratio;
      if (++index == side_) index = 0;
    }
  }

  std::vector<SlipRange> ranges_;
  double spacing_;
  int side_ = 0;
  std::vector<double> noise_;  // channel by channel, row by row
  std::array<double, taps> fixed_weights_;
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
  // A random number for each square, from its place alone, so that the plane needs no table.
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
