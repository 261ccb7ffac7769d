#pragma once

// Priors and banks on the linear models of linear_case.hpp.

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/estimation/prior_bank.hpp"
#include "support/linear_case.hpp"

namespace rhec::testing {

/// A prior of a parameter with the bounds [-1, 2].
inline std::shared_ptr<const Prior> prior(const std::string& name, const std::string& options) {
  Variable parameter;
  parameter.lower = -1.0;
  parameter.upper = 2.0;
  auto made = host().make_prior(name, parse_yaml(options, "test"));
  made->set_up(parameter);
  return made;
}

inline PriorBank::Setup bank_setup(const Model& model, std::vector<PriorCombination> members) {
  const Noise noise = noise_of(model);
  PriorBank::Setup setup;
  setup.members = std::move(members);
  for (const double sigma : noise.outputs) setup.output_variances.push_back(sigma * sigma);
  for (const double sigma : noise.inputs) setup.input_variances.push_back(sigma * sigma);
  return setup;
}

/// For two parameters: all priors of the house, along time, ramped and held.
inline std::vector<PriorCombination> linear_priors() {
  return {{prior("walk", "{sigma: 0.2, along: time}"), prior("matern", "{length: 2, along: time}")},
          {prior("matern", "{length: 3, smoothness: 5/2, along: time}"), prior("jumps", "{length: 2, along: time}")},
          {prior("constant", "{}"), prior("matern", "{length: 1, along: time, course: held, mean_walk: 0.3}")}};
}

}  // namespace rhec::testing
