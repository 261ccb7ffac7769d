#include "law_search.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/prior/parameter_law.hpp"

namespace rhec {
namespace {

/// How often each parameter's law is chosen anew, given those of the others.
constexpr int rounds = 2;

/// No law is quite right, so that innovations are not independent and their likelihood says too much: this power of it
/// counts.
constexpr double trust = 0.5;

/// Laws that are less probable by more than this are no part of the combinations that are weighed at last.
constexpr double most_deficit = 8.0;  // of the logarithm

/// A law of one parameter.
struct Candidate {
  std::shared_ptr<const Prior> prior;
  std::optional<ParameterLaw> law;  ///< none for one that was given
  std::string text;
  double log_likelihood = -infinity;  ///< with the best laws of the other parameters
};
using Candidates = std::vector<Candidate>;

class LawSearch {
 public:
  LawSearch(const std::shared_ptr<const Model>& model, const BankEstimation::Setup& filters,
            const std::vector<PriorCombination>& given, const NodeLog& log)
      : model_(model), filters_(filters), log_(log), about_(model->description()) {
    for (std::size_t j = 0; j < about_.parameters.size(); ++j) {
      const bool is_open = j >= given.size() || given[j].empty();
      candidates_.push_back(is_open ? made(wide_laws(), j) : Candidates{});
      for (std::size_t k = 0; !is_open && k < given[j].size(); ++k)
        candidates_[j].push_back(
            {given[j][k],
             {},
             given[j].size() == 1 ? "the prior given" : fmt::format("prior {} of those given", k + 1),
             -infinity});
      // The first of a parameter's candidates is the one that the others are tried with.
      const auto usual = std::find_if(candidates_[j].begin(), candidates_[j].end(), [](const Candidate& each) {
        return each.law && each.law->kind == ParameterLaw::Kind::matern_3_2 && each.law->sigma > 0.1;
      });
      if (usual != candidates_[j].end()) std::iter_swap(candidates_[j].begin(), usual);
    }
  }

  std::vector<WeighedLaws> find(int most, double least) {
    if (combinations() > most_bank_members) {
      for (int round = 0; round < rounds; ++round) improve();
      keep_few();
    }
    return weighed(most, least);
  }

 private:
  Candidates made(const std::vector<ParameterLaw>& laws, std::size_t parameter) const {
    const Variable& about = about_.parameters[parameter];
    Candidates all;
    for (const ParameterLaw& law : laws) all.push_back({law.make(about), law, law.text(about), -infinity});
    return all;
  }
  double combinations() const {
    double product = 1.0;
    for (const Candidates& each : candidates_) product *= static_cast<double>(each.size());
    return product;
  }
  PriorCombination best() const {
    PriorCombination priors;
    for (const Candidates& each : candidates_) priors.push_back(each.front().prior);
    return priors;
  }
  std::vector<double> log_likelihoods(std::vector<PriorCombination> members) const {
    // A bank of one does not weigh itself.
    if (members.size() == 1) return {0.0};
    BankEstimation::Setup filters = filters_;
    filters.bank.members = std::move(members);
    return pass(model_, std::move(filters), log_).log_likelihoods;
  }

  /// Parameter by parameter: which candidate explains the log best, with the best of the others. Sorts them.
  void improve() {
    for (std::size_t j = 0; j < candidates_.size(); ++j) {
      Candidates& own = candidates_[j];
      for (std::size_t first = 0; first < own.size(); first += most_bank_members) {
        const std::size_t end = std::min(own.size(), first + most_bank_members);
        std::vector<PriorCombination> members;
        for (std::size_t k = first; k < end; ++k) {
          members.push_back(best());
          members.back()[j] = own[k].prior;
        }
        const std::vector<double> found = log_likelihoods(std::move(members));
        for (std::size_t k = first; k < end; ++k)
          own[k].log_likelihood = std::isfinite(found[k - first]) ? found[k - first] : -infinity;
      }
      std::stable_sort(own.begin(), own.end(),
                       [](const Candidate& a, const Candidate& b) { return a.log_likelihood > b.log_likelihood; });
    }
  }

