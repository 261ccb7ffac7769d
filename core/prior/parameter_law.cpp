#include "rhec/core/prior/parameter_law.hpp"

#include <fmt/format.h>

#include "rhec/core/model/model.hpp"
#include "rhec/core/prior/matern_prior.hpp"
#include "rhec/core/prior/walk_prior.hpp"

namespace rhec {

std::shared_ptr<const Prior> ParameterLaw::make(const Variable& parameter) const {
  const double width = ParameterRange(parameter).width;
  std::shared_ptr<Prior> prior;
  if (kind == Kind::walk) {
    WalkPrior::Walk with_rate;
    with_rate.rate = rate_or_length * width;
    prior = std::make_shared<WalkPrior>(with_rate);
  } else {
    MaternPrior::Law matern;
    matern.states = kind == Kind::jumps ? 1 : kind == Kind::matern_3_2 ? 2 : 3;
    matern.length = rate_or_length;
    matern.sigma = sigma * width;
    // A level keeps its value until it changes.
    if (kind == Kind::jumps) matern.course = Course::held;
    prior = std::make_shared<MaternPrior>(matern);
  }
  prior->set_up(parameter);
  return prior;
}

std::string ParameterLaw::text(const Variable& parameter) const {
  const double width = ParameterRange(parameter).width;
  switch (kind) {
    case Kind::walk:
      return fmt::format("walk of {:.2g} per square root of a metre", rate_or_length * width);
    case Kind::jumps:
      return fmt::format("jumps of {:.2g} every {:.2g} m", sigma * width, rate_or_length);
    case Kind::matern_3_2:
      return fmt::format("Matern 3/2 of {:.2g} over {:.2g} m", sigma * width, rate_or_length);
    case Kind::matern_5_2:
      break;
  }
  return fmt::format("Matern 5/2 of {:.2g} over {:.2g} m", sigma * width, rate_or_length);
}

std::vector<ParameterLaw> wide_laws() {
  using Kind = ParameterLaw::Kind;
  std::vector<ParameterLaw> laws;
  for (const double rate : {0.0005, 0.006, 0.025}) laws.push_back({Kind::walk, rate, 0.0});
  for (const double sigma : {0.05, 0.16}) {
    for (const double length : {1.2, 3.0, 8.0, 20.0}) laws.push_back({Kind::jumps, length, sigma});
    for (const double length : {5.0, 12.0, 30.0}) laws.push_back({Kind::matern_3_2, length, sigma});
    for (const double length : {6.0, 15.0, 40.0}) laws.push_back({Kind::matern_5_2, length, sigma});
  }
  return laws;
}

}  // namespace rhec
