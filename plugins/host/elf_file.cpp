#include "elf_file.hpp"

#include <elf.h>
#include <fmt/format.h>
#include <link.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

namespace rhec {
namespace {

using Header = ElfW(Ehdr);
using Segment = ElfW(Phdr);
using Section = ElfW(Shdr);
using Symbol = ElfW(Sym);
using Dynamic = ElfW(Dyn);

namespace fs = std::filesystem;

constexpr const char* kCopyAgain = "copy or build it again";

/// Reads at offsets taken from the file itself, which may have any value.
class Reader {
 public:
  explicit Reader(const fs::path& file) {
    errno = 0;
    stream_.open(file, std::ios::binary);
    if (!stream_.is_open()) problem_ = std::error_code(errno, std::generic_category());
    if (!problem_) size_ = fs::file_size(file, problem_);
  }

  /// Why the file cannot be read; no error if it can.
  const std::error_code& problem() const { return problem_; }
  std::uint64_t size() const { return size_; }

  /// `count` records; none if the file ends before.
  template <class Record>
  std::optional<std::vector<Record>> read(std::uint64_t offset, std::uint64_t count) {
    if (count > size_ / sizeof(Record) || offset > size_ || count * sizeof(Record) > size_ - offset) {
      return std::nullopt;
    }
    std::vector<Record> records(count);
    stream_.clear();
    stream_.seekg(static_cast<std::streamoff>(offset));
    stream_.read(reinterpret_cast<char*>(records.data()), static_cast<std::streamsize>(count * sizeof(Record)));
    if (!stream_) return std::nullopt;
    return records;
  }

 private:
  std::ifstream stream_;
  std::error_code problem_;
  std::uint64_t size_ = 0;
};

/// Where a part of the file ends; saturates instead of overflowing.
std::uint64_t end_of(std::uint64_t offset, std::uint64_t bytes) {
  constexpr auto largest = std::numeric_limits<std::uint64_t>::max();
  return bytes > largest - offset ? largest : offset + bytes;
}

Refusal truncated(const Reader& file, std::uint64_t expected) {
  return {fmt::format("the file is truncated: it has {} bytes, expected {} at least", file.size(), expected),
          kCopyAgain};
}

Refusal damaged(const char* what, std::size_t found, std::size_t expected) {
  return {fmt::format("its ELF header is damaged: {} of {} bytes, expected {}", what, found, expected), kCopyAgain};
}

struct Platform {
  unsigned char bits, order;
  int machine;

