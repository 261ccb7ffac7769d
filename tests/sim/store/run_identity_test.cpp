#include "rhec/sim/store/run_identity.hpp"

#include <gtest/gtest.h>

#include <string>

#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::sim {
namespace run_identity_test {

TEST(RunIdentity, IsSha256OfTheConfiguration) {
  // FIPS 180-4's own examples, and a text of a million characters.
  EXPECT_EQ(identity_of("abc").text(), "ba7816bf8f01cfea414140de5dae2223");
  EXPECT_EQ(identity_of("").text(), "e3b0c44298fc1c149afbf4c8996fb924");
  EXPECT_EQ(identity_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq").text(),
            "248d6a61d20638b8e5c026930c3e6039");
  EXPECT_EQ(identity_of(std::string(1000000, 'a')).text(), "cdc76e5c9914fb9281a1c7e284d73e67");
}

TEST(RunIdentity, IsTheSameForAllWaysToWriteTheSame) {
  const auto text = [](const char* yaml) { return canonical_text(parse_yaml(yaml, "x")); };
  EXPECT_EQ(text("{b: 8.0, a: {d: [1, 0.10], c: on}}"), R"({"a":{"c":"on","d":[1,0.1]},"b":8})");
  EXPECT_EQ(text("{a: {c: on, d: [+1, 1e-1]}, b: 0.8e1}"), text("b: 8\na:\n  d: [1, .1]\n  c: 'on'\n"));
  EXPECT_EQ(text("[.inf, -.inf, true, null, 'say \"x\"']"), R"([".inf","-.inf",true,null,"say \"x\""])");
  EXPECT_NE(text("{a: [1, 2]}"), text("{a: [2, 1]}"));
}

}  // namespace run_identity_test
}  // namespace rhec::sim
