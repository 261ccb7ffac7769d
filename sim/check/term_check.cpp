#include "rhec/sim/check/term_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "differences.hpp"
#include "model_checks.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "samples.hpp"
#include "term_checks.hpp"

namespace rhec::sim {
namespace {

constexpr int places_of_numbers = 16;  // that samples are looked at

/// "on bicycle_slip", and on how many vehicles besides.
std::string on_vehicles(const std::vector<std::string>& names) {
  return names.size() == 1 ? fmt::format("on {}", names.front())
                           : fmt::format("on {} and {} more", names.front(), names.size() - 1);
}

std::vector<double> data_of(const TermFormula& formula, const TermPlaces& places, const std::vector<int>& which) {
  std::vector<double> all;
  for (const int i : which) {
    const NodeNumbers numbers = formula.at(places.all()[static_cast<std::size_t>(i)]);
    all.insert(all.end(), numbers.data.begin(), numbers.data.end());
  }
  return all;
}

/// Places in turn, for so many stages.
std::vector<int> in_turn(int count, const TermPlaces& places) {
  std::vector<int> which;
  which.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) which.push_back(i % static_cast<int>(places.all().size()));
  return which;
}

DerivativeErrors errors_of(const TermFormula& formula, const TermPlaces& places, std::uint64_t seed) {
  const StagePoints stages = random_stages(formula.vehicle().description(), stages_of_a_range, seed);
  const std::vector<double> data = data_of(formula, places, in_turn(stages.count, places));
  std::vector<Variable> rows = formula.about().outputs;
  const std::vector<double> here = formula.values(stages, data);
  // A row has no scale of its own: the values that it has here say how large it is.
  for (std::size_t k = 0; k < here.size(); ++k) {
    double& scale = rows[k % rows.size()].scale;
    if (k < rows.size()) scale = 0.0;
    if (std::isfinite(here[k])) scale = std::max(scale, std::abs(here[k]));
  }
  for (Variable& row : rows)
    if (!(row.scale > 0.0)) row.scale = 1.0;
  std::vector<DifferenceEntry> entries;
  for (const auto* variables : {&formula.about().states, &formula.about().inputs, &formula.about().parameters})
    append_entries(entries, *variables);
  DerivativeErrors errors;
  const DifferenceResults results{&rows, ""};
  const auto jacobians = [&](const StagePoints& points) { return formula.jacobians(points, data); };
  compare_first_derivatives(
      stages, formula.about(), entries, results,
      [&](const StagePoints& points) { return formula.values(points, data); }, jacobians, errors.first, errors);
  compare_second_derivatives(
      stages, formula.about(), entries, results, jacobians,
      [&](const StagePoints& points, const std::vector<double>& weights) {
        return formula.hessians(points, data, weights);
      },
      errors.second, errors);
  return errors;
}

std::vector<Finding> check_derivatives(const std::vector<TermFormula>& on, const TermPlaces& places,
                                       std::uint64_t seed) {
  FindingList findings("derivatives");
  WorstEntry first, second;
  std::vector<std::string> wrong_first, wrong_second;
  int compared = 0, skipped = 0;
  for (const TermFormula& formula : on) {
    const DerivativeErrors errors = errors_of(formula, places, seed);
    const std::string& name = formula.about().name;
    if (errors.first.error > derivative_tolerance) wrong_first.push_back(name);
    if (errors.second.error > derivative_tolerance) wrong_second.push_back(name);
    if (errors.first.error > first.error) first = errors.first;
    if (errors.second.error > second.error) second = errors.second;
    compared += errors.compared;
    skipped += errors.skipped;
  }
  const auto report_worst = [&](const WorstEntry& worst, const std::vector<std::string>& names, const char* what) {
    if (names.empty()) return;
    findings.fail(
        worst.where,
        fmt::format("{}: {:.6g} by the formula, {:.6g} by differences; relative error {:.2g} ({})", what, worst.given,
                    worst.expected, worst.error, on_vehicles(names)),
        "it changes faster than a solver's steps can follow: write it smoother, e.g. with smooth_abs, smooth_max "
        "of a larger width",
        {{"error", worst.error}, {"given", worst.given}, {"expected", worst.expected}});
  };
  report_worst(first, wrong_first, "first derivative");
  report_worst(second, wrong_second, "second derivative");
  if (compared == 0 && findings.empty() && skipped > 0)
    findings.skip("no derivative is finite at random points inside the bounds; see 'numbers'");
  if (findings.empty())
    findings.pass(
        fmt::format("{} entries: largest relative error beyond rounding {:.1g} of first derivatives, {:.1g} of "
                    "second",
                    compared, first.error, second.error),
        {{"first", first.error}, {"second", second.error}, {"compared", compared}, {"skipped", skipped}});
  return findings.take();
}

/// Samples of a vehicle's variables, whose last entry is the place of the node.
class TermSamples : public Samples {
 public:
  TermSamples(const TermFormula& formula, const TermPlaces& places, std::uint64_t seed)
      : Samples(formula.vehicle().description(), seed, "numbers of a term"), formula_(formula), places_(places) {}

