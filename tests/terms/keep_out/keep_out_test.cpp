#include "view.hpp"

namespace rhec {
namespace keep_out_test {

using namespace testing;

TEST(KeepOut, KeepsTheVehicleOnTheLeftOfItsLines) {
  const auto term = make("keep_out",
                         "{vehicle_radius: 0.5, lines: [{x: 0, y: -5, direction: 0}, {x: 20, y: 0, direction: "
                         "1.5707963267948966}]}");
  const At at(bicycle(), term, {}, {18.0, -4.0, 0.0, 0.0});
  ASSERT_EQ(at.values.size(), 2u);
  EXPECT_NEAR(at.values[0], 1.0, 1e-12) << "above y = -5";
  EXPECT_NEAR(at.values[1], 2.0, 1e-12) << "before x = 20";
  EXPECT_NEAR(at.inside(0), 0.5, 1e-12);
  EXPECT_NEAR(at.inside(1), 1.5, 1e-12);
}

TEST(KeepOut, RefusesWhatIsNoLine) {
  EXPECT_THAT(error_of([] { make("keep_out", "{lines: 3}"); }), HasSubstr("a list of lines"));
  EXPECT_THAT(error_of([] { make("keep_out", "{lines: [{heading: 3}]}"); }), HasSubstr("no option 'heading'"));
}

}  // namespace keep_out_test
}  // namespace rhec
