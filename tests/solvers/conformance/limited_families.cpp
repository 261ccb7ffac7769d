// Families of problems with limits. All begin with a drive, and a gentler one from the same start that is known to be
// within all limits; hard limits that cut off the former are met by the latter.

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <utility>

#include "families.hpp"
#include "making.hpp"

namespace rhec::conformance {
namespace {

using testing::Limit;
using testing::LimitedOcp;

constexpr int most_limits = 6;

/// What a limit on a stage may be about: where the vehicle is, and what drives it.
struct Stage {
  int index = 0, last = 0;
  int u = 0;                       ///< where inputs begin in a row
  bool is_plane = false;           ///< the first two states are a position
  int inputs = 0;                  ///< none at the last node
  const double* drive = nullptr;   ///< the row of the drive
  const double* gentle = nullptr;  ///< and that of the gentler one
  const Model* model = nullptr;

  std::vector<int> position() const { return is_plane ? std::vector<int>{0, 1} : std::vector<int>{0}; }
  /// A direction that turns from stage to stage.
  std::vector<double> direction() const {
    const double angle = 0.4 * index;
    return is_plane ? std::vector<double>{std::cos(angle), std::sin(angle)} : std::vector<double>{1.0};
  }
};

/// Bounds a limit so that it holds the gentler drive with a margin, and cuts off what it can of the other.
Limit between(const Stage& stage, Limit limit) {
  const double here = limit.value(stage.drive), there = limit.value(stage.gentle),
               margin = 1e-3 * (1.0 + std::abs(there));
  limit.lower = limit.upper = there;
  if (here > there)
    limit.lower = -infinity;
  else
    limit.upper = infinity;
  limit.lower -= margin + 0.3 * (there - here);
  limit.upper += margin + 0.3 * (here - there);
  return limit;
}

/// A circle that moves along, near the drive on the side away from the gentler one.
Limit obstacle(const Stage& stage) {
  std::vector<double> centre;
  for (const int j : stage.position())
    centre.push_back(1.5 * stage.drive[j] - 0.5 * stage.gentle[j] +
                     (stage.is_plane ? 0.2 * stage.direction()[j] : 0.0));
  return between(stage, {Limit::Kind::distance, stage.position(), centre});
}

Limit corridor(const Stage& stage) {
  return between(stage, {Limit::Kind::linear, stage.position(), stage.direction()});
}

/// An input times a state, as in a lateral acceleration.
Limit lateral(const Stage& stage) {
  const int last = stage.model->state_count() - 1;
  return between(stage, {Limit::Kind::product, {stage.u + stage.inputs - 1, last}, {1.0}});
}

/// All inputs together.
Limit effort(const Stage& stage) {
  Limit limit{Limit::Kind::squares, {}, {}};
  for (int j = 0; j < stage.inputs; ++j) {
    limit.of.push_back(stage.u + j);
    limit.with.push_back(std::pow(stage.model->description().inputs[j].scale, -2.0));
  }
  return between(stage, limit);
}

/// Other limits from stage to stage: at every node something, at some nothing about states or nothing about inputs.
std::vector<Limit> some_of_all(const Stage& stage) {
  std::vector<Limit> all;
  if (stage.index % 3 == 0 && stage.index > 0) all.push_back(obstacle(stage));
  if (stage.index % 3 == 1 || stage.index == stage.last) all.push_back(corridor(stage));
  if (stage.index % 2 == 0 && stage.index < stage.last) all.push_back(effort(stage));
  if (stage.index % 4 == 1 && stage.index < stage.last) all.push_back(lateral(stage));
  return all;
}

using Limits = std::function<std::vector<Limit>(const Stage&, RandomProblem&)>;

/// A problem with limits. The guess is the drive, which they cut off.
Problem limited(Problem problem, const Limits& limits, RandomProblem& random) {
  HorizonProblem& ocp = *problem.ocp;
  const Model& model = ocp.model();
  const int nu = model.input_count(), np = model.parameter_count();
  std::vector<double> inputs(static_cast<std::size_t>(ocp.intervals()) * nu), parameters(ocp.intervals() * np);
  for (int i = 0; i < ocp.intervals(); ++i) {
    ocp.structure().inputs_on(problem.guess, i, inputs.data() + i * nu);
    ocp.structure().parameters_on(problem.guess, i, parameters.data() + i * np);
  }
  for (double& u : inputs) u *= 0.8;
  Iterate gentle = problem.guess;
  ocp.structure().set_decisions(gentle, inputs.data(), parameters.data());
  std::vector<double> scratch(ocp.scratch_size());
  roll_out(ocp, gentle, scratch);
  problem.limited = std::make_unique<LimitedOcp>(ocp, most_limits);
  for (int i = 0; i <= ocp.intervals(); ++i) {
    Stage stage;
    stage.index = i;
    stage.last = ocp.intervals();
    stage.u = ocp.capacity().states;
    stage.is_plane = model.state_count() > 1;
    stage.inputs = i < ocp.intervals() ? nu : 0;
    stage.drive = problem.guess.row(i);
    stage.gentle = gentle.row(i);
    stage.model = &model;
    for (const Limit& limit : limits(stage, random)) problem.limited->add(i, limit);
  }
  problem.guess = with_limits(*problem.limited, problem.guess);
  return problem;
}

template <class Spec>
Make limited(Spec spec, const Limits& limits) {
  return [=](const ModelPointer& model, unsigned seed) {
    RandomProblem problems(model, 11000 + seed);
    if constexpr (std::is_same_v<Spec, RheSpec>)
      return limited(cold(problems.rhe(spec)), limits, problems);
    else
      return limited(cold(problems.rhc(spec)), limits, problems);
  };
}

/// The same over horizons of 2 to 40 intervals, one other of each seed.
template <class Spec>
Make of_any_length(Spec spec, const Limits& limits) {
  return [=](const ModelPointer& model, unsigned seed) {
    Spec one = spec;
    one.intervals = static_cast<int>(RandomProblem(model, 12000 + seed).uniform(2.0, 41.0));
    return limited(one, limits)(model, seed);
  };
}

/// Control of a vehicle that starts on its path.
RhcSpec on_its_path() {
  RhcSpec spec;
  spec.off = 0.0;
  return spec;
}

/// Some of all limits, changed.
Limits changed(const std::function<void(Limit&, RandomProblem&)>& change) {
  return [=](const Stage& stage, RandomProblem& random) {
    std::vector<Limit> all = some_of_all(stage);
    for (Limit& limit : all) change(limit, random);
    return all;
  };
}

Limits plain() {
  return changed([](Limit&, RandomProblem&) {});
}

/// Weights from where all of a limit is given up to where it is as good as hard.
double some_weight(RandomProblem& random) { return std::pow(10.0, random.uniform(-3.0, 2.0)); }

Limits soft(bool has_linear, bool has_quadratic) {
  return changed([=](Limit& limit, RandomProblem& random) {
    limit.linear_weight = has_linear ? some_weight(random) : 0.0;
    limit.quadratic_weight = has_quadratic ? 10.0 * some_weight(random) : 0.0;
  });
}

/// Each of some limits is inactive, hard or soft, or there twice.
Limits of_any_kind() {
  return [](const Stage& stage, RandomProblem& random) {
    std::vector<Limit> all;
    for (Limit limit : some_of_all(stage)) {
      const double kind = random.uniform(0.0, 4.0);
      if (kind < 1.0) {
        limit.lower -= 10.0;
        limit.upper += 10.0;
      } else if (kind < 2.0) {
        limit.linear_weight = some_weight(random);
        limit.quadratic_weight = random.uniform(0.0, 1.0) < 0.5 ? 0.0 : some_weight(random);
      } else if (kind < 3.0) {
        all.push_back(limit);
      }
      all.push_back(limit);
    }
    return all;
  };
}

/// What one limit demands another one of the same stage forbids.
std::vector<Limit> contradiction(const Stage& stage, double weight) {
  std::vector<Limit> all = some_of_all(stage);
  if (stage.index != stage.last / 2) return all;
  const double here = stage.gentle[0], off = 0.2 * stage.model->description().states[0].scale;
  all.push_back({Limit::Kind::linear, {0}, {1.0}, here + off, infinity});
  all.push_back({Limit::Kind::linear, {0}, {2.0}, -infinity, 2.0 * (here - off)});
  for (Limit& limit : all) {
    limit.linear_weight = weight;
    limit.quadratic_weight = weight < infinity ? 1.0 : 0.0;
  }
  return all;
}

/// Every limit is there again: as it is, in other units, and looser.
std::vector<Limit> redundant(const Stage& stage) {
  std::vector<Limit> all;
  for (const Limit& limit : some_of_all(stage)) {
    Limit looser = limit;
    looser.lower -= 0.5;
    looser.upper += 0.5;
    all.insert(all.end(), {limit, limit, looser});
  }
  if (std::ssize(all) > most_limits) all.resize(most_limits);
  return all;
}

/// A corridor, the sides of which are the same in three units, and the sum of two limits.
std::vector<Limit> dependent(const Stage& stage) {
  const Limit first = corridor(stage);
  Limit doubled = first, second = first;
  for (double& coefficient : doubled.with) coefficient *= 2.0;
  doubled.lower *= 2.0;
  doubled.upper *= 2.0;
  // Another direction, whose bounds are those of the gentler drive, and the sum of both.
  second.with.front() += 1.0;
  second = between(stage, {Limit::Kind::linear, second.of, second.with});
  Limit sum = first;
  for (std::size_t k = 0; k < sum.with.size(); ++k) sum.with[k] += second.with[k];
  sum.lower += second.lower;
  sum.upper += second.upper;
  return {first, doubled, second, sum};
}

/// At the first node of control, where states are given: on inputs alone. At the last: on states alone.
std::vector<Limit> first_and_last(const Stage& stage) {
  if (stage.index == 0) return {effort(stage), lateral(stage)};
  if (stage.index == stage.last) return {corridor(stage), obstacle(stage)};
  return {};
}

/// The given state is beyond a limit of its own node, which nothing can change.
std::vector<Limit> beyond_from_the_start(const Stage& stage, double weight) {
  if (stage.index > 0) return {};
  return {{Limit::Kind::linear, {0}, {1.0}, stage.drive[0] + 0.1, infinity, weight, 0.0}};
}

/// Equations: a place of the gentler drive that is met exactly, at every third node and at the last.
std::vector<Limit> equations(const Stage& stage) {
  if (stage.index == 0 || (stage.index % 3 != 0 && stage.index != stage.last)) return {};
  Limit limit = corridor(stage);
  limit.lower = limit.upper = limit.value(stage.gentle);
  return {limit};
}

/// Circles about places of the guess itself, where the distance from the centre has no gradient; the gentler drive is
/// outside of them. At every third node, or at all.
std::vector<Limit> about_the_guess(const Stage& stage, int every) {
  if (stage.index == 0 || stage.index % every != 0) return {};
  std::vector<double> centre;
  for (const int j : stage.position()) centre.push_back(stage.drive[j]);
  Limit limit{Limit::Kind::distance, stage.position(), centre};
  limit.lower = 0.7 * limit.value(stage.gentle);
  return {limit};
}

/// The same, and what the circle at the middle forbids is demanded there.
std::vector<Limit> kept_to_the_guess(const Stage& stage) {
  std::vector<Limit> all = about_the_guess(stage, 3);
  if (stage.index != stage.last / 2) return all;
  all = about_the_guess(stage, 1);
  Limit inside = all.front();
  inside.upper = 0.5 * (inside.lower + inside.value(stage.drive));
  inside.lower = -infinity;
  all.push_back(inside);
  return all;
}

/// Units from where a limit is hardly seen to where it is all that is.
Limits in_other_units() {
  return [](const Stage& stage, RandomProblem& random) {
    std::vector<Limit> all;
    for (Limit limit : some_of_all(stage)) {
      if (limit.kind == Limit::Kind::distance) continue;
      const double factor = std::pow(10.0, random.uniform(-4.0, 4.0));
      for (double& coefficient : limit.with) coefficient *= factor;
      limit.lower *= factor;
      limit.upper *= factor;
      all.push_back(limit);
    }
    return all;
  };
}

/// One side of some limits, at the last node alone.
std::vector<Limit> last_only(const Stage& stage) {
  if (stage.index != stage.last) return {};
  std::vector<Limit> all{corridor(stage), obstacle(stage)};
  const double here = all[0].value(stage.drive), there = all[0].value(stage.gentle);
  (here > there ? all[0].lower : all[0].upper) = here > there ? -infinity : infinity;
  all[1].upper = infinity;
  return all;
}

/// Equations and inequalities, hard and soft, each in its turn.
Limits of_mixed_kind() {
  return [](const Stage& stage, RandomProblem& random) {
    std::vector<Limit> all = some_of_all(stage);
    for (Limit& limit : all) {
      if (random.uniform(0.0, 1.0) < 0.4) {
        limit.linear_weight = random.uniform(0.0, 1.0) < 0.3 ? 0.0 : some_weight(random);
        limit.quadratic_weight =
            limit.linear_weight > 0.0 && random.uniform(0.0, 1.0) < 0.5 ? 0.0 : some_weight(random);
        if (random.uniform(0.0, 1.0) < 0.5) limit.lower = limit.upper = limit.value(stage.gentle);
      } else if (random.uniform(0.0, 1.0) < 0.3) {
        limit.lower = -infinity;
      } else if (random.uniform(0.0, 1.0) < 0.3) {
        limit.upper = infinity;
      }
    }
    for (const Limit& limit : equations(stage))
      if (random.uniform(0.0, 1.0) < 0.5) all.push_back(limit);
    return all;
  };
}

}  // namespace

std::vector<Family> limited_families() {
  std::vector<Family> all;
  const auto add = [&](std::string name, std::string meaning, Make make) -> Family& {
    Family f;
    f.name = std::move(name);
    f.meaning = std::move(meaning);
    f.make = std::move(make);
    all.push_back(std::move(f));
    return all.back();
  };
  const auto with = [](auto function) {
    return Limits([=](const Stage& stage, RandomProblem&) { return function(stage); });
  };
  add("rhc_limits_inactive", "limits that are far away",
      limited(on_its_path(), changed([](Limit& limit, RandomProblem&) {
                limit.lower -= 100.0;
                limit.upper += 100.0;
              })));
  add("rhc_limits", "limits of all kinds that cut off the path", limited(on_its_path(), plain())).several_optima = true;
  add("rhe_limits", "limits of all kinds that cut off the measurements", limited(RheSpec{}, plain())).several_optima =
      true;
  add("rhe_limits_blocks", "the same with blocks", limited(rhe([](RheSpec& s) { s.block = 4; }), plain()))
      .several_optima = true;
  add("rhc_limits_any", "limits of all kinds over horizons of any length", of_any_length(on_its_path(), of_any_kind()))
      .several_optima = true;
  add("rhe_limits_any", "the same on estimates", of_any_length(RheSpec{}, of_any_kind())).several_optima = true;
  add("rhc_limits_corridor", "a corridor, which is linear",
      limited(on_its_path(), with([](const Stage& stage) { return std::vector<Limit>{corridor(stage)}; })));
  add("rhc_limits_first_last", "limits on inputs at the first node, on states at the last",
      limited(on_its_path(), with(first_and_last)));
  add("rhc_limits_soft", "soft limits, some of them violated", limited(on_its_path(), soft(true, true)))
      .several_optima = true;
  add("rhc_limits_soft_linear", "the same without quadratic weights", limited(on_its_path(), soft(true, false)))
      .several_optima = true;
  add("rhc_limits_soft_quadratic", "the same without linear weights", limited(on_its_path(), soft(false, true)))
      .several_optima = true;
  add("rhe_limits_soft", "soft limits on estimates", limited(RheSpec{}, soft(true, true))).several_optima = true;
  add("rhc_limits_redundant", "every limit three times", limited(on_its_path(), with(redundant))).several_optima = true;
  add("rhc_limits_dependent", "limits that depend on each other linearly", limited(on_its_path(), with(dependent)))
      .several_optima = true;
  add("rhc_limits_infeasible", "two limits that contradict each other",
      limited(on_its_path(), with([](const Stage& stage) { return contradiction(stage, infinity); })))
      .answer = Family::Answer::infeasible;
  add("rhc_limits_contradiction_soft", "the same, soft",
      limited(on_its_path(), with([](const Stage& stage) { return contradiction(stage, 1.0); })))
      .several_optima = true;
  add("rhc_limits_infeasible_start", "the given state is beyond a limit",
      limited(on_its_path(), with([](const Stage& stage) { return beyond_from_the_start(stage, infinity); })))
      .answer = Family::Answer::infeasible;
  add("rhc_limits_soft_start", "the given state is beyond a soft limit",
      limited(on_its_path(), with([](const Stage& stage) { return beyond_from_the_start(stage, 3.0); })));
  add("rhc_limits_equations", "places that are met exactly", limited(on_its_path(), with(equations))).several_optima =
      true;
  add("rhe_limits_equations", "the same on estimates", limited(RheSpec{}, with(equations))).several_optima = true;
  add("rhc_limits_units", "limits in units from 1e-4 to 1e4", limited(on_its_path(), in_other_units())).several_optima =
      true;
  add("rhc_limits_last", "one side of limits at the last node alone", limited(on_its_path(), with(last_only)))
      .several_optima = true;
  add("rhc_limits_mixed", "equations and inequalities, hard and soft, over horizons of any length",
      of_any_length(on_its_path(), of_mixed_kind()))
      .several_optima = true;
  add("rhe_limits_mixed", "the same on estimates", of_any_length(RheSpec{}, of_mixed_kind())).several_optima = true;
  add("rhc_limits_at_centre", "circles about places of the guess, where the distance has no gradient",
      limited(on_its_path(), with([](const Stage& stage) { return about_the_guess(stage, 3); })))
      .several_optima = true;
  add("rhc_limits_at_all_centres", "the same at every node",
      limited(on_its_path(), with([](const Stage& stage) { return about_the_guess(stage, 1); })))
      .several_optima = true;
  add("rhe_limits_at_centre", "the same on estimates",
      limited(RheSpec{}, with([](const Stage& stage) { return about_the_guess(stage, 3); })))
      .several_optima = true;
  add("rhc_limits_at_centre_infeasible", "a circle about a place of the guess that is to be left and kept to",
      limited(on_its_path(), with(kept_to_the_guess)))
      .answer = Family::Answer::infeasible;
  return all;
}

}  // namespace rhec::conformance