  struct Look {
    bool values = false, first = false, second = false;
    bool bad() const { return values || first || second; }
  };

  Point at(int index) {
    Point made = sample(index);
    made.push_back(index % std::min(places_of_numbers, static_cast<int>(places_.all().size())));
    return made;
  }
  static int place_of(const Point& point) { return static_cast<int>(point.back()); }

  std::vector<Look> look(std::span<const Point> points) const {
    StagePoints stages;
    std::vector<int> which;
    for (const Point& point : points) {
      add(point, stages);
      which.push_back(place_of(point));
    }
    const std::vector<double> data = data_of(formula_, places_, which),
                              multipliers(points.size() * static_cast<std::size_t>(formula_.row_count()), 1.0);
    const std::vector<double> values = formula_.values(stages, data), jacobians = formula_.jacobians(stages, data),
                              hessians = formula_.hessians(stages, data, multipliers);
    std::vector<Look> looks(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto bad = [&, i](const std::vector<double>& all) {
        const auto size = static_cast<std::ptrdiff_t>(all.size() / points.size());
        const auto begin = all.begin() + static_cast<std::ptrdiff_t>(i) * size;
        return std::any_of(begin, begin + size, [](double value) { return !std::isfinite(value); });
      };
      looks[i] = {bad(values), bad(jacobians), bad(hessians)};
    }
    return looks;
  }

  FormulaPoint point_of(const Point& point) const {
    StagePoints one;
    add(point, one);
    return {one.states, one.inputs, one.parameters};
  }

 private:
  void add(const Point& point, StagePoints& to) const {
    const ModelDescription& about = formula_.about();
    const auto nx = static_cast<std::ptrdiff_t>(about.states.size()),
               nu = static_cast<std::ptrdiff_t>(about.inputs.size());
    const auto states = point.begin(), inputs = states + nx, parameters = inputs + nu;
    to.states.insert(to.states.end(), states, inputs);
    to.inputs.insert(to.inputs.end(), inputs, parameters);
    to.parameters.insert(to.parameters.end(), parameters, point.end() - 1);
    ++to.count;
  }

