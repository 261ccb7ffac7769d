#pragma once

#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"

namespace rhec {

/// The solver of estimators and controllers that name none.
inline constexpr PluginOption<Solver> default_solver{.otherwise = "gn_rti"};

}  // namespace rhec
