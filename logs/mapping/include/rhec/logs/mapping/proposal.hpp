#pragma once

#include <string>

#include "rhec/core/model/model.hpp"
#include "rhec/logs/signals/survey.hpp"

namespace rhec::logs {

/// A section `signals` in YAML for a vehicle and what there is in a log: sure where names agree, else the likeliest
/// signals by the types of topics and the units of variables. What was not found is left to fill in, with what could be
/// meant.
RHEC_EXPORT std::string propose_signals(const Survey& survey, const ModelDescription& about);

}  // namespace rhec::logs
