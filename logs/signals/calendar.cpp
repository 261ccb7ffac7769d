#include "rhec/logs/signals/calendar.hpp"

#include <chrono>

namespace rhec::logs {
namespace {

constexpr std::int64_t in_second = 1'000'000'000;

/// Cuts digits and marks off the front of a text.
class Cutter {
 public:
  explicit Cutter(std::string_view text) noexcept : text_(text) {}

  bool is_done() const noexcept { return text_.empty(); }
  char front() const noexcept { return text_.empty() ? '\0' : text_.front(); }
  bool take(std::string_view any_of) noexcept {
    if (text_.empty() || any_of.find(text_.front()) == std::string_view::npos) return false;
    text_.remove_prefix(1);
    return true;
  }
  /// So many digits at least, and at most; -1 where there are none.
  int number(int least, int most) noexcept {
    int value = 0, digits = 0;
    for (; digits < most && front() >= '0' && front() <= '9'; ++digits) {
      value = 10 * value + (front() - '0');
      text_.remove_prefix(1);
    }
    return digits < least ? -1 : value;
  }
  /// Digits behind a point, in nanoseconds; what is less is dropped.
  std::int64_t fraction() noexcept {
    std::int64_t value = 0;
    for (std::int64_t weight = in_second / 10; front() >= '0' && front() <= '9'; weight /= 10) {
      value += weight * (front() - '0');
      text_.remove_prefix(1);
    }
    return value;
  }

 private:
  std::string_view text_;
};

std::optional<std::chrono::sys_days> date_of(Cutter& cutter) noexcept {
  Cutter ahead = cutter;
  int year = ahead.number(4, 4), month = 0, day = 0;
  if (year >= 0 && (ahead.front() == '-' || ahead.front() == '/')) {
    const std::string_view mark = ahead.front() == '-' ? "-" : "/";
    ahead.take(mark);
    month = ahead.number(1, 2);
    if (!ahead.take(mark)) return std::nullopt;
    day = ahead.number(1, 2);
  } else {
    ahead = cutter;
    day = ahead.number(1, 2);
    if (!ahead.take(".")) return std::nullopt;
    month = ahead.number(1, 2);
    if (!ahead.take(".")) return std::nullopt;
    year = ahead.number(4, 4);
  }
  if (year < 1970 || year > 2200 || month < 1 || day < 1) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok()) return std::nullopt;
  cutter = ahead;
  return std::chrono::sys_days(date);
}

std::optional<std::int64_t> time_of_day(Cutter& cutter) noexcept {
  const int hour = cutter.number(1, 2);
  if (hour < 0 || !cutter.take(":")) return std::nullopt;
  const int minute = cutter.number(2, 2);
  int seconds = 0;
  std::int64_t part = 0;
  if (cutter.take(":")) {
    seconds = cutter.number(2, 2);
    if (cutter.take(".,")) part = cutter.fraction();
  }
  constexpr int leap_second = 60;
  if (hour > 23 || minute < 0 || minute > 59 || seconds < 0 || seconds > leap_second) return std::nullopt;
  return (std::int64_t{hour} * 3600 + minute * 60 + seconds) * in_second + part;
}

/// "Z", "+02:00", "-0530", "UTC"; none: UTC.
std::optional<std::int64_t> offset_of(Cutter& cutter) noexcept {
  cutter.take(" ");
  if (cutter.take("Zz") || cutter.is_done()) return 0;
  if (cutter.take("U")) return cutter.take("T") && cutter.take("C") ? std::optional<std::int64_t>(0) : std::nullopt;
  const bool is_west = cutter.front() == '-';
  if (!cutter.take("+-")) return std::nullopt;
  const int hours = cutter.number(2, 2);
  cutter.take(":");
  const int minutes = cutter.is_done() ? 0 : cutter.number(2, 2);
  if (hours < 0 || hours > 14 || minutes < 0 || minutes > 59) return std::nullopt;
  const std::int64_t offset = (std::int64_t{hours} * 3600 + std::int64_t{minutes} * 60) * in_second;
  return is_west ? -offset : offset;
}

}  // namespace

std::optional<Stamp> calendar_stamp(std::string_view text) noexcept {
  Cutter cutter(text);
  const std::optional<std::chrono::sys_days> date = date_of(cutter);
  std::int64_t day = 0, time = 0;
  if (date) {
    day = std::int64_t{date->time_since_epoch().count()} * 86400 * in_second;
    if (cutter.is_done()) return day;
    if (!cutter.take("T _t")) return std::nullopt;
  }
  const std::optional<std::int64_t> found = time_of_day(cutter);
  if (!found) return std::nullopt;
  time = *found;
  const std::optional<std::int64_t> offset = offset_of(cutter);
  if (!offset || !cutter.is_done()) return std::nullopt;
  return day + time - *offset;
}

}  // namespace rhec::logs
