#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "rhec/core/term/term_functions.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/check/finding.hpp"
#include "rhec/sim/check/formula_trace.hpp"
#include "rhec/sim/numbers/spread.hpp"

/// Checks of a new term, limits and costs of a controller's problem, before its first run; docs/check.md explains each.
namespace rhec::sim {

struct ModelCheck;

/// What a term says of itself.
struct TermDescription {
  std::string name, meaning;       ///< of its manifest; an empty meaning is missing
  std::vector<OptionRow> options;  ///< its own and those that all terms have
};

/// A vehicle on which a term was looked at: numbers of its rows, and evaluation times of one stage [ns].
struct TermOnVehicle {
  std::string vehicle;
  int limits = 0, costs = 0, data = 0;
  Spread values, jacobians, hessians;
};

struct RHEC_EXPORT TermCheck {
  std::string term;
  std::uint64_t seed = 0;
  std::vector<Finding> findings;        ///< in the order of the checks, at least one per check
  std::vector<TermOnVehicle> vehicles;  ///< those that suit

  int count(Verdict verdict) const { return count_of(findings, verdict); }
  Verdict verdict() const { return verdict_of(findings); }
};

struct TermCheckOptions {
  std::uint64_t seed = 1;
  int samples = 1024;  ///< of a vehicle's variables, in the search for numbers that are not finite
  int places = 512;    ///< of a node, for data and bounds
};

/// Runs all checks of a term on each of the vehicles that suits it. One that does not is a failure if
/// `all_have_to_suit`; else it is told, and that none suits is a warning. Throws Error if the options are not positive.
RHEC_EXPORT TermCheck check_term(const NamedTerm& term, const TermDescription& about,
                                 const std::vector<std::shared_ptr<const Model>>& vehicles, bool all_have_to_suit,
                                 const TermCheckOptions& options = {});

/// The term of a section of `controller.terms`, with its name and options, or its equations. Without vehicles on all
/// model plugins that are found and need no options. Throws Error with the place of a mistake in the section.
RHEC_EXPORT TermCheck check_term(const Host& host, const Settings& section,
                                 const std::vector<std::shared_ptr<const Model>>& vehicles = {},
                                 const TermCheckOptions& options = {});

/// Whether a name is that of a term plugin, and of no model, or that of a file (*.yaml) with a term's equations, which
/// are a map, where a vehicle's are a text. Throws Error where it is nearly a term's and nearly no model's, with both.
RHEC_EXPORT bool is_name_of_term(const Host& host, const std::string& name);
/// The section of a term of such a name: with that name, or what the file has.
RHEC_EXPORT Settings section_of_term(const std::string& name);

/// A term of a section on a vehicle as a formula to look at (`trace_formula`): outputs are limits and costs, options
/// are what is known of a node, at the origin at time 0. `about` is the vehicle's, with the rows as outputs. Throws
/// Error if the term does not suit the vehicle.
struct TermGraph {
  VehicleGraph formula;
  ModelDescription about;
};
RHEC_EXPORT TermGraph graph_of_term(const Host& host, const Settings& section, const Model& vehicle);

/// As a JSON object; non-finite numbers become null.
RHEC_EXPORT std::string check_json(const TermCheck& check);
/// That of a scenario's model, with those of its controller's terms in a list `terms`.
RHEC_EXPORT std::string check_json(const ModelCheck& model, const std::vector<TermCheck>& terms);

}  // namespace rhec::sim
