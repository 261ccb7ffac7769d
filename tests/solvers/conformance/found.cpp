#include "found.hpp"

#include <algorithm>

namespace rhec::conformance {
namespace {

const OptionRow* find_option(const std::vector<OptionRow>& rows, const std::string& option) {
  const auto row = std::find_if(rows.begin(), rows.end(), [&](const OptionRow& each) { return each.name == option; });
  return row == rows.end() ? nullptr : &*row;
}

}  // namespace

const Host& host() {
  static const Host one;
  return one;
}

bool has_option(const std::string& solver, const std::string& option) {
  return find_option(host().options(PluginKind::solver, solver), option) != nullptr;
}

std::shared_ptr<Solver> make_solver(const std::string& name, const Settings& more) {
  Settings settings = Settings::map();
  const std::vector<OptionRow> rows = host().options(PluginKind::solver, name);
  const OptionRow* mode = find_option(rows, "mode");
  if (mode && mode->constraint.find("converge") != std::string::npos)
    settings.set("mode", Settings::scalar("converge"));
  for (const auto& [key, value] : more.members()) settings.set(key, value);
  return host().make_solver(name, settings);
}

double tolerance_of(const std::string& solver) {
  constexpr double of_the_house = 1e-8;
  const std::vector<OptionRow> rows = host().options(PluginKind::solver, solver);
  const OptionRow* tolerance = find_option(rows, "tolerance");
  return tolerance ? Settings::scalar(tolerance->default_value).as_number() : of_the_house;
}

}  // namespace rhec::conformance
