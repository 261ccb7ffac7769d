// Files that are no library for this machine, or not a whole one: they are refused without being loaded.
#include <elf.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <string>

#include "plugins/host/fixtures.hpp"

namespace rhec {
namespace elf_file_test {

using testing::AllOf;
using testing::HasSubstr;

TEST(ElfFile, ALibraryWithoutAManifestIsNotEvenLoaded) {
  EXPECT_THAT(refusal_of("no_manifest"), HasSubstr("exports no data symbol rhec_plugin_manifest"));
  EXPECT_EQ(getenv("RHEC_TEST_NO_MANIFEST_RAN"), nullptr) << "its constructors ran";
}

TEST(ElfFile, FilesThatAreNoLibraryAreRefused) {
  TemporaryFolder folder;
  std::ofstream(folder.path() / "a_empty.so").close();
  std::ofstream(folder.path() / "b_text.so") << "GROUP ( libm.so.6 )\n";
  fs::copy_file("/proc/self/exe", folder.path() / "c_program.so");
  fs::create_symlink("nowhere", folder.path() / "d_dangling.so");
  fs::create_directory(folder.path() / "e_folder.so");
  ASSERT_EQ(mkfifo((folder.path() / "f_pipe.so").c_str(), 0600), 0);
  fs::create_symlink("g_loop.so", folder.path() / "g_loop.so");
  std::ofstream(folder.path() / "h_notes.txt") << "not looked at";
  const auto records = records_in(folder.path());
  ASSERT_EQ(records.size(), 7u);
  EXPECT_THAT(records[0].refusal, HasSubstr("empty"));
  EXPECT_THAT(records[1].refusal, HasSubstr("not an ELF file"));
  EXPECT_THAT(records[2].refusal, HasSubstr("a program, not a shared library"));
  EXPECT_THAT(records[3].refusal, HasSubstr("a symbolic link to nowhere, where nothing is"));
  EXPECT_THAT(records[4].refusal, HasSubstr("a directory, not a library"));
  EXPECT_THAT(records[5].refusal, HasSubstr("a pipe"));
  EXPECT_THAT(records[6].refusal, HasSubstr("cannot be looked at"));
  for (const PluginRecord& record : records) EXPECT_NE(record.remedy, "") << record.path;
}

/// A copy of the good plugin with other bytes in the head of the file.
std::string refusal_with_bytes(std::streamoff offset, const std::string& bytes) {
  TemporaryFolder folder;
  const fs::path copy = folder.path() / "toy.so";
  fs::copy_file(fixture("good") / "toy.so", copy);
  std::fstream(copy, std::ios::in | std::ios::out | std::ios::binary).seekp(offset) << bytes;
  const auto records = records_in(folder.path());
  return records.size() == 1 ? records[0].refusal : "not one file";
}

TEST(ElfFile, ALibraryForAnotherMachineIsToldWithBoth) {
  const std::string other = refusal_with_bytes(offsetof(Elf64_Ehdr, e_machine), {'\x16', '\x00'});  // of S/390
  EXPECT_THAT(other, AllOf(HasSubstr("for another kind of machine (ELF machine 22, "), HasSubstr("expected ")));
  EXPECT_THAT(refusal_with_bytes(EI_CLASS, {sizeof(void*) == 8 ? ELFCLASS32 : ELFCLASS64}),
              HasSubstr(sizeof(void*) == 8 ? ", 32 bits" : ", 64 bits"));
}

TEST(ElfFile, OtherElfFilesAreToldByTheirType) {
  const auto offset = static_cast<std::streamoff>(offsetof(Elf64_Ehdr, e_type));
  EXPECT_THAT(refusal_with_bytes(offset, {ET_EXEC, 0}), HasSubstr("a program, not a shared library"));
  EXPECT_THAT(refusal_with_bytes(offset, {ET_REL, 0}), HasSubstr("an object file that is not linked yet"));
  EXPECT_THAT(refusal_with_bytes(offset, {ET_CORE, 0}), HasSubstr("an ELF file of another type"));
}

TEST(ElfFile, ATruncatedCopyIsRefusedWhereverItEnds) {
  TemporaryFolder folder;
  const fs::path good = fixture("good") / "toy.so", copy = folder.path() / "toy.so";
  const auto size = fs::file_size(good);
  Elf64_Ehdr header;
  ASSERT_TRUE(std::ifstream(good, std::ios::binary).read(reinterpret_cast<char*>(&header), sizeof header));
  const auto within_sections = header.e_shoff + header.e_shentsize / 2;
  ASSERT_LT(within_sections, size);
  for (const std::uintmax_t kept : {std::uintmax_t{2}, std::uintmax_t{20}, std::uintmax_t{64}, std::uintmax_t{300},
                                    size / 4, size / 2, std::uintmax_t{within_sections}, size - 1}) {
    fs::copy_file(good, copy, fs::copy_options::overwrite_existing);
    fs::resize_file(copy, kept);
    const auto records = records_in(folder.path());
    ASSERT_EQ(records.size(), 1u);
    const auto expected = kept < sizeof header ? sizeof header : size;
    EXPECT_EQ(records[0].refusal, "the file is truncated: it has " + std::to_string(kept) + " bytes, expected " +
                                      std::to_string(expected) + " at least");
  }
}

TEST(ElfFile, BytesThatAreWrongDoNotHarmTheReader) {
  TemporaryFolder folder;
  const fs::path good = fixture("no_manifest") / "bad.so", copy = folder.path() / "bad.so";
  for (int offset = 16; offset < 64; ++offset) {  // all of the header behind its first mark
    fs::copy_file(good, copy, fs::copy_options::overwrite_existing);
    std::fstream file(copy, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(offset).put('\xff');
    file.close();
    for (const auto& record : records_in(folder.path())) EXPECT_FALSE(record.accepted()) << offset;
  }
}

}  // namespace elf_file_test
}  // namespace rhec
