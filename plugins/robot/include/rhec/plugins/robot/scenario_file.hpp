#pragma once

#include <filesystem>

#include "rhec/core/config/settings.hpp"

namespace rhec {

/// Reads a scenario. Its key `robot`, if it has one, names a file with the keys of a robot, relative to the scenario:
/// they are as if they stood in the scenario, whose own keys are put over them. So simulations, logs and the program in
/// the vehicle share one description. Throws Error as load_yaml does, if that file is not there or names another, and
/// as `refuse_what_is_no_scenario`.
RHEC_EXPORT Settings load_scenario(const std::filesystem::path& file);

/// Throws Error for a file of another kind, a sweep or a vehicle's equations: it says what it is and what it is for.
RHEC_EXPORT void refuse_what_is_no_scenario(const Settings& settings);

/// Puts keys over others: maps are merged, all else is replaced.
RHEC_EXPORT void put_over(Settings& base, const Settings& keys);

}  // namespace rhec
