#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "refusal.hpp"

namespace rhec {

/// Why a file should not be handed to the loader as a plugin; empty if it may be: it is a whole ELF shared library for
/// this machine that defines a data symbol `symbol` of at least `symbol_size` bytes. Only reads the file. The loader
/// itself does not check that a library is whole: it maps what is missing, and the process dies on the first access.
Refusal why_not_loadable(const std::filesystem::path& file, const std::string& symbol, std::size_t symbol_size);

/// What is said of a library without the data symbol of a manifest.
Refusal no_manifest(const std::string& symbol);

}  // namespace rhec
