#include "rhec/core/prior/standard_bank.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <utility>

#include "rhec/core/model/model.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace standard_bank_test {

ModelDescription vehicle(int parameters) {
  ModelDescription about;
  about.parameters.resize(parameters);
  about.roles.speed_factor = parameters - 1;
  return about;
}

TEST(StandardBank, IsNeverLargerThanTheProcessorCanBear) {
  for (int parameters = 0; parameters <= 9; ++parameters) {
    const auto members = standard_bank(vehicle(parameters));
    EXPECT_GE(members.size(), 1u);
    EXPECT_LE(members.size(), static_cast<std::size_t>(most_bank_members)) << parameters;
    std::set<std::vector<std::shared_ptr<const Prior>>> different(members.begin(), members.end());
    EXPECT_EQ(different.size(), members.size()) << "no combination twice";
    for (const auto& member : members) EXPECT_EQ(member.size(), static_cast<std::size_t>(parameters));
  }
}

TEST(StandardBank, HasEightLawsOfTheSpeedFactorAndThreeOfAnother) {
  const auto members = standard_bank(vehicle(2));
  EXPECT_EQ(members.size(), 24u);
  std::set<std::shared_ptr<const Prior>> other, factor;
  for (const auto& member : members) other.insert(member[0]), factor.insert(member[1]);
  EXPECT_EQ(other.size(), 3u);
  EXPECT_EQ(factor.size(), 8u);
}

/// From three parameters on, every pair of laws of any two parameters comes equally often.
TEST(StandardBank, PairsTheLawsOfManyParametersEqually) {
  for (const int parameters : {3, 4, 5, 6, 9, 15}) {
    const auto members = standard_bank(vehicle(parameters));
    const std::size_t laws = parameters <= 5 ? 4 : 2;
    ASSERT_EQ(members.size() % (laws * laws), 0u) << parameters;
    for (int a = 0; a < parameters; ++a) {
      for (int b = 0; b < a; ++b) {
        std::map<std::pair<const Prior*, const Prior*>, std::size_t> pairs;
        for (const auto& member : members) ++pairs[{member[a].get(), member[b].get()}];
        EXPECT_EQ(pairs.size(), laws * laws) << parameters;
        for (const auto& [pair, count] : pairs) EXPECT_EQ(count, members.size() / (laws * laws));
      }
    }
  }
}

TEST(StandardBank, TakesWhatIsGivenAndFillsTheRoomThatIsLeft) {
  const std::vector<PriorCombination> one = {{}, standard_bank(vehicle(1))[0]};
  EXPECT_EQ(standard_bank(vehicle(2), one).size(), 3u);
  std::vector<PriorCombination> many(2);
  for (int k = 0; k < 12; ++k) many[0].push_back(standard_bank(vehicle(1))[0][0]);
  EXPECT_EQ(standard_bank(vehicle(2), many).size(), 24u);
  many[1] = {many[0][0], many[0][1], many[0][2]};
  EXPECT_THAT(error_of([&] { standard_bank(vehicle(2), many); }),
              ::testing::HasSubstr("make 36 combinations; a bank has 24 members at most"));
}

}  // namespace standard_bank_test
}  // namespace rhec
