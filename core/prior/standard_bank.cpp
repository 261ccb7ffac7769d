#include "rhec/core/prior/standard_bank.hpp"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/prior/parameter_law.hpp"

namespace rhec {
namespace {

using Law = ParameterLaw;
constexpr auto walk = Law::Kind::walk, jumps = Law::Kind::jumps, smooth = Law::Kind::matern_3_2,
               smoother = Law::Kind::matern_5_2;

using Laws = std::vector<Law>;

/// From the one that serves alone to a set that serves for slip of any kind: what `standard_bank` can afford is taken.
/// For fields of 2 to 40 m, patches and constant slip. Each set has a law that jumps, whose covariance grows at once:
/// without it the estimate is too certain on patches.
Laws laws(int count) {
  switch (count) {
    case 1:
      return {{smooth, 10.0}};
    case 2:
      return {{walk, 0.004}, {jumps, 8.0}};
    case 3:
      return {{walk, 0.003}, {jumps, 4.0, 0.158}, {smooth, 24.0}};
    case 4:
      return {{walk, 0.002}, {walk, 0.02}, {jumps, 6.0}, {smooth, 12.0}};
    case 5:
      return {{walk, 0.002}, {walk, 0.02}, {jumps, 6.0}, {smooth, 8.0}, {smoother, 40.0}};
    case 6:
      return {{walk, 0.002}, {walk, 0.02}, {jumps, 6.0}, {smooth, 8.0}, {smoother, 14.0}, {smoother, 40.0}};
    case 7:
      return {{walk, 0.002}, {walk, 0.01},     {walk, 0.025},   {jumps, 6.0},
              {smooth, 8.0}, {smoother, 14.0}, {smoother, 40.0}};
    default:
      return {{walk, 0.002},      {walk, 0.01},  {walk, 0.025},    {jumps, 6.0},
              {jumps, 20.0, 0.2}, {smooth, 8.0}, {smoother, 14.0}, {smoother, 40.0}};
  }
}
constexpr int most_laws = 8, usual_laws = 3;

/// How many laws each parameter has: as many as are given, else eight for the richest and three for each other if that
/// is affordable, else fewer: the one with most gives way, the richest last among equals.
std::vector<int> counts(const std::vector<PriorCombination>& given, std::size_t richest) {
  std::vector<int> count;
  for (std::size_t j = 0; j < given.size(); ++j)
    count.push_back(!given[j].empty() ? static_cast<int>(given[j].size()) : j == richest ? most_laws : usual_laws);
  const auto members = [&] {
    double product = 1.0;
    for (const int each : count) product *= each;
    return product;
  };
  while (members() > most_bank_members) {
    std::size_t largest = count.size();
    for (std::size_t j = 0; j < count.size(); ++j) {
      if (!given[j].empty() || count[j] == 1) continue;
      const bool is_first = largest == count.size();
      if (is_first || count[j] > count[largest] || (count[j] == count[largest] && largest == richest)) largest = j;
    }
    if (largest == count.size())
      throw Error(fmt::format("the priors given make {} combinations; a bank has {} members at most. Give fewer",
                              members(), most_bank_members));
    --count[largest];
  }
  return count;
}

/// Product of two elements of the field of four, as polynomials modulo x^2 + x + 1.
unsigned product_in_field_of_four(unsigned a, unsigned b) {
  unsigned product = (b & 1U ? a : 0U) ^ (b & 2U ? a << 1U : 0U);
  if (product & 4U) product ^= 7U;
  return product;
}

constexpr std::size_t most_with_four_laws = 5, most_with_two_laws = 15;

/// Which of its laws each parameter has in a run of an orthogonal array of strength 2: every pair of laws of any two
/// parameters comes equally often, in far fewer runs than all combinations (Hedayat, Sloane and Stufken 1999).
unsigned law_in_run(unsigned run, std::size_t parameter, std::size_t parameters) {
  if (parameters <= most_with_four_laws) {
    const unsigned a = run % 4U, b = run / 4U;
    return parameter == 0 ? b : a ^ product_in_field_of_four(static_cast<unsigned>(parameter - 1), b);
  }
  unsigned bits = run & static_cast<unsigned>(parameter + 1), parity = 0;
  for (; bits != 0; bits >>= 1U) parity ^= bits & 1U;
  return parity;
}

/// For three parameters and more, where combinations would leave room for two or three laws each.
std::vector<PriorCombination> orthogonal_bank(const ModelDescription& about) {
  const std::size_t parameters = about.parameters.size();
  std::vector<PriorCombination> choices;
  for (const Variable& parameter : about.parameters) {
    choices.emplace_back();
    for (const Law& law : laws(parameters <= most_with_four_laws ? 4 : 2))
      choices.back().push_back(law.make(parameter));
  }
  const std::size_t runs = parameters <= most_with_four_laws ? 16 : std::bit_ceil(parameters + 1);
  std::vector<PriorCombination> members(runs);
  for (unsigned run = 0; run < runs; ++run)
    for (std::size_t j = 0; j < parameters; ++j) members[run].push_back(choices[j][law_in_run(run, j, parameters)]);
  return members;
}

}  // namespace

std::vector<PriorCombination> standard_bank(const ModelDescription& about, const std::vector<PriorCombination>& given) {
  std::vector<PriorCombination> choices = given;
  choices.resize(about.parameters.size());
  const bool all_open = std::all_of(choices.begin(), choices.end(), [](const auto& each) { return each.empty(); });
  if (all_open && choices.size() > 2 && choices.size() <= most_with_two_laws) return orthogonal_bank(about);
  const std::size_t richest = about.roles.speed_factor >= 0 ? static_cast<std::size_t>(about.roles.speed_factor) : 0;
  const std::vector<int> count = counts(choices, richest);
  std::vector<PriorCombination> members(1);
  for (std::size_t j = 0; j < choices.size(); ++j) {
    if (choices[j].empty())
      for (const Law& law : laws(count[j])) choices[j].push_back(law.make(about.parameters[j]));
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
