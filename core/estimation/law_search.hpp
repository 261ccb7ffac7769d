#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/core/estimation/smoother.hpp"

namespace rhec {

/// What a bank of filters finds out on its way through a log.
struct Passage {
  std::vector<double> distances;         ///< ground covered on each interval [m]; NaN while the heading is searched
  std::vector<double> inputs;            ///< n_u of each interval: as measured, else as guessed; NaN as above
  std::vector<double> log_likelihoods;   ///< of its members
  std::vector<double> output_variances;  ///< at the end
};
/// Takes a bank through a log, without changes from one law of variation to another.
Passage pass(const std::shared_ptr<const Model>& model, BankEstimation::Setup filters, const NodeLog& log);

/// A combination of laws, one a parameter.
struct WeighedLaws {
  PriorCombination priors;
  std::vector<std::string> texts;
  double probability = 0.0;
};

/// The combinations of laws that explain a log best, the most probable first; all are equally probable before the log.
/// `given` are the priors to choose from for each parameter; where none are, the laws of `wide_laws`, and then those
/// near the best of them. What makes more combinations than a bank has members is searched parameter by parameter.
/// Returns at most `most`, and none that is less probable than the best one by the factor `least`.
std::vector<WeighedLaws> search_laws(const std::shared_ptr<const Model>& model, const BankEstimation::Setup& filters,
                                     const std::vector<PriorCombination>& given, const NodeLog& log, int most,
                                     double least);

}  // namespace rhec
