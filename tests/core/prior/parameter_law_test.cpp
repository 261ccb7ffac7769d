#include "rhec/core/prior/parameter_law.hpp"

#include <gmock/gmock.h>

#include <set>
#include <string>

#include "rhec/core/model/model.hpp"
#include "rhec/core/prior/standard_bank.hpp"

namespace rhec {
namespace parameter_law_test {

using Kind = ParameterLaw::Kind;

Variable factor() {
  Variable parameter;
  parameter.lower = 0.5;
  parameter.upper = 1.5;
  return parameter;
}
double variance_after(const Prior& prior, double advance) {
  double F[16], Q[16];
  prior.advance(advance, F, Q);
  return Q[0];
}

TEST(ParameterLaw, HasSizesOfTheWidthOfTheBounds) {
  Variable twice = factor();
  twice.upper = 2.5;
  for (const ParameterLaw& law : wide_laws())
    EXPECT_NEAR(variance_after(*law.make(twice), 1.0) / variance_after(*law.make(factor()), 1.0), 4.0, 1e-9)
        << law.text(twice);
}

TEST(ParameterLaw, IsMadeAndSaidByItsNumbers) {
  const ParameterLaw walk{Kind::walk, 0.01, 0.0}, jumps{Kind::jumps, 8.0, 0.1}, smooth{Kind::matern_5_2, 20.0, 0.1};
  EXPECT_NEAR(variance_after(*walk.make(factor()), 4.0), 0.0004, 1e-15);
  EXPECT_EQ(jumps.make(factor())->course(), Course::held);
  EXPECT_EQ(smooth.make(factor())->course(), Course::ramp);
  EXPECT_EQ(smooth.make(factor())->state_count(), 4) << "with its mean";
  EXPECT_EQ(walk.text(factor()), "walk of 0.01 per square root of a metre");
  EXPECT_EQ(jumps.text(factor()), "jumps of 0.1 every 8 m");
  EXPECT_EQ(smooth.text(factor()), "Matern 5/2 of 0.1 over 20 m");
  EXPECT_EQ((ParameterLaw{Kind::matern_3_2, 20.0, 0.1}.text(factor())), "Matern 3/2 of 0.1 over 20 m");
}

TEST(WideLaws, FitInABankAndDiffer) {
  std::set<std::string> texts;
  std::set<Kind> kinds;
  for (const ParameterLaw& law : wide_laws()) texts.insert(law.text(factor())), kinds.insert(law.kind);
  EXPECT_EQ(texts.size(), wide_laws().size());
  EXPECT_LE(texts.size(), static_cast<std::size_t>(most_bank_members));
  EXPECT_EQ(kinds.size(), 4u);
}

}  // namespace parameter_law_test
}  // namespace rhec
