#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/model_functions.hpp"

// What the program of rhec_add_model_kernels is made of; no library includes it.

namespace rhec {

/// Writes a text aside and renames it, so that none is half-written. A file that has this text is left alone, with its
/// time, so that nothing is compiled anew. Throws Error with the file.
inline void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ifstream in(file, std::ios::binary);
  if (in && std::string(std::istreambuf_iterator<char>(in), {}) == text) return;
  in.close();
  const std::filesystem::path aside = file.string() + ".new";
  std::ofstream out(aside, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw Error(aside.string() + ": cannot be written; is there room on the disk, and may you write there?");
  std::filesystem::rename(aside, file);
}

/// What a program that writes a formula's kernels does: `arguments` are a folder and instruction sets. Throws Error,
/// and what the file system throws.
inline void write_model_code_to(const VehicleGraph& vehicle, const char* prefix, const char* formula,
                                const std::vector<std::string>& arguments) {
  if (arguments.size() < 2) throw Error("expected a folder and instruction sets");
  const std::filesystem::path folder = arguments[0];
  std::filesystem::create_directories(folder);
  const ModelCode code = write_model_code(vehicle, prefix, formula, {arguments.begin() + 1, arguments.end()});
  write_text(folder / "kernels.cpp", code.kernels);
  write_text(folder / "table.cpp", code.table);
}

}  // namespace rhec
