#pragma once

#include <string>

#include "rhec/sim/files/json.hpp"
#include "rhec/sim/loop/closed_loop.hpp"

namespace rhec::sim {

/// The files of a run: steps.csv, summary.json, run.svg (byte-identical for the same scenario and seed, except for the
/// solve times in the summary), and times.csv.
RHEC_EXPORT std::string steps_csv(const RunLog& log, const Scenario& scenario);
RHEC_EXPORT std::string times_csv(const RunLog& log);
RHEC_EXPORT Json json_of(const RunSummary& summary);
RHEC_EXPORT std::string summary_json(const RunSummary& summary);
/// `causal`, if given, are the estimates that drove; `log` are then those of a smoother.
RHEC_EXPORT std::string run_svg(const RunLog& log, const Scenario& scenario, const RunLog* causal = nullptr);

}  // namespace rhec::sim