  const TermFormula& formula_;
  const TermPlaces& places_;
};

/// The first node that is not finite at a point, in words.
struct Blame {
  std::string found, advice;
};
Blame blame(const TermFormula& formula, const TermPlaces& places, const TermSamples& samples,
            const Samples::Point& point) {
  const std::vector<double> data = data_of(formula, places, {TermSamples::place_of(point)});
  const FormulaTrace trace = trace_formula(formula.graph_with(data), formula.about(), samples.point_of(point));
  for (const TracedPart& part : trace.parts) {
    if (!part.first) continue;
    const TracedNode& node = part.first->node;
    std::string found = fmt::format("; the first that is not finite: n{}{} = {}, {}", node.node,
                                    node.name.empty() ? "" : " (" + node.name + ")", node.term, part.first->why);
    for (const TracedNode& operand : part.first->operands)
      found += fmt::format("; n{}{} = {} = {:.4g}", operand.node, operand.name.empty() ? "" : " (" + operand.name + ")",
                           operand.term, operand.value);
    return {found, part.first->advice};
  }
  return {};
}

std::vector<Finding> check_numbers(const std::vector<TermFormula>& on, const TermPlaces& places,
                                   const TermCheckOptions& options) {
  constexpr int batch = 64;
  FindingList findings("numbers");
  std::vector<std::string> bad_vehicles;
  std::string region, found, advice;
  FindingList::Numbers numbers;
  for (const TermFormula& formula : on) {
    TermSamples samples(formula, places, options.seed);
    std::vector<Samples::Point> bad;
    std::size_t example = 0;
    int values = 0, first = 0, second = 0;
    for (int begin = 0; begin < options.samples; begin += batch) {
      std::vector<Samples::Point> points;
      for (int i = begin; i < std::min(begin + batch, options.samples); ++i) points.push_back(samples.at(i));
      const std::vector<TermSamples::Look> looks = samples.look(points);
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (!looks[i].bad()) continue;
        // One whose value is not finite tells more than one of whose derivatives alone that is so.
        if (looks[i].values && values++ == 0) example = bad.size();
        first += looks[i].first;
        second += looks[i].second;
        bad.push_back(std::move(points[i]));
      }
    }
    if (bad.empty()) continue;
    bad_vehicles.push_back(formula.about().name);
    if (bad_vehicles.size() > 1) continue;
    const Blame because = blame(formula, places, samples, bad[example]);
    region = region_of(samples, bad, [&](std::span<const Samples::Point> points) {
      std::vector<bool> judged;
      for (const TermSamples::Look& look : samples.look(points)) judged.push_back(look.bad());
      return judged;
    });
    found = fmt::format(
        "{} of {} samples give limits, costs or derivatives that are not finite (values {}, first derivatives {}, "
        "second {}), "
        "e.g. at {}{}",
        bad.size(), options.samples, values, first, second, samples.text_of(bad[example]), because.found);
    advice = because.advice;
    numbers = {{"samples", options.samples},
               {"bad", static_cast<double>(bad.size())},
               {"values", values},
               {"first", first},
               {"second", second}};
  }
  if (bad_vehicles.empty())
    findings.pass(
        fmt::format("{} samples of each vehicle inside its bounds (without bounds: within {:g} scales, of angles "
                    "pi), their edges and zeros: all finite",
                    options.samples, reach_of_samples),
        {{"samples", options.samples}});
  else
    findings.fail(region.empty() ? "anywhere" : region, fmt::format("{}: {}", on_vehicles(bad_vehicles), found),
                  advice.empty() ? "write the formula so that it holds there" : advice, std::move(numbers));
  return findings.take();
}

std::vector<Finding> measure_times(const std::vector<TermFormula>& on, const TermPlaces& places, std::uint64_t seed,
                                   std::vector<TermOnVehicle>& vehicles) {
  constexpr int range = 16;
  FindingList findings("time");
  for (std::size_t k = 0; k < on.size(); ++k) {
    const TermFormula& formula = on[k];
    const TermFunctions& functions = formula.functions();
    const TermFunctions::Rows& rows = functions.rows(TermFunctions::Stage::middle);
    const StagePoints stages = random_stages(formula.vehicle().description(), range, seed);
    const std::vector<double> arguments = formula.arguments(stages, data_of(formula, places, in_turn(range, places)));
    const auto count = static_cast<std::size_t>(range);
    std::vector<double> values(count * static_cast<std::size_t>(rows.count())), slopes(count * rows.slopes.size() + 1),
        bends(count * rows.bends.size() + 1), scratch(functions.scratch_size());
    const std::vector<double> weights(values.size(), 1.0);
    const auto time = [&](const auto& call) { return time_of_calls(range, call); };
    const auto evaluate = [&](double* with_slopes) {
      functions.evaluate(TermFunctions::Stage::middle, range, arguments.data(), values.data(), with_slopes,
                         scratch.data());
    };
    vehicles[k].values = time([&] { evaluate(nullptr); });
    vehicles[k].jacobians = time([&] { evaluate(slopes.data()); });
    vehicles[k].hessians = time([&] {
      functions.curve(TermFunctions::Stage::middle, range, arguments.data(), weights.data(), bends.data(),
                      scratch.data());
    });
  }
  const TermOnVehicle& slowest =
      *std::ranges::max_element(vehicles, {}, [](const TermOnVehicle& each) { return each.jacobians.median; });
  findings.pass(fmt::format("at most {:.0f} ns a stage with Jacobian ({:.0f} ns without, {:.0f} ns a Hessian), on {}",
                            slowest.jacobians.median, slowest.values.median, slowest.hessians.median, slowest.vehicle));
  return findings.take();
}

