// Models whose numbers are not finite somewhere: the check tells where.
#include <gmock/gmock.h>

#include <cmath>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

struct RootOfAState : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::sqrt;
    Unicycle::dynamics(x, u, p, dxdt);
    dxdt[3] = 0.1 * (u[1] - x[3]) - 0.01 * sqrt(x[3] + 0.5);  // not a number below -0.5
  }
};

struct PoleOfAState : Unicycle {
  template <class Scalar>
  constexpr void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::tan;
    Unicycle::dynamics(x, u, p, dxdt);
    dxdt[2] = p[1] * tan(x[3]);
  }
};

struct LogOfAnOutput : Unicycle {
  template <class Scalar>
  constexpr void outputs(const Scalar* x, Scalar* y) const {
    using std::log;
    y[0] = x[0];
    y[1] = x[1] + 0.01 * log(0.9 - x[3]);
  }
};

TEST(ModelCheck, FindsWhereNumbersAreNotFinite) {
  const ModelCheck found = check<RootOfAState>();
  ASSERT_THAT(faults(found), testing::SizeIs(1));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_EQ(numbers.verdict, Verdict::fail);
  EXPECT_THAT(numbers.where, testing::MatchesRegex("rate in \\[-0\\.8, -0\\.(4[6-9]|50?).*\\]")) << numbers.where;
  EXPECT_THAT(numbers.where, testing::Not(HasSubstr(";"))) << "no other variable has to do with it";
  EXPECT_THAT(numbers.found, HasSubstr("next states"));
}

TEST(ModelCheck, FindsWhereOutputsAreNotFiniteWithoutBounds) {
  const ModelCheck found = check<LogOfAnOutput>([](ModelDescription& about) {
    about.states[3].lower = -HUGE_VAL;
    about.states[3].upper = HUGE_VAL;
  });
  ASSERT_THAT(faults(found), testing::SizeIs(1));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_THAT(numbers.where, testing::StartsWith("rate in [0.9")) << numbers.where;
  EXPECT_THAT(numbers.found, HasSubstr("outputs"));
  // Within bounds that keep away from it, there is nothing to find.
  EXPECT_THAT(faults(check<LogOfAnOutput>()), ElementsAre());
}

TEST(ModelCheck, FindsAPoleThatIsFiniteEverywhere) {
  const ModelCheck found = check<PoleOfAState>([](ModelDescription& about) {
    about.states[3].unit = "rad";
    about.states[3].lower = -HUGE_VAL;
    about.states[3].upper = HUGE_VAL;
  });
  ASSERT_THAT(faults(found), testing::SizeIs(1)) << testing::PrintToString(faults(found));
  const Finding& numbers = finding_of(found, "numbers");
  EXPECT_EQ(numbers.verdict, Verdict::warn);
  EXPECT_THAT(numbers.where, HasSubstr("rate in [")) << numbers.where;
  EXPECT_THAT(faults(check<PoleOfAState>()), ElementsAre());
}

}  // namespace
}  // namespace rhec::sim
