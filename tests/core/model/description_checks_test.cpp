// Which variables a description must have, and what its roles may name.
#include <gtest/gtest.h>

#include <string>

#include "rhec/core/model/graph_model.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace description_checks_test {

ModelDescription description() {
  ModelDescription about;
  about.name = "cart";
  about.states.resize(3);
  about.inputs.resize(1);
  about.parameters.resize(1);
  about.outputs.resize(2);
  return about;
}
std::string why_refused(const ModelDescription& about) {
  return error_of([&] { check_description(about, {.states = 3, .inputs = 1, .parameters = 1, .outputs = 2}); });
}

TEST(CheckDescription, CountsVariables) {
  EXPECT_EQ(why_refused(description()), "");
  ModelDescription about = description();
  about.outputs.pop_back();
  EXPECT_EQ(why_refused(about),
            "model 'cart': its formula has 2 outputs and its description 1; describe each of them, in the formula's "
            "order");
}

TEST(CheckDescription, LooksAtEveryRole) {
  const auto refusal_of = [](auto role, int index) {
    ModelDescription about = description();
    about.roles.*role = index;
    return why_refused(about);
  };
  for (const auto role : {&Roles::position_x, &Roles::position_y, &Roles::heading, &Roles::speed_state}) {
    EXPECT_EQ(refusal_of(role, 2), "");
    EXPECT_EQ(refusal_of(role, -1), "");
    EXPECT_NE(refusal_of(role, 3), "");
    EXPECT_NE(refusal_of(role, -2), "");
  }
  EXPECT_NE(refusal_of(&Roles::speed, 1).find("the role speed names number 1 of its 1 inputs"), std::string::npos);
  EXPECT_NE(refusal_of(&Roles::speed_factor, 1), "");
  ModelDescription about = description();
  about.roles.other_headings = {1, 3};
  EXPECT_NE(why_refused(about).find("other_headings"), std::string::npos);
}

}  // namespace description_checks_test
}  // namespace rhec
