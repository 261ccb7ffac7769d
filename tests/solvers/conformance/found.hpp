#pragma once

// The plugins that are found, and solvers made of them.

#include <memory>
#include <string>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec::conformance {

const Host& host();

bool has_option(const std::string& solver, const std::string& option);

/// The solver by its name with default options, but for a mode that goes on to the tolerance where it has modes, and
/// what `more` says.
std::shared_ptr<Solver> make_solver(const std::string& name, const Settings& more = {});

/// The KKT residual at which a solver made so is content.
double tolerance_of(const std::string& solver);

}  // namespace rhec::conformance
