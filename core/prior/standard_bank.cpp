#include "rhec/core/prior/standard_bank.hpp"

#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/prior/matern_prior.hpp"
#include "rhec/core/prior/walk_prior.hpp"

namespace rhec {
namespace {

/// A law, in fractions of the width of the bounds.
struct Law {
  int states;             ///< 1: random walk; 2, 3: Matern 3/2 and 5/2
  double rate_or_length;  ///< per square root of a metre; [m]
};
constexpr double share = 0.15;  ///< standard deviation about the mean

using Laws = std::vector<Law>;

/// From the one that serves alone to a set that serves for slip of any kind: what `standard_bank` can afford is taken.
/// For fields of 2 to 40 m, patches and constant slip.
Laws laws(int count) {
  switch (count) {
    case 1:
      return {{2, 10.0}};
    case 2:
      return {{1, 0.004}, {2, 12.0}};
    case 3:
      return {{1, 0.004}, {2, 6.0}, {2, 24.0}};
    case 4:
      return {{1, 0.002}, {1, 0.025}, {2, 8.0}, {3, 40.0}};
    case 5:
    case 6:  // one less than the richest, which nothing but a full bank asks for
      return {{1, 0.002}, {1, 0.025}, {2, 8.0}, {3, 14.0}, {3, 40.0}};
    default:
      return {{1, 0.002}, {1, 0.01}, {1, 0.025}, {1, 0.06}, {2, 8.0}, {3, 14.0}, {3, 40.0}};
  }
}

std::shared_ptr<const Prior> make(const Law& law, const Variable& parameter) {
  const double width = ParameterRange(parameter).width;
  std::shared_ptr<Prior> prior;
  if (law.states == 1) {
    WalkPrior::Walk walk;
    walk.rate = law.rate_or_length * width;
    prior = std::make_shared<WalkPrior>(walk);
  } else {
    MaternPrior::Law matern;
    matern.states = law.states;
    matern.length = law.rate_or_length;
    matern.sigma = share * width;
    prior = std::make_shared<MaternPrior>(matern);
  }
  prior->set_up(parameter);
  return prior;
}

/// How many laws each parameter has: as many as are given, else seven and three if that is affordable, else fewer. The
/// speed factor, the richest, gives way last.
std::vector<int> counts(const std::vector<PriorCombination>& given, std::size_t richest) {
  std::vector<int> count;
  for (std::size_t j = 0; j < given.size(); ++j)
    count.push_back(!given[j].empty() ? static_cast<int>(given[j].size()) : j == richest ? 7 : 3);
  const auto members = [&] {
    double product = 1.0;
    for (const int each : count) product *= each;
    return product;
  };
  while (members() > most_bank_members) {
    std::size_t largest = count.size();
    for (std::size_t j = 0; j < count.size(); ++j)
      if (given[j].empty() && count[j] > 1 && (largest == count.size() || count[j] > count[largest])) largest = j;
    if (largest == count.size())
      throw Error(fmt::format("the priors given make {} combinations; a bank has {} members at most. Give fewer",
                              members(), most_bank_members));
    --count[largest];
  }
  return count;
}

}  // namespace

std::vector<PriorCombination> standard_bank(const ModelDescription& about, const std::vector<PriorCombination>& given) {
  std::vector<PriorCombination> choices = given;
  choices.resize(about.parameters.size());
  const std::size_t richest = about.roles.speed_factor >= 0 ? static_cast<std::size_t>(about.roles.speed_factor) : 0;
  const std::vector<int> count = counts(choices, richest);
  std::vector<PriorCombination> members(1);
  for (std::size_t j = 0; j < choices.size(); ++j) {
    if (choices[j].empty())
      for (const Law& law : laws(count[j])) choices[j].push_back(make(law, about.parameters[j]));
    std::vector<PriorCombination> more;
    for (const std::shared_ptr<const Prior>& prior : choices[j]) {
      for (PriorCombination member : members) {
        member.push_back(prior);
        more.push_back(std::move(member));
      }
    }
    members = std::move(more);
  }
  return members;
}

}  // namespace rhec
