#pragma once

#include <string_view>

#include "rhec/core/estimation/estimator.hpp"

namespace rhec::apps {

/// Prints a line if Runge-Kutta steps of the estimator were too coarse for what the vehicle did; else nothing. `prefix`
/// says which estimator it is.
void print_integration(const Estimator::Counts& counts, const Model& model, std::string_view prefix = "");

}  // namespace rhec::apps
