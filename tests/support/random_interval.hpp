#pragma once

#include <random>
#include <utility>
#include <vector>

#include "rhec/core/model/model.hpp"

namespace rhec {

/// Random values of all that a request for one interval or one node of a model may ask for.
struct RandomInterval {
  std::vector<double> x, u, p, p_end;
  std::vector<double> multipliers;  ///< of next states
  std::vector<double> weights;      ///< of outputs
  double duration = 0.3;

  RandomInterval(const Model& model, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> number(0.2, 0.8);
    for (auto [values, count] : {std::pair{&x, model.state_count()},
                                 {&u, model.input_count()},
                                 {&p, model.parameter_count()},
                                 {&p_end, model.parameter_count()},
                                 {&multipliers, model.state_count()},
                                 {&weights, model.output_count()}})
      for (int j = 0; j < count; ++j) values->push_back(number(random));
  }

  Model::Intervals request(bool ramp) const {
    return {.count = 1,
            .states = x.data(),
            .inputs = u.data(),
            .parameters = p.data(),
            .parameters_end = ramp ? p_end.data() : nullptr,
            .durations = &duration,
            .substeps = 2,
            .multipliers = multipliers.data()};
  }
};

}  // namespace rhec
