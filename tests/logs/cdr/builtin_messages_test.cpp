#include <gtest/gtest.h>

#include "rhec/logs/cdr/message_definitions.hpp"

namespace rhec::logs {
namespace builtin_messages_test {

TEST(BuiltinMessages, EachIsCompleteInItself) {
  EXPECT_GT(builtin_definitions().size(), 60u);
  for (const auto& [name, definition] : builtin_definitions()) {
    EXPECT_EQ(name, full_type_name(name));
    EXPECT_NO_THROW(link_message(name, builtin_definitions())) << name;
  }
}

}  // namespace builtin_messages_test
}  // namespace rhec::logs
