// Libraries that are whole, but no plugins of this rhec: what their manifests say, and what the loader does.
#include <gmock/gmock.h>

#include <string>
#include <tuple>

#include "plugins/host/fixtures.hpp"
#include "rhec/plugins/kit/fingerprint.hpp"
#include "rhec/plugins/kit/manifest.hpp"

namespace rhec {
namespace library_test {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(Library, AGoodPluginIsToldAsItsManifestSays) {
  const auto records = records_in(fixture("good"));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_TRUE(records[0].accepted()) << records[0].refusal;
  EXPECT_EQ(records[0].kind, PluginKind::blocking);
  EXPECT_EQ(records[0].name, "toy");
  EXPECT_EQ(records[0].version, "1.0");
  EXPECT_EQ(records[0].licence, "MIT");
  EXPECT_EQ(records[0].backend_version, "7");
  EXPECT_EQ(records[0].path.filename(), "toy.so");
}

TEST(Library, ManifestsOfAnotherTimeAreRefused) {
  EXPECT_THAT(refusal_of("wrong_magic"), HasSubstr("does not start like one of rhec"));
  EXPECT_THAT(refusal_of("old_abi"), HasSubstr("has ABI 0, this rhec reads 1: the plugin is older"));
  EXPECT_THAT(refusal_of("new_abi"), HasSubstr("has ABI 99, this rhec reads 1: the plugin is newer"));
  EXPECT_THAT(refusal_of("ends_after_head"), HasSubstr("has 16 bytes, expected"));
  EXPECT_THAT(refusal_of("ends_before_head"), HasSubstr("has 4 bytes, expected 16 at least"));
  EXPECT_THAT(refusal_of("other_revision"),
              HasSubstr("blocking 'wrong' implements revision 77 of the interfaces, this rhec has " +
                        std::to_string(kInterfaceRevision)));
}

TEST(Library, AnotherAlignmentOfEigenIsToldWithThePluginAndBothValues) {
  const std::string own =
      std::string(RHEC_BUILD_FINGERPRINT).substr(std::string(RHEC_BUILD_FINGERPRINT).rfind(", ") + 2);
  for (const auto& [name, plugin, values] :
       {std::tuple("other_alignment", "blocking 'toy' 3.0", "alignment 32 (static "),
        std::tuple("other_static_alignment", "blocking 'toy' 4.0", "(static 0)")}) {
    const auto records = records_in(fixture(name));
    ASSERT_EQ(records.size(), 1u) << name;
    EXPECT_THAT(records[0].refusal, AllOf(HasSubstr(plugin), HasSubstr(values), HasSubstr("rhec with " + own)));
    EXPECT_THAT(records[0].refusal, Not(HasSubstr("gcc"))) << "what is alike is not told";
    EXPECT_THAT(records[0].remedy, HasSubstr("-march"));
    EXPECT_EQ(records[0].name, "toy");
  }
}

TEST(Library, AnotherBuildIsRefusedWithBothFingerprints) {
  EXPECT_THAT(refusal_of("other_fingerprint"),
              AllOf(HasSubstr("rhec 0.0.1, gcc 4, somewhere else"), HasSubstr(RHEC_BUILD_FINGERPRINT)));
}

TEST(Library, IncompleteManifestsAreRefused) {
  EXPECT_THAT(refusal_of("unknown_kind"), HasSubstr("kind 9"));
  EXPECT_THAT(refusal_of("null_text"), HasSubstr("null text"));
  EXPECT_THAT(refusal_of("null_factory"), HasSubstr("schema, create or destroy is null"));
}

TEST(Library, TextsThatAreNoneAreRefused) {
  EXPECT_EQ(refusal_of("endless_text"), "its manifest's licence does not end within 4000 bytes");
  EXPECT_EQ(refusal_of("no_text"), "its manifest's source has control characters: it is no text");
}

TEST(Library, AMissingDependencyIsNamed) {
  const auto records = records_in(fixture("missing_dependency"));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_THAT(records[0].refusal,
              AllOf(HasSubstr("needs the library librhec_test_gone.so, which the loader cannot open"),
                    HasSubstr("librhec_test_gone.so: cannot open shared object file")));
  EXPECT_THAT(records[0].remedy, HasSubstr("install the package that provides librhec_test_gone.so"));
}

TEST(Library, AMissingSymbolIsNamed) {
  const auto records = records_in(fixture("undefined_symbol"));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_THAT(records[0].refusal,
              HasSubstr("undefined symbol: no library that it is linked to defines rhec_test_gone"));
  EXPECT_EQ(records[0].remedy, "link it to the library that does");
}

TEST(Library, ASymbolOfAnotherRhecIsToldWithHowThisOneWasBuilt) {
  const auto records = records_in(fixture("other_strings"));
  ASSERT_EQ(records.size(), 1u);
  EXPECT_THAT(records[0].refusal, HasSubstr("defines rhec::"));
  EXPECT_THAT(records[0].remedy, AllOf(HasSubstr("build it again"), HasSubstr(RHEC_BUILD_FINGERPRINT)));
}

}  // namespace library_test
}  // namespace rhec