/// Vehicles that a term does not suit, or that could not be made.
struct Refusal {
  std::string vehicle, why;
};

std::vector<Finding> judge_vehicles(const std::vector<TermFormula>& on, const std::vector<Refusal>& refusals,
                                    bool all_have_to_suit) {
  FindingList findings("vehicle");
  std::vector<std::string> suited;
  suited.reserve(on.size());
  for (const TermFormula& formula : on) suited.push_back(formula.about().name);
  if (all_have_to_suit) {
    for (const Refusal& refusal : refusals)
      findings.fail(refusal.vehicle, refusal.why, "give a vehicle that has what the term names, or mend the term");
    if (refusals.empty()) findings.pass(fmt::format("it suits {}", fmt::join(suited, ", ")));
    return findings.take();
  }
  for (const Refusal& refusal : refusals)
    if (on.empty())
      findings.warn(refusal.vehicle, refusal.why, "give the vehicle that it is for (--vehicle; in Python `vehicle`)");
  std::vector<std::string> others;
  others.reserve(refusals.size());
  for (const Refusal& refusal : refusals) others.push_back(fmt::format("{} ({})", refusal.vehicle, refusal.why));
  if (!on.empty())
    findings.pass(fmt::format("it suits {}{}", fmt::join(suited, ", "),
                              others.empty() ? "" : fmt::format("; not {}", fmt::join(others, "; "))));
  if (findings.empty())
    findings.warn("", "no vehicle is found", "give the vehicle that it is for (--vehicle; in Python `vehicle`)");
  return findings.take();
}

TermCheck check_on(const NamedTerm& term, const TermDescription& about,
                   const std::vector<std::shared_ptr<const Model>>& vehicles, std::vector<Refusal> refusals,
                   bool all_have_to_suit, const TermCheckOptions& options) {
  if (options.samples < 1 || options.places < 1)
    throw Error("check of a term: samples and places are to be greater than 0");
  TermCheck check;
  check.term = about.name;
  check.seed = options.seed;
  std::vector<TermFormula> on;
  for (const auto& vehicle : vehicles) {
    try {
      on.emplace_back(term, vehicle);
    } catch (const Error& refusal) {
      // The term is known here, and the vehicle.
      std::string_view why = refusal.what();
      for (const std::string& known :
           {fmt::format("term '{}': ", term.name), fmt::format("the model '{}' ", vehicle->description().name)})
        if (why.starts_with(known)) why.remove_prefix(known.size());
      refusals.push_back({vehicle->description().name, std::string(why)});
    }
  }
  const auto add = [&](std::vector<Finding> found) {
    for (Finding& finding : found) check.findings.push_back(std::move(finding));
  };
  const auto skip = [&](std::initializer_list<const char*> checks, const char* why) {
    for (const char* each : checks) {
      FindingList skipped(each);
      skipped.skip(why);
      add(skipped.take());
    }
  };
  add(check_term_description(about, on));
  add(judge_vehicles(on, refusals, all_have_to_suit));
  if (on.empty()) {
    skip({"rows", "derivatives", "numbers", "time"}, "there is no vehicle to look at it on");
    return check;
  }
  const TermPlaces places(options.places, term.term->most_obstacles(), options.seed);
  const std::vector<Finding> rows = check_rows(on, places);
  add(rows);
  std::erase_if(on, [](const TermFormula& formula) { return formula.row_count() == 0; });
  for (const TermFormula& formula : on)
    check.vehicles.push_back({formula.about().name,
                              static_cast<int>(formula.limit_names().size()),
                              static_cast<int>(formula.cost_names().size()),
                              static_cast<int>(formula.data_names().size()),
                              {},
                              {},
                              {}});
  if (on.empty()) {
    skip({"derivatives", "numbers", "time"}, "there is no limit and no cost");
  } else if (verdict_of(rows) == Verdict::fail) {
    skip({"derivatives", "numbers", "time"}, "what it writes for nodes has to be mended first");
  } else {
    add(check_derivatives(on, places, options.seed));
    add(check_numbers(on, places, options));
    add(measure_times(on, places, options.seed, check.vehicles));
  }
  return check;
}

/// A term of a section, and what it says of itself.
struct MadeTerm {
  NamedTerm term;
  TermDescription about;
};

