// What a term says of itself, and what it writes for the nodes of a plan.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "model_checks.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/sim/numbers/random.hpp"
#include "term_checks.hpp"

namespace rhec::sim {
namespace {

/// Options that all terms with limits have; their unit is that of the limit.
bool is_common(const OptionRow& option) { return option.name == "hard" || option.name.starts_with("soft."); }

bool is_number(const OptionRow& option) {
  return option.type.starts_with("number") || option.type.starts_with("list of numbers");
}

std::string quoted(const std::string& name) { return fmt::format("'{}'", name); }

/// Names that are missing or there twice, once each.
void check_row_names(const TermFormula& formula, std::set<std::string>& told, FindingList& findings) {
  std::map<std::string, int> times;
  for (const auto* names : {&formula.limit_names(), &formula.cost_names()})
    for (const std::string& name : *names) ++times[name];
  for (const auto& [name, count] : times) {
    if (!name.empty() && count == 1) continue;
    if (!told.insert(name).second) continue;
    if (name.empty())
      findings.fail("a row", "it has no name", "give limit() and residual() one: reports and messages call it so");
    else
      findings.fail(quoted(name), fmt::format("{} limits and costs have this name", count),
                    "rename all but one: reports and messages call them so");
  }
}

bool is_same(const std::vector<double>& a, const std::vector<double>& b) {
  return a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

/// What is wrong with what a term writes; one finding of a kind and row, with the first place at which it is found.
class RowCheck {
 public:
  explicit RowCheck(FindingList& findings) : findings_(findings) {}

  void look_at(const TermFormula& formula, const TermPlaces& places) {
    std::vector<bool> is_bound(formula.limit_names().size(), false);
    for (const TermPlace& place : places.all()) {
      const NodeNumbers found = formula.at(place), again = formula.at(place);
      if (found.is_beyond)
        fail("write_data", "it writes behind the end of its data or bounds",
             "write as many numbers as `write` asked for data and limits, in their order");
      if (!is_same(found.data, again.data) || !is_same(found.lower, again.lower) || !is_same(found.upper, again.upper))
        fail("write_data", "it writes other numbers for the same place the second time",
             "let them depend on options and on the place alone: it is called for nodes in any order, by several "
             "threads");
      for (std::size_t k = 0; k < found.data.size(); ++k)
        if (!std::isfinite(found.data[k]))
          fail(fmt::format("data '{}'", formula.data_names()[k]),
               fmt::format("it is {} or was not written {}", found.data[k], text_of(place)),
               "write a finite number for each node, also where nothing is known");
      for (std::size_t k = 0; k < found.lower.size(); ++k) {
        const double lower = found.lower[k], upper = found.upper[k];
        const std::string where = fmt::format("limit '{}'", formula.limit_names()[k]);
        is_bound[k] = is_bound[k] || !(lower == -infinity && upper == infinity);
        if (std::isnan(lower) || std::isnan(upper))
          fail(where, fmt::format("a bound is NaN or was not written {}", text_of(place)),
               "write both bounds of each limit; an infinite one turns it off");
        else if (lower > upper && is_for_want_of_room(formula, place, k))
          warn(where,
               fmt::format("lower is {:g}, above upper, which is {:g}, where the path has room of {:.3g} m to the left "
                           "and {:.3g} m to the right",
                           lower, upper, place.left, place.right),
               "there is no plan on a path with so little room, unless the limit is soft");
        else if (lower > upper)
          fail(where, fmt::format("lower is {:g}, above upper, which is {:g}, {}", lower, upper, text_of(place)),
               "let lower be at most upper at every node: else there is no plan");
        else if (std::isinf(lower) && lower > 0.0)
          fail(where, fmt::format("lower is infinite {}", text_of(place)), "-infinity is no lower bound");
        else if (std::isinf(upper) && upper < 0.0)
          fail(where, fmt::format("upper is -infinite {}", text_of(place)), "infinity is no upper bound");
      }
    }
    for (std::size_t k = 0; k < is_bound.size(); ++k)
      if (!is_bound[k] && told_.insert("never " + formula.limit_names()[k]).second)
        findings_.warn(fmt::format("limit '{}'", formula.limit_names()[k]),
                       fmt::format("both of its bounds are infinite at all {} places", places.all().size()),
                       "give options with which it bounds something");
  }

 private:
  void fail(const std::string& where, std::string found, std::string advice) {
    if (told_.insert(where + advice).second) findings_.fail(where, std::move(found), std::move(advice));
  }
  void warn(const std::string& where, std::string found, std::string advice) {
    if (told_.insert(where + advice).second) findings_.warn(where, std::move(found), std::move(advice));
  }
  /// Whether it is the path that leaves too little room: with more of it the bounds do not cross.
  static bool is_for_want_of_room(const TermFormula& formula, const TermPlace& place, std::size_t limit) {
    TermPlace open = place;
    open.left = open.right = infinity;
    const NodeNumbers found = formula.at(open);
    return found.lower[limit] <= found.upper[limit];
  }
  static std::string text_of(const TermPlace& place) {
    return fmt::format(
        "where arc_length is {:.4g}, time {:.4g}, x {:.4g}, y {:.4g}, heading {:.4g}, speed {:.4g}, {} "
        "obstacles seen",
        place.arc_length, place.time, place.x, place.y, place.heading, place.speed, place.obstacles.size());
  }

  FindingList& findings_;
  std::set<std::string> told_;
};

}  // namespace

TermPlaces::TermPlaces(int count, int most_obstacles, std::uint64_t seed) {
  constexpr double far = 20.0, fast = 6.0, late = 60.0, long_way = 100.0, wide = 5.0;
  RandomStream random(seed, "places of a term");
  const double pi = std::numbers::pi;
  places_.push_back({});
  while (std::ssize(places_) < count) {
    TermPlace place{.time = random.uniform(0.0, late),
                    .x = random.uniform(-far, far),
                    .y = random.uniform(-far, far),
                    .heading = random.uniform(-pi, pi),
                    .speed = random.uniform(0.0, fast),
                    .arc_length = random.uniform(0.0, long_way)};
    if (random.uniform() < 0.5) place.left = random.uniform(0.0, wide);
    if (random.uniform() < 0.5) place.right = random.uniform(0.0, wide);
    std::vector<Obstacle>& seen = obstacles_.emplace_back();
    const int many = static_cast<int>(random.uniform(0.0, most_obstacles + 3.0));
    for (int k = 0; k < many; ++k)
      seen.push_back({.x = random.uniform(-far, far),
                      .y = random.uniform(-far, far),
                      .semi_axis_along = random.uniform(0.1, wide),
                      .semi_axis_across = random.uniform(0.1, wide),
                      .heading = random.uniform(-pi, pi),
                      .velocity_x = random.uniform(-1.0, 1.0),
                      .velocity_y = random.uniform(-1.0, 1.0)});
    place.obstacles = seen;
    place.seen = place.time - random.uniform();
    places_.push_back(place);
  }
}

std::vector<Finding> check_term_description(const TermDescription& about, const std::vector<TermFormula>& on) {
  FindingList findings("description");
  if (about.name.empty()) findings.fail("term", "it has no name", "give Manifest::name, or `name` among its equations");
  if (about.meaning.empty())
    findings.warn("term", "it does not say what it does",
                  "give Manifest::capabilities, or `meaning` among its equations: one phrase for people");
  std::vector<std::string> without_meaning, without_unit;
  for (const OptionRow& option : about.options) {
    if (is_common(option)) continue;
    if (option.meaning.empty()) without_meaning.push_back(option.name);
    if (is_number(option) && option.meaning.find('[') == std::string::npos) without_unit.push_back(option.name);
  }
  const auto warn_of = [&](const std::vector<std::string>& names, const char* what, const char* advice) {
    if (names.empty()) return;
    findings.warn(names.size() == 1 ? "option " + names.front() : fmt::format("{} options", names.size()),
                  fmt::format("{} {}{}", names.size() == 1 ? "it has" : "they have", what,
                              names.size() == 1 ? "" : fmt::format(": {}", fmt::join(names, ", "))),
                  advice);
  };
  warn_of(without_meaning, "no meaning", "say what it is, in one phrase for people");
  warn_of(without_unit, "no unit",
          "write it in brackets into the meaning, as in \"how far to stay away [m]\", [1] for a "
          "pure number; of equations it is the key `unit`");
  std::set<std::string> told;
  for (const TermFormula& formula : on) check_row_names(formula, told, findings);
  if (findings.empty())
    findings.pass(
        fmt::format("options of its own, with meanings and units: {}{}",
                    std::ranges::count_if(about.options, [](const OptionRow& row) { return !is_common(row); }),
                    on.empty() ? "" : "; every limit and every cost has a name of its own"));
  return findings.take();
}

std::vector<Finding> check_rows(const std::vector<TermFormula>& on, const TermPlaces& places) {
  FindingList findings("rows");
  RowCheck check(findings);
  int limits = 0, costs = 0, data = 0;
  for (const TermFormula& formula : on) {
    check.look_at(formula, places);
    limits = std::max(limits, static_cast<int>(formula.limit_names().size()));
    costs = std::max(costs, static_cast<int>(formula.cost_names().size()));
    data = std::max(data, static_cast<int>(formula.data_names().size()));
  }
  if (limits + costs == 0) {
    findings.warn("", "with these options it has neither limits nor costs",
                  "set options with which it has some (--set OPTION=VALUE); `rhec plugins NAME` tells them");
    return findings.take();
  }
  if (findings.empty())
    findings.pass(
        fmt::format("limits: {}, costs: {}, data: {}; all of them written at {} places of a node, lower bounds "
                    "at most upper ones",
                    limits, costs, data, places.all().size()),
        {{"limits", limits}, {"costs", costs}, {"data", data}});
  return findings.take();
}

}  // namespace rhec::sim
