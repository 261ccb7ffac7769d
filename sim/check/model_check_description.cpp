// Checks a model's description, and whether the model moves according to its roles.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "model_checks.hpp"
#include "rhec/sim/check/derivative_check.hpp"
#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {
namespace {

constexpr double far_from_width = 100.0;  // a scale wrong by this factor misleads finite differences and solvers

struct KindOfVariable {
  const char* word;
  const std::vector<Variable>& variables;
};

/// A role: its meaning, its group of variables, and the expected properties of such a variable.
struct Role {
  const char* name;
  int index;
  const KindOfVariable& kind;
  const char* unit;
  bool is_angle;
};

class Description {
 public:
  explicit Description(const ModelDescription& about) : about_(about) {}

  std::vector<Finding> check(bool& can_go_on) {
    if (about_.name.empty()) fail("model", "it has no name", "give ModelDescription::name");
    if (about_.source.empty())
      findings_.warn("model", "it does not say where its equations were published",
                     "give `source` (in C++ ModelDescription::source), or say there that they are your own");
    if (about_.states.empty()) stop("model", "it has no states", "a vehicle has at least one");
    if (about_.outputs.empty())
      findings_.warn("model", "it has no outputs that are measured: nothing can be estimated",
                     "add outputs, or mark some as usual");
    for (const KindOfVariable& kind : kinds_)
      for (const Variable& variable : kind.variables) check(kind, variable);
    check_meanings();
    check_names();
    check_roles();
    can_go_on = can_go_on_;
    if (findings_.empty())
      findings_.pass(
          fmt::format("{} states, {} inputs, {} parameters, {} outputs, with names, units, meanings, bounds "
                      "and scales that fit",
                      about_.states.size(), about_.inputs.size(), about_.parameters.size(), about_.outputs.size()));
    return findings_.take();
  }

 private:
  void fail(std::string where, std::string found, std::string advice) {
    findings_.fail(std::move(where), std::move(found), std::move(advice));
  }
  void stop(std::string where, std::string found, std::string advice) {
    can_go_on_ = false;
    fail(std::move(where), std::move(found), std::move(advice));
  }

  /// One finding, since a vehicle that is written down quickly has none at all.
  void check_meanings() {
    const std::size_t count = without_meaning_.size();
    constexpr const char* advice = "give `meaning` (in C++ Variable::meaning), one phrase for people";
    if (count == 1) findings_.warn(without_meaning_.front(), "it has no meaning", advice);
    if (count > 1)
      findings_.warn(fmt::format("{} variables", count),
                     fmt::format("they have no meaning: {}", fmt::join(without_meaning_, ", ")), advice);
  }

  void check(const KindOfVariable& kind, const Variable& v) {
    const std::string where = fmt::format("{} {}", kind.word, v.name);
    const auto bad = [](unsigned char c) { return std::isspace(c) || std::iscntrl(c) || c == '.' || c == ','; };
    if (v.name.empty())
      fail(fmt::format("{} {}", kind.word, &v - kind.variables.data()), "it has no name", "give Variable::name");
    else if (std::any_of(v.name.begin(), v.name.end(), bad))
      fail(where, fmt::format("the name '{}' holds a space, a dot or a comma", v.name),
           "write it as a key of a configuration is written, e.g. with underscores");
    if (v.unit.empty()) fail(where, "it has no unit", "give Variable::unit, \"1\" for a pure number");
    if (v.meaning.empty()) without_meaning_.push_back(where);
    if (!(v.lower <= v.upper))
      return stop(where, fmt::format("its bounds are [{:g}, {:g}]", v.lower, v.upper), "lower has to be at most upper");
    if (!(v.scale > 0.0 && std::isfinite(v.scale)))
      return stop(where, fmt::format("its scale is {:g}", v.scale), "give a typical magnitude, greater than 0");
    if (&kind.variables == &about_.parameters && !(v.lower <= v.nominal && v.nominal <= v.upper))
      fail(where,
           fmt::format("where nothing slips it is {:g}, outside its bounds [{:g}, {:g}]", v.nominal, v.lower, v.upper),
           "set Variable::nominal, or widen the bounds");
    const double width = v.upper - v.lower;
    if (std::isfinite(width) && width > 0.0 && (width > far_from_width * v.scale || far_from_width * width < v.scale))
      findings_.warn(where, fmt::format("its bounds are {:g} apart and its scale is {:g}", width, v.scale),
                     "make the scale a typical magnitude inside the bounds");
  }

