#pragma once

#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/model_functions.hpp"

// What the program of rhec_add_model_kernels is made of; no library includes it.

namespace rhec {

/// Writes a text aside and renames it, so that none is half-written. Throws Error with the file.
inline void write_text(const std::filesystem::path& file, const std::string& text) {
  const std::filesystem::path aside = file.string() + ".new";
  std::ofstream out(aside, std::ios::binary);
  out << text;
  out.close();
  if (!out) throw Error(aside.string() + ": cannot be written; is there room on the disk, and may you write there?");
  std::filesystem::rename(aside, file);
}

/// The main function of a program that writes a formula's kernels: `arguments` are a folder and instruction sets. What
/// `make_vehicle` throws is told on standard error. Returns the exit code.
template <class MakeVehicle>
int write_model_code_to(const MakeVehicle& make_vehicle, const char* prefix, const char* formula,
                        const std::vector<std::string>& arguments) {
  try {
    if (arguments.size() < 2) throw Error("expected a folder and instruction sets");
    const std::filesystem::path folder = arguments[0];
    std::filesystem::create_directories(folder);
    const ModelCode code = write_model_code(make_vehicle(), prefix, formula, {arguments.begin() + 1, arguments.end()});
    write_text(folder / "kernels.cpp", code.kernels);
    write_text(folder / "table.cpp", code.table);
    return 0;
  } catch (const std::exception& mistake) {
    std::fprintf(stderr, "error: the formula %s: %s\n", formula, mistake.what());
    return 1;
  }
}

}  // namespace rhec
