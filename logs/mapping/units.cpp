#include "rhec/logs/mapping/units.hpp"

#include <numbers>

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

}  // namespace

std::optional<Unit> find_unit(std::string_view name) {
  for (const Row& row : rows)
    if (name == row.name) return Unit{row.factor, row.si};
  return std::nullopt;
}

std::vector<std::string> unit_names() {
  std::vector<std::string> names;
  for (const Row& row : rows) names.emplace_back(row.name);
  return names;
}

}  // namespace rhec::logs
