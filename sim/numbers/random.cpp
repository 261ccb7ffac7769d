#include "rhec/sim/numbers/random.hpp"

#include <bit>
#include <cmath>
#include <numbers>

namespace rhec::sim {

RandomStream::RandomStream(std::uint64_t seed, std::string_view name) noexcept {
  std::uint64_t hash = 0xCBF29CE484222325u;  // FNV-1a
  for (char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x00000100000001B3u;
  // Scattering the seed before mixing in the name separates (seed, name) pairs that differ in only a few bits.
  std::uint64_t word = scatter(seed) ^ hash;
  for (std::uint64_t& part : state_) part = word = scatter(word);
}

std::uint64_t RandomStream::bits() noexcept {
  auto& [a, b, c, d] = state_;
  const std::uint64_t result = std::rotl(a + d, 23) + a;
  const std::uint64_t shifted = b << 17;
  c ^= a;
  d ^= b;
  b ^= c;
  a ^= d;
  c ^= shifted;
  d = std::rotl(d, 45);
  return result;
}

double RandomStream::normal() noexcept {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));  // 1 - uniform() is never 0
  const double angle = 2.0 * std::numbers::pi * uniform();
  spare_ = radius * std::sin(angle);
  has_spare_ = true;
  return radius * std::cos(angle);
}

}  // namespace rhec::sim