  bool operator==(const Platform&) const = default;
};

constexpr Platform kNative {
  sizeof(void*) == 8 ? ELFCLASS64 : ELFCLASS32, __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? ELFDATA2LSB : ELFDATA2MSB,
#if defined(__x86_64__)
      EM_X86_64
#elif defined(__aarch64__)
      EM_AARCH64
#else
      EM_NONE  // unknown here: left to the loader
#endif
};

Platform platform_of(const Header& header) {
  return {header.e_ident[EI_CLASS], header.e_ident[EI_DATA], kNative.machine == EM_NONE ? EM_NONE : header.e_machine};
}

std::string text_of(const Platform& platform) {
  const auto machine = [&]() -> std::string {
    switch (platform.machine) {
      case EM_X86_64:
        return "x86-64";
      case EM_AARCH64:
        return "AArch64";
      case EM_386:
        return "x86";
      case EM_ARM:
        return "ARM";
      case EM_RISCV:
        return "RISC-V";
      default:
        return fmt::format("ELF machine {}", platform.machine);
    }
  };
  return fmt::format("{}, {} bits, {}-endian", machine(), platform.bits == ELFCLASS64 ? 64 : 32,
                     platform.order == ELFDATA2LSB ? "little" : "big");
}

/// Why the path is not a regular file; empty if it is one. Opening a pipe would wait for a writer.
Refusal why_no_file(const fs::path& path) {
  std::error_code problem;
  const fs::file_status status = fs::status(path, problem);
  if (fs::is_regular_file(status)) return {};
  if (fs::is_directory(status)) {
    return {"it is a directory, not a library", "search in it by naming it on its own, or give it another name"};
  }
  if (status.type() == fs::file_type::not_found) {
    std::error_code ignored;
    return {fmt::format("it is a symbolic link to {}, where nothing is", fs::read_symlink(path, ignored).string()),
            "link it to the plugin, or remove it"};
  }
  if (problem) return {fmt::format("it cannot be looked at: {}", problem.message()), "mend that, or remove it"};
  return {"it is a pipe, a socket or a device, not a file", "remove it"};
}

/// True for a position-independent executable, which has the ELF type of a shared library.
bool is_program(Reader& file, const std::vector<Segment>& segments) {
  for (const Segment& segment : segments) {
    if (segment.p_type != PT_DYNAMIC) continue;
    const auto entries = file.read<Dynamic>(segment.p_offset, segment.p_filesz / sizeof(Dynamic));
    if (!entries) continue;
    for (const Dynamic& entry : *entries) {
      if (entry.d_tag == DT_FLAGS_1 && (entry.d_un.d_val & DF_1_PIE) != 0) return true;
    }
  }
  return false;
}

/// The definition of a data symbol in the dynamic symbol table; none if there is none.
std::optional<Symbol> find_symbol(Reader& file, const std::vector<Section>& sections, const std::string& name) {
  for (const Section& section : sections) {
    if (section.sh_type != SHT_DYNSYM || section.sh_link >= sections.size()) continue;
    const Section& texts = sections[section.sh_link];
    const auto symbols = file.read<Symbol>(section.sh_offset, section.sh_size / sizeof(Symbol));
    const auto names = file.read<char>(texts.sh_offset, texts.sh_size);
    if (!symbols || !names) continue;
    for (const Symbol& symbol : *symbols) {
      if (symbol.st_shndx == SHN_UNDEF || (symbol.st_info & 0xf) != STT_OBJECT) continue;
      if (symbol.st_name >= names->size() || names->size() - symbol.st_name <= name.size()) continue;
      if (std::memcmp(names->data() + symbol.st_name, name.c_str(), name.size() + 1) == 0) return symbol;
    }
  }
  return std::nullopt;
}

}  // namespace

Refusal why_not_loadable(const fs::path& path, const std::string& symbol, std::size_t symbol_size) {
  if (Refusal refusal = why_no_file(path); !refusal.empty()) return refusal;
  Reader file(path);
  if (file.problem()) {
    return {fmt::format("the file cannot be read: {}", file.problem().message()),
            "let the user who runs this read it (chmod +r), and enter its directory"};
  }
  if (file.size() == 0) return {"the file is empty", kCopyAgain};
  const auto start = file.read<char>(0, std::min<std::uint64_t>(file.size(), SELFMAG));
  if (!start || std::memcmp(start->data(), ELFMAG, start->size()) != 0) {
    return {"it is not an ELF file, so no shared library", "put the library that was meant in its place, or remove it"};
  }
  const auto headers = file.read<Header>(0, 1);
  if (!headers) return truncated(file, sizeof(Header));
  const Header& header = headers->front();
  const Platform platform = platform_of(header);
  if (platform != kNative) {
    return {fmt::format("it is for another kind of machine ({}), expected {}", text_of(platform), text_of(kNative)),
            "build it for this one"};
  }
  constexpr const char* link_as_module = "link it as a shared library (rhec_add_plugin does)";
  if (header.e_type != ET_DYN) {
    const char* type = header.e_type == ET_EXEC  ? "a program"
                       : header.e_type == ET_REL ? "an object file that is not linked yet"
                                                 : "an ELF file of another type";
    return {fmt::format("it is {}, not a shared library", type), link_as_module};
  }

  // A library without a section table can still be loaded; its symbol is looked up after that.
  const bool has_sections = header.e_shoff != 0;
  if (header.e_phentsize != sizeof(Segment)) return damaged("segments", header.e_phentsize, sizeof(Segment));
  if (has_sections && header.e_shentsize != sizeof(Section)) {
    return damaged("sections", header.e_shentsize, sizeof(Section));
  }
  // Linkers put the section table last, so this is usually the size of the whole file.
  std::uint64_t expected = end_of(header.e_phoff, header.e_phnum * sizeof(Segment));
  if (has_sections) expected = std::max(expected, end_of(header.e_shoff, header.e_shnum * sizeof(Section)));
  const auto segments = file.read<Segment>(header.e_phoff, header.e_phnum);
  const auto sections = file.read<Section>(header.e_shoff, has_sections ? header.e_shnum : 0);
  if (!segments || !sections) return truncated(file, expected);
  for (const Segment& segment : *segments) {
    if (segment.p_type == PT_LOAD) expected = std::max(expected, end_of(segment.p_offset, segment.p_filesz));
  }
  for (const Section& section : *sections) {
    const bool takes_room = section.sh_type != SHT_NULL && section.sh_type != SHT_NOBITS;
    if (takes_room) expected = std::max(expected, end_of(section.sh_offset, section.sh_size));
  }
  if (file.size() < expected) return truncated(file, expected);

  if (is_program(file, *segments)) return {"it is a program, not a shared library", link_as_module};
  if (!has_sections) return {};
  const auto found = find_symbol(file, *sections, symbol);
  if (!found) return no_manifest(symbol);
  if (found->st_size < symbol_size) {
    return {fmt::format("its symbol {} has {} bytes, expected {} at least, so it is no manifest", symbol,
                        found->st_size, symbol_size),
            "make it by RHEC_PLUGIN"};
  }
  return {};
}

Refusal no_manifest(const std::string& symbol) {
  return {fmt::format("it is a library, but no plugin of rhec: it exports no data symbol {}", symbol),
          "make a plugin of it by RHEC_PLUGIN, or put it elsewhere"};
}

}  // namespace rhec
