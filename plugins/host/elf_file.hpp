#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "refusal.hpp"

namespace rhec {

/// Why a file must not be passed to the loader as a plugin; empty if it is a complete ELF shared library for this
/// machine that defines a data symbol `symbol` of at least `symbol_size` bytes. Only reads the file. The loader itself
/// does not check that a library is complete: it maps missing parts too, and the process crashes on the first access.
Refusal why_not_loadable(const std::filesystem::path& file, const std::string& symbol, std::size_t symbol_size);

/// The refusal of a library without the manifest's data symbol.
Refusal no_manifest(const std::string& symbol);

}  // namespace rhec