  /// Bounds are set by name for states, inputs and parameters alike; outputs have a separate name space.
  void check_names() {
    std::map<std::string, const char*> owners, outputs;
    for (const KindOfVariable& kind : kinds_) {
      auto& taken = &kind.variables == &about_.outputs ? outputs : owners;
      for (const Variable& v : kind.variables) {
        if (v.name.empty()) continue;
        const auto [at, is_new] = taken.try_emplace(v.name, kind.word);
        if (!is_new)
          fail(fmt::format("{} {}", kind.word, v.name), fmt::format("the name is that of another {}, too", at->second),
               "rename one: bounds, noise and weights are given by name");
      }
    }
  }

  void check_roles() {
    const Roles& roles = about_.roles;
    std::vector<Role> all = {{"position_x", roles.position_x, kinds_[0], "m", false},
                             {"position_y", roles.position_y, kinds_[0], "m", false},
                             {"heading", roles.heading, kinds_[0], "rad", true},
                             {"speed", roles.speed, kinds_[1], "m/s", false},
                             {"speed_state", roles.speed_state, kinds_[0], "m/s", false},
                             {"speed_factor", roles.speed_factor, kinds_[2], "1", false}};
    const std::size_t single_roles = all.size();
    for (const int body : roles.other_headings) all.push_back({"other_headings", body, kinds_[0], "rad", true});
    std::map<int, const char*> state_roles;
    for (const Role& role : all) {
      const std::string where = fmt::format("roles.{}", role.name);
      const bool in_a_list = &role >= all.data() + single_roles;
      if (role.index == -1 && !in_a_list) continue;
      if (role.index < 0 || role.index >= static_cast<int>(role.kind.variables.size())) {
        stop(where, fmt::format("there is no {} {}", role.kind.word, role.index),
             fmt::format("expected an index below {}, or -1 for none", role.kind.variables.size()));
        continue;
      }
      const Variable& v = role.kind.variables[role.index];
      if (v.unit != role.unit)
        fail(where, fmt::format("{} '{}' is in '{}', not in '{}'", role.kind.word, v.name, v.unit, role.unit),
             "let the role point at the variable that it means, or mend the unit");
      if (role.is_angle && !v.is_angle)
        fail(where, fmt::format("{} '{}' is not marked as an angle", role.kind.word, v.name),
             "set Variable::is_angle, since headings are compared on the circle");
      if (&role.kind.variables != &about_.states) continue;
      const auto [at, is_new] = state_roles.try_emplace(role.index, role.name);
      if (!is_new)
        fail(where, fmt::format("state '{}' is roles.{}, too", v.name, at->second),
             "give each role a state of its own");
    }
    if ((roles.position_x == -1) != (roles.position_y == -1))
      fail("roles", "only one of position_x and position_y is there", "give both, or none");
    if (roles.position_x == -1 || roles.heading == -1)
      findings_.warn("roles",
                     "no position or no heading is named: the vehicle can follow no path and drive no scenario",
                     "give roles.position_x, position_y and heading, unless the model is for estimation alone");
  }

  const ModelDescription& about_;
  const KindOfVariable kinds_[4] = {
      {"state", about_.states}, {"input", about_.inputs}, {"parameter", about_.parameters}, {"output", about_.outputs}};
  FindingList findings_{"description"};
  std::vector<std::string> without_meaning_;
  bool can_go_on_ = true;
};

std::vector<double> drawn(const std::vector<Variable>& variables, double kept_off, RandomStream& random) {
  std::vector<double> values;
  for (const Variable& variable : variables) {
    const auto [lower, upper] = range_of(variable, 1.0);
    const double room = kept_off * (upper - lower);
    values.push_back(random.uniform(lower + room, upper - room));
  }
  return values;
}

}  // namespace

std::vector<Finding> check_description(const ModelDescription& about, bool& can_go_on) {
  return Description(about).check(can_go_on);
}

std::vector<double> state_in_line(const CheckedModel& checked, double direction) {
  std::vector<double> state;
  for (const Variable& v : checked.about.states) state.push_back(std::clamp(0.0, v.lower, v.upper));
  checked.about.roles.place(0.0, 0.0, direction, state.data());
  return state;
}