  /// The best candidates of each parameter, as many as a bank has room for in all combinations.
  void keep_few() {
    for (Candidates& each : candidates_) {
      const double least = each.front().log_likelihood - most_deficit;
      std::erase_if(each, [&](const Candidate& other) { return !(other.log_likelihood >= least); });
    }
    while (combinations() > most_bank_members)
      std::max_element(candidates_.begin(), candidates_.end(), [](const Candidates& a, const Candidates& b) {
        return a.size() < b.size();
      })->pop_back();
  }

  std::vector<WeighedLaws> weighed(int most, double least) const {
    std::vector<WeighedLaws> all(1);
    for (const Candidates& each : candidates_) {
      std::vector<WeighedLaws> more;
      for (const WeighedLaws& so_far : all)
        for (const Candidate& candidate : each) {
          more.push_back(so_far);
          more.back().priors.push_back(candidate.prior);
          more.back().texts.push_back(candidate.text);
        }
      all = std::move(more);
    }
    std::vector<PriorCombination> members;
    members.reserve(all.size());
    for (const WeighedLaws& each : all) members.push_back(each.priors);
    const std::vector<double> found = log_likelihoods(std::move(members));
    double highest = -infinity, sum = 0.0;
    for (const double each : found)
      if (std::isfinite(each)) highest = std::max(highest, each);
    for (std::size_t k = 0; k < all.size(); ++k)
      all[k].probability = std::isfinite(found[k]) ? std::exp(trust * (found[k] - highest)) : 0.0;
    std::stable_sort(all.begin(), all.end(),
                     [](const WeighedLaws& a, const WeighedLaws& b) { return a.probability > b.probability; });
    const auto enough =
        std::find_if(all.begin() + 1, all.end(), [&](const WeighedLaws& each) { return !(each.probability >= least); });
    all.resize(std::min(static_cast<std::size_t>(enough - all.begin()), static_cast<std::size_t>(std::max(most, 1))));
    for (const WeighedLaws& each : all) sum += each.probability;
    for (WeighedLaws& each : all) each.probability = sum > 0.0 ? each.probability / sum : 1.0 / std::ssize(all);
    return all;
  }

  const std::shared_ptr<const Model>& model_;
  const BankEstimation::Setup& filters_;
  const NodeLog& log_;
  const ModelDescription& about_;
  std::vector<Candidates> candidates_;
};

}  // namespace

Passage pass(const std::shared_ptr<const Model>& model, BankEstimation::Setup setup, const NodeLog& log) {
  const int nu = model->input_count();
  const std::ptrdiff_t ny = model->output_count(), N = log.intervals();
  setup.bank.memory = infinity;
  setup.remembered_nodes = 1;
  setup.bank.most_between = log.most_between();
  BankEstimation filters(model, std::move(setup));
  Passage passage;
  filters.start(log.measured(0, ny));
  for (std::ptrdiff_t i = 0; i < N; ++i) {
    const bool is_searched = filters.is_searching();
    filters.add(log.interval(static_cast<int>(i), nu), log.measured(static_cast<int>(i) + 1, ny));
    for (int j = 0; j < nu; ++j) {
      const double measured = log.inputs[static_cast<std::size_t>(i * nu + j)];
      passage.inputs.push_back(std::isnan(measured) && !is_searched ? filters.bank().guessed_input(j) : measured);
    }
    passage.distances.push_back(is_searched ? std::numeric_limits<double>::quiet_NaN() : filters.bank().distance());
  }
  const auto found = filters.bank().log_likelihoods();
  passage.log_likelihoods.assign(found.begin(), found.end());
  for (int j = 0; j < ny; ++j) passage.output_variances.push_back(filters.bank().noise(j).variance);
  return passage;
}

std::vector<WeighedLaws> search_laws(const std::shared_ptr<const Model>& model, const BankEstimation::Setup& filters,
                                     const std::vector<PriorCombination>& given, const NodeLog& log, int most,
                                     double least) {
  return LawSearch(model, filters, given, log).find(most, least);
}

}  // namespace rhec
