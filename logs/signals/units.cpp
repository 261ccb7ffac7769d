#include "rhec/logs/signals/units.hpp"

#include <numbers>
#include <utility>

namespace rhec::logs {
namespace {

struct Row {
  const char* name;
  double factor;
  const char* si;
};

constexpr double turn = 2.0 * std::numbers::pi, inch = 0.0254, mile = 1609.344, standard_gravity = 9.80665;
constexpr Row rows[] = {
    {"m", 1.0, "m"},
    {"mm", 1e-3, "m"},
    {"cm", 1e-2, "m"},
    {"km", 1e3, "m"},
    {"in", inch, "m"},
    {"ft", 12.0 * inch, "m"},
    {"m/s", 1.0, "m/s"},
    {"mm/s", 1e-3, "m/s"},
    {"cm/s", 1e-2, "m/s"},
    {"km/h", 1.0 / 3.6, "m/s"},
    {"mph", mile / 3600.0, "m/s"},
    {"kn", 1852.0 / 3600.0, "m/s"},
    {"ft/s", 12.0 * inch, "m/s"},
    {"m/s^2", 1.0, "m/s^2"},
    {"g", standard_gravity, "m/s^2"},
    {"rad", 1.0, "rad"},
    {"mrad", 1e-3, "rad"},
    {"deg", turn / 360.0, "rad"},
    {"rev", turn, "rad"},
    {"rad/s", 1.0, "rad/s"},
    {"mrad/s", 1e-3, "rad/s"},
    {"deg/s", turn / 360.0, "rad/s"},
    {"rev/s", turn, "rad/s"},
    {"rpm", turn / 60.0, "rad/s"},
    {"1", 1.0, "1"},
    {"%", 1e-2, "1"},
};

// In UTF-8, and the sign of degrees in Latin-1, too.
constexpr std::pair<const char*, const char*> as_written[] = {{"\xC2\xB0", "deg"},
                                                              {"\xB0", "deg"},
                                                              {"degree", "deg"},
                                                              {"degrees", "deg"},
                                                              {"\xC2\xB0/s", "deg/s"},
                                                              {"\xB0/s", "deg/s"},
                                                              {"deg/sec", "deg/s"},
                                                              {"dps", "deg/s"},
                                                              {"degrees/s", "deg/s"},
                                                              {"radian", "rad"},
                                                              {"radians", "rad"},
                                                              {"rad/sec", "rad/s"},
                                                              {"rps", "rev/s"},
                                                              {"1/min", "rpm"},
                                                              {"u/min", "rpm"},
                                                              {"min^-1", "rpm"},
                                                              {"rev/min", "rpm"},
                                                              {"kmh", "km/h"},
                                                              {"kph", "km/h"},
                                                              {"km/hr", "km/h"},
                                                              {"m/sec", "m/s"},
                                                              {"mps", "m/s"},
                                                              {"knots", "kn"},
                                                              {"kt", "kn"},
                                                              {"m/s2", "m/s^2"},
                                                              {"m/s\xC2\xB2", "m/s^2"},
                                                              {"m/s\xB2", "m/s^2"},
                                                              {"meter", "m"},
                                                              {"meters", "m"},
                                                              {"metres", "m"},
                                                              {"-", "1"}};

}  // namespace

std::optional<Unit> find_unit(std::string_view name) {
  for (const Row& row : rows)
    if (name == row.name) return Unit{row.factor, row.si};
  return std::nullopt;
}

std::string unit_of_header(std::string_view text) {
  std::string plain;
  for (const char c : text)
    if (c != ' ') plain += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  for (const auto& [written, name] : as_written)
    if (plain == written) return name;
  return find_unit(plain) ? plain : std::string();
}

std::vector<std::string> unit_names() {
  std::vector<std::string> names;
  for (const Row& row : rows) names.emplace_back(row.name);
  return names;
}

}  // namespace rhec::logs
