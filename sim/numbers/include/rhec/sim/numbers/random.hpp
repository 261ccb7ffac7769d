#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// A bijective hash of 64-bit numbers (the output function of splitmix64, Steele et al. 2014).
constexpr std::uint64_t scatter(std::uint64_t z) noexcept {
  z += 0x9E3779B97F4A7C15u;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

/// The upper 53 bits as a number in [0, 1).
constexpr double to_unit_interval(std::uint64_t bits) noexcept { return static_cast<double>(bits >> 11) * 0x1.0p-53; }

/// A stream of random numbers (xoshiro256++, Blackman & Vigna 2019). It has its own distributions, since those of the
/// standard library differ between implementations.
///
/// Seed and name together select the stream. A new consumer with its own name therefore does not shift the numbers of
/// other streams.
class RHEC_EXPORT RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::string_view name) noexcept;

  std::uint64_t bits() noexcept;
  /// Uniform in [0, 1).
  double uniform() noexcept { return to_unit_interval(bits()); }
  /// Uniform in [lower, upper).
  double uniform(double lower, double upper) noexcept { return lower + (upper - lower) * uniform(); }
  /// Normal with mean 0 and variance 1 (Box & Muller 1958).
  double normal() noexcept;

 private:
  std::array<std::uint64_t, 4> state_;
  double spare_ = 0.0;  // Box-Muller makes two at a time
  bool has_spare_ = false;
};

}  // namespace rhec::sim
