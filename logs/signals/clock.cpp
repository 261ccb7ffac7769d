#include "rhec/logs/signals/clock.hpp"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <system_error>

#include "rhec/logs/signals/calendar.hpp"

namespace rhec::logs {
namespace {

constexpr double second = 1e9, millisecond = 1e6, microsecond = 1e3;
// Counts from there on are too large for seconds, milliseconds and microseconds since 1970.
constexpr double not_seconds = 1e11, not_milliseconds = 1e14, not_microseconds = 1e17;
constexpr double largest_stamp = 9.2e18;

double unit_by_size(double count) noexcept {
  const double size = std::abs(count);
  if (size < not_seconds) return second;
  if (size < not_milliseconds) return millisecond;
  return size < not_microseconds ? microsecond : 1.0;
}

/// Decimals without an exponent, in integers: a double of seconds since 1970 is off by 2e-7 s.
std::optional<Stamp> exact(std::string_view text, std::int64_t unit) noexcept {
  const bool is_negative = text.starts_with('-');
  if (is_negative) text.remove_prefix(1);
  constexpr std::int64_t most = INT64_C(9200000000000000000);
  std::int64_t whole = 0, part = 0, weight = unit;
  std::size_t i = 0;
  for (; i < text.size() && text[i] != '.'; ++i) {
    if (text[i] < '0' || text[i] > '9') return std::nullopt;
    const std::int64_t digit = text[i] - '0';
    if (whole > (most / unit - digit) / 10) return std::nullopt;
    whole = 10 * whole + digit;
  }
  for (++i; i < text.size(); ++i) {
    if (text[i] < '0' || text[i] > '9') return std::nullopt;
    const int digit = text[i] - '0';
    if (weight % 10 != 0) {  // the first digit that is less than a nanosecond rounds
      if (weight == 1) part += digit >= 5 ? 1 : 0;
      weight = 0;
      continue;
    }
    weight /= 10;
    part += digit * weight;
  }
  const std::int64_t stamp = whole * unit + part;
  return is_negative ? -stamp : stamp;
}

}  // namespace

std::optional<ClockUnit> clock_unit(std::string_view unit) noexcept {
  if (unit.empty()) return 0.0;
  if (unit == "s" || unit == "sec" || unit == "seconds") return second;
  if (unit == "ms") return millisecond;
  if (unit == "us" || unit == "\xC2\xB5s") return microsecond;
  if (unit == "ns") return 1.0;
  return std::nullopt;
}

std::optional<Stamp> stamp_of(std::string_view text, ClockUnit unit) noexcept {
  if (text.starts_with('+')) text.remove_prefix(1);
  double count = 0.0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (failure != std::errc() || end != text.data() + text.size()) return calendar_stamp(text);
  if (!std::isfinite(count)) return std::nullopt;
  if (unit == 0.0) unit = unit_by_size(count);
  if (const std::optional<Stamp> stamp = exact(text, static_cast<std::int64_t>(unit))) return stamp;
  return stamp_of(count, unit);
}

std::optional<Stamp> stamp_of(double count, ClockUnit unit) noexcept {
  if (unit == 0.0) unit = unit_by_size(count);
  if (!(std::abs(count) * unit < largest_stamp)) return std::nullopt;
  return static_cast<Stamp>(std::llround(count * unit));
}

ClockName parse_clock_name(std::string_view text) {
  const std::size_t open = text.rfind('[');
  if (open == std::string_view::npos || !text.ends_with(']')) return {std::string(text), {}};
  std::string_view name = text.substr(0, open), unit = text.substr(open + 1, text.size() - open - 2);
  // "position[left]" is an item of a list.
  if (!name.ends_with(' ') && !clock_unit(unit)) return {std::string(text), {}};
  for (std::string_view* each : {&name, &unit}) {
    while (each->starts_with(' ')) each->remove_prefix(1);
    while (each->ends_with(' ')) each->remove_suffix(1);
  }
  return {std::string(name), std::string(unit)};
}

}  // namespace rhec::logs
