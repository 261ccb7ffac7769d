#include "elf_file.hpp"

#include <elf.h>
#include <fmt/format.h>
#include <link.h>

#include <cstring>
#include <fstream>
#include <optional>
#include <vector>

namespace rhec {
namespace {

using Header = ElfW(Ehdr);
using Segment = ElfW(Phdr);
using Section = ElfW(Shdr);
using Symbol = ElfW(Sym);

/// Reads at offsets that the file itself gives, and so may be anything.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& file) : stream_(file, std::ios::binary) {
    std::error_code problem;
    size_ = std::filesystem::file_size(file, problem);
    if (problem) size_ = 0;
  }

  bool is_open() const { return stream_.is_open(); }
  bool holds(std::uint64_t offset, std::uint64_t bytes) const { return offset <= size_ && bytes <= size_ - offset; }

  /// `count` records; none where the file ends before.
  template <class Record>
  std::optional<std::vector<Record>> read(std::uint64_t offset, std::uint64_t count) {
    if (count > size_ / sizeof(Record) || !holds(offset, count * sizeof(Record))) return std::nullopt;
    std::vector<Record> records(count);
    stream_.clear();
    stream_.seekg(static_cast<std::streamoff>(offset));
    stream_.read(reinterpret_cast<char*>(records.data()), static_cast<std::streamsize>(count * sizeof(Record)));
    if (!stream_) return std::nullopt;
    return records;
  }

 private:
  std::ifstream stream_;
  std::uint64_t size_ = 0;
};

constexpr unsigned char kNativeClass = sizeof(void*) == 8 ? ELFCLASS64 : ELFCLASS32;
constexpr unsigned char kNativeOrder = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? ELFDATA2LSB : ELFDATA2MSB;
#if defined(__x86_64__)
constexpr int kNativeMachine = EM_X86_64;
#elif defined(__aarch64__)
constexpr int kNativeMachine = EM_AARCH64;
#else
constexpr int kNativeMachine = EM_NONE;  // not known: left to the loader
#endif

bool is_for_this_machine(const Header& header) {
  return header.e_ident[EI_CLASS] == kNativeClass && header.e_ident[EI_DATA] == kNativeOrder &&
         (kNativeMachine == EM_NONE || header.e_machine == kNativeMachine);
}

/// The definition of a data symbol in the table of symbols that a library shows; none where it is not there.
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

std::string why_not_loadable(const std::filesystem::path& path, const std::string& symbol, std::size_t symbol_size) {
  constexpr const char* truncated = "the file is truncated; copy or build it again";
  Reader file(path);
  if (!file.is_open()) return "the file cannot be read; check its permissions";
  if (!file.holds(0, 1)) return "the file is empty; copy or build it again";
  const auto start = file.read<char>(0, SELFMAG);
  if (!start || std::memcmp(start->data(), ELFMAG, SELFMAG) != 0) return "not an ELF file, so no shared library";
  const auto headers = file.read<Header>(0, 1);
  if (!headers) return truncated;
  const Header& header = headers->front();
  if (!is_for_this_machine(header)) return "a library for another kind of machine";
  if (header.e_type != ET_DYN) return "an ELF file, but not a shared library";

  if (header.e_phentsize != sizeof(Segment)) return "not a well-formed ELF file";
  const auto segments = file.read<Segment>(header.e_phoff, header.e_phnum);
  if (!segments) return truncated;
  for (const Segment& segment : *segments) {
    if (segment.p_type == PT_LOAD && !file.holds(segment.p_offset, segment.p_filesz)) return truncated;
  }

  // A linker puts the table of sections last; a library without one can be loaded still, and is asked afterwards.
  if (header.e_shoff == 0) return {};
  if (header.e_shentsize != sizeof(Section)) return "not a well-formed ELF file";
  const auto sections = file.read<Section>(header.e_shoff, header.e_shnum);
  if (!sections) return truncated;
  const auto found = find_symbol(file, *sections, symbol);
  if (!found) {
    return fmt::format("not a plugin of rhec: it exports no data symbol {}; one is made by RHEC_PLUGIN", symbol);
  }
  if (found->st_size < symbol_size) return fmt::format("its symbol {} is too small to be a manifest", symbol);
  return {};
}

}  // namespace rhec