/// Options that stand among equations, as those of a plugin are told.
std::vector<OptionRow> options_of(const Settings& equations) {
  std::vector<OptionRow> rows;
  const Settings* const options = equations.find("options");
  if (options == nullptr || options->is_null()) return rows;
  for (const auto& [name, about] : options->members()) {
    OptionRow row{.name = name, .type = "number", .default_value = {}, .constraint = {}, .meaning = {}};
    if (about.kind() == Settings::Kind::map) {
      if (const Settings* meaning = about.find("meaning")) row.meaning = meaning->as_text();
      if (const Settings* unit = about.find("unit")) row.meaning += fmt::format(" [{}]", unit->as_text());
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

MadeTerm make(const Host& host, const Settings& section) {
  MadeTerm made;
  const Settings* const equations = section.find("equations");
  const Settings* name = (equations ? *equations : section).find("name");
  made.about.name = name ? name->as_text() : equations ? "equations" : "";
  if (made.about.name.empty())
    throw section.error("a term without a name; expected the key 'name' with that of a term");
  // What a plugin finds inconsistent in its options is told with the place where they are written.
  made.term = {made.about.name,
               equations ? host.make_term(made.about.name, section) : PluginOption<Term>{""}.make(host, section),
               {}};
  if (equations) {
    const Settings* const meaning = equations->find("meaning");
    made.about.meaning = meaning ? meaning->as_text() : "";
    made.about.options = options_of(*equations);
    return made;
  }
  made.about.options = host.options(PluginKind::term, made.about.name);
  for (const PluginRecord& record : host.discover())
    if (record.accepted() && record.kind == PluginKind::term && record.name == made.about.name &&
        record.used_instead.empty())
      made.about.meaning = record.capabilities;
  return made;
}

}  // namespace

TermCheck check_term(const NamedTerm& term, const TermDescription& about,
                     const std::vector<std::shared_ptr<const Model>>& vehicles, bool all_have_to_suit,
                     const TermCheckOptions& options) {
  return check_on(term, about, vehicles, {}, all_have_to_suit, options);
}

TermCheck check_term(const Host& host, const Settings& section,
                     const std::vector<std::shared_ptr<const Model>>& vehicles, const TermCheckOptions& options) {
  const MadeTerm made = make(host, section);
  if (!vehicles.empty()) return check_on(made.term, made.about, vehicles, {}, true, options);
  std::vector<std::shared_ptr<const Model>> found;
  std::vector<Refusal> refusals;
  for (const std::string& name : host.names(PluginKind::model)) {
    try {
      found.push_back(host.make_model(name));
    } catch (const Error& needs_options) {
      refusals.push_back({name, fmt::format("it cannot be made without options: {}", needs_options.what())});
    }
  }
  return check_on(made.term, made.about, found, std::move(refusals), false, options);
}

bool is_name_of_term(const Host& host, const std::string& name) {
  if (is_equations_file(name)) {
    const Settings file = load_yaml(name);
    const Settings* const equations = file.find("equations");
    return equations != nullptr && equations->kind() == Settings::Kind::map;
  }
  const std::vector<std::string> models = host.names(PluginKind::model), terms = host.names(PluginKind::term);
  if (std::ranges::find(models, name) != models.end()) return false;
  if (std::ranges::find(terms, name) != terms.end()) return true;
  const std::string near = nearest(name, terms);
  if (near.empty() || !nearest(name, models).empty()) return false;
  throw Error(
      fmt::format("{}: there is no model and no term of this name; did you mean the term '{}'?\nmodels: {}\nterms: {}",
                  name, near, fmt::join(models, ", "), fmt::join(terms, ", ")));
}

Settings section_of_term(const std::string& name) {
  if (is_equations_file(name)) return load_yaml(name);
  Settings section = Settings::map();
  section.set("name", Settings::scalar(name, {name, 0}));
  return section;
}

TermGraph graph_of_term(const Host& host, const Settings& section, const Model& vehicle) {
  const MadeTerm made = make(host, section);
  // The formula does not outlive this call, and so needs no share of the vehicle.
  const TermFormula formula(made.term, std::shared_ptr<const Model>(std::shared_ptr<const Model>(), &vehicle));
  TermGraph graph{formula.graph_with(formula.at({}).data), formula.about()};
  graph.about.name = fmt::format("{} on {}", made.about.name, graph.about.name);
  return graph;
}

}  // namespace rhec::sim
