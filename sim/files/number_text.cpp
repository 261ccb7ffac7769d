#include "rhec/sim/files/number_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>

namespace rhec::sim {
namespace {

constexpr std::array<double, 13> powers = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12};
// Above this limit, the scaled number is no longer a unique integer.
constexpr double largest_exact = 9e15;

}  // namespace

int decimals_for(double scale) noexcept {
  if (!(scale > 0.0) || !std::isfinite(scale)) return 6;
  return std::clamp(static_cast<int>(std::ceil(5.0 - std::log10(scale) - 1e-9)), 0, 12);
}

void append_number(double value, int decimals, std::string& text) {
  if (!std::isfinite(value)) {
    text += "null";
    return;
  }
  std::array<char, 40> digits;
  const double scaled = std::abs(value) * powers[static_cast<std::size_t>(decimals)];
  if (!(scaled < largest_exact)) {
    const auto [end, error] = std::to_chars(digits.begin(), digits.end(), value);
    text.append(digits.begin(), end);
    return;
  }
  auto whole = static_cast<std::uint64_t>(std::llround(scaled));
  if (whole == 0) {
    text += '0';
    return;
  }
  while (decimals > 0 && whole % 10 == 0) {
    whole /= 10;
    --decimals;
  }
  char* const end = digits.end();
  char* first = end;
  for (int place = 0; whole > 0 || place <= decimals; ++place, whole /= 10) {
    if (place == decimals && place > 0) *--first = '.';
    *--first = static_cast<char>('0' + whole % 10);
  }
  if (value < 0.0) *--first = '-';
  text.append(first, end);
}

}  // namespace rhec::sim