std::vector<Finding> check_symmetry(const CheckedModel& checked) {
  constexpr int points = 200;
  constexpr double tolerance = 1e-8;
  const ModelDescription& about = checked.about;
  const Roles& roles = about.roles;
  FindingList findings("symmetry");
  const bool has_position = roles.position_x >= 0 && roles.position_y >= 0, has_heading = roles.heading >= 0;
  if (!has_position && !has_heading) {
    findings.skip("no role names a position or a heading");
    return findings.take();
  }
  RandomStream random(checked.options.seed, "symmetry of a model");
  const std::size_t nx = about.states.size();
  struct Worst {
    double error = 0.0, before = 0.0, after = 0.0;
  };
  std::vector<Worst> of_turning(nx), of_shifting(nx);
  int looked_at = 0;
  std::vector<double> rates(nx), moved_rates(nx), expected(nx);
  for (int i = 0; i < points; ++i) {
    const std::vector<double> x = drawn(about.states, 0.02, random), u = drawn(about.inputs, 0.02, random),
                              p = drawn(about.parameters, 0.02, random);
    checked.model.rates(x.data(), u.data(), p.data(), rates.data());
    const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
    const auto compare = [&](const std::vector<double>& moved, std::vector<Worst>& worst) {
      checked.model.rates(moved.data(), u.data(), p.data(), moved_rates.data());
      for (std::size_t j = 0; j < nx; ++j) {
        const double size = std::max({std::abs(expected[j]), std::abs(moved_rates[j]), about.states[j].scale});
        const double error = std::abs(moved_rates[j] - expected[j]) / size;
        if (std::isfinite(error)) ++looked_at;
        if (error > worst[j].error) worst[j] = {error, expected[j], moved_rates[j]};
      }
    };
    if (has_position) {
      std::vector<double> moved = x;
      moved[roles.position_x] += about.states[roles.position_x].scale * random.uniform(-10.0, 10.0);
      moved[roles.position_y] += about.states[roles.position_y].scale * random.uniform(-10.0, 10.0);
      expected = rates;
      compare(moved, of_shifting);
    }
    if (has_heading) {
      std::vector<double> moved = x;
      roles.turn(angle, moved.data());
      expected = rates;
      if (has_position) {
        const double vx = rates[roles.position_x], vy = rates[roles.position_y];
        expected[roles.position_x] = std::cos(angle) * vx - std::sin(angle) * vy;
        expected[roles.position_y] = std::sin(angle) * vx + std::cos(angle) * vy;
      }
      compare(moved, of_turning);
    }
  }
  double largest = 0.0;
  const auto report_worst = [&](const std::vector<Worst>& worst, const char* what, const char* advice) {
    for (std::size_t j = 0; j < nx; ++j) {
      largest = std::max(largest, worst[j].error);
      if (!(worst[j].error > tolerance)) continue;
      findings.fail(fmt::format("d {} / dt", about.states[j].name),
                    fmt::format("where the vehicle is {}, it is {:.4g} in place of {:.4g}", what, worst[j].after,
                                worst[j].before),
                    advice, {{"error", worst[j].error}});
    }
  };
  report_worst(of_shifting, "shifted as a whole",
               "let no rate depend on the position; or mend roles.position_x and position_y");
  report_worst(
      of_turning, "turned as a whole",
      "let no rate depend on a heading but through the direction of the velocity; name the headings of all bodies in "
      "roles.heading and roles.other_headings");
  if (findings.empty() && looked_at == 0) findings.skip("no rate is finite at random points; see 'numbers'");
  if (findings.empty())
    findings.pass(fmt::format("shifted and turned as a whole it moves as before: {} points, largest relative error "
                              "{:.1g}",
                              points, largest),
                  {{"error", largest}});
  return findings.take();
}

std::optional<double> typical_speed(const CheckedModel& checked) {
  const std::vector<double> nominal = nominal_values(checked.about.parameters);
  std::vector<double> state(checked.about.states.size(), 0.0), inputs(checked.about.inputs.size(), 0.0);
  checked.model.straight_motion(1.0, nominal.data(), state.data(), inputs.data());
  double largest = 0.0;
  for (std::size_t j = 0; j < state.size(); ++j)
    largest = std::max(largest, std::abs(state[j]) / checked.about.states[j].scale);
  for (std::size_t j = 0; j < inputs.size(); ++j)
    largest = std::max(largest, std::abs(inputs[j]) / checked.about.inputs[j].scale);
  if (!(largest > 0.0 && std::isfinite(largest))) return std::nullopt;
  return 1.0 / largest;
}

std::vector<Finding> check_straight_motion(const CheckedModel& checked) {
  constexpr int points = 200;
  constexpr double exact = 1e-6, rough = 0.01;
  const ModelDescription& about = checked.about;
  const Roles& roles = about.roles;
  FindingList findings("straight_motion");
  if (roles.position_x < 0 || roles.position_y < 0 || roles.heading < 0 || about.inputs.empty()) {
    findings.skip("no position, heading or input: nothing that could go straight");
    return findings.take();
  }
  const double speed = checked.options.speed.value_or(typical_speed(checked).value_or(1.0));
  RandomStream random(checked.options.seed, "straight motion of a model");
  std::vector<double> inputs(about.inputs.size()), rates(about.states.size());
  struct Motion {
    double ahead, sideways;
  };
  const auto motion = [&](const std::vector<double>& p, double direction) {
    std::fill(inputs.begin(), inputs.end(), std::nan(""));
    std::vector<double> state = state_in_line(checked, direction);
    checked.model.straight_motion(speed, p.data(), state.data(), inputs.data());
    checked.model.rates(state.data(), inputs.data(), p.data(), rates.data());
    const double vx = rates[roles.position_x], vy = rates[roles.position_y];
    return Motion{std::cos(direction) * vx + std::sin(direction) * vy,
                  std::cos(direction) * vy - std::sin(direction) * vx};
  };
  constexpr double direction = 0.7;  // arbitrary
  constexpr const char* advice =
      "give the formula straight_motion (or override Model::straight_motion), or mend roles.speed, speed_factor and "
      "nominal values";
  const Motion nominal = motion(nominal_values(about.parameters), direction);
  if (!(std::hypot(nominal.ahead - speed, nominal.sideways) <= exact * speed))
    findings.fail("at nominal parameters",
                  fmt::format("asked for {:.4g} m/s straight ahead, it moves at {:.4g} m/s ahead and {:.4g} m/s to the "
                              "left",
                              speed, nominal.ahead, nominal.sideways),
                  advice, {{"asked", speed}, {"ahead", nominal.ahead}, {"left", nominal.sideways}});
  std::vector<int> headings = roles.other_headings;
  headings.insert(headings.begin(), roles.heading);
  for (const int body : headings)
    if (!(std::abs(rates[body]) <= exact))
      findings.fail(
          fmt::format("d {} / dt", about.states[body].name),
          fmt::format("at nominal parameters it turns at {:.4g} rad/s where it should go straight", rates[body]),
          advice, {{"rate", rates[body]}});
  double worst = 0.0, worst_found = speed;
  std::string where;
  for (int i = 0; i < points; ++i) {
    const std::vector<double> p = drawn(about.parameters, 0.02, random);
    const Motion found = motion(p, direction);
    const double ground = std::hypot(found.ahead, found.sideways);
    const double error = std::isfinite(ground) ? std::abs(ground - speed) / speed : HUGE_VAL;
    if (error <= worst) continue;
    worst = error;
    worst_found = ground;
    where.clear();
    for (std::size_t j = 0; j < p.size(); ++j) where += fmt::format(" {} {:.3g}", about.parameters[j].name, p[j]);
  }
  if (std::isinf(worst) && findings.empty())
    findings.warn("at other parameters",
                  fmt::format("asked for {:.4g} m/s, no inputs give that speed at{}", speed, where),
                  "leave parameters at which the vehicle cannot move out of the bounds", {{"asked", speed}});
  if (!(worst <= rough) && findings.empty())
    findings.warn(
        "at other parameters",
        fmt::format("asked for {:.4g} m/s, it moves at {:.4g} m/s over ground at{}", speed, worst_found, where),
        "let straight_motion use the parameters that it is given, e.g. by roles.speed_factor",
        {{"asked", speed}, {"found", worst_found}});
  if (findings.empty())
    findings.pass(fmt::format("asked for {:.4g} m/s it goes straight at that speed; relative error at other parameters "
                              "at most {:.1g}",
                              speed, worst),
                  {{"speed", speed}, {"error", worst}});
  return findings.take();
}

}  // namespace rhec::sim
