#pragma once

#include <cstddef>
#include <functional>
#include <string_view>

namespace rhec {

/// An instruction set that kernels are compiled for, and whether this machine has all that they are compiled with, and
/// not only what is in its name (RHEC_WIDE_FLAGS in cmake/RhecModel.cmake).
struct InstructionSet {
  std::string_view name;
  bool (*is_here)() noexcept;
};

/// Those of this kind of processor, slowest first: the same as RHEC_WIDE_SETS in cmake/RhecModel.cmake, after the
/// generic one. A machine that runs one of them runs those before it.
inline constexpr InstructionSet instruction_sets[] = {
    {"generic", []() noexcept { return true; }},
#if defined(__x86_64__)
    {"avx2", []() noexcept { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }},
    {"avx512",
     []() noexcept {
       return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("avx512f") &&
              __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
              __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
     }},
#elif defined(__aarch64__)
    {"neon", []() noexcept { return true; }},  // every processor of 64-bit ARM has it
#endif
};

/// Whether this machine runs kernels of the instruction set of that name.
inline bool machine_runs(std::string_view name) noexcept {
  for (const InstructionSet& set : instruction_sets)
    if (set.name == name) return set.is_here();
  return false;
}

/// How many of some sets, slowest first, this machine runs; `name_of` tells the name of one.
template <class Sets, class NameOf>
std::size_t runnable_sets(const Sets& sets, NameOf name_of) noexcept {
  std::size_t count = 0;
  for (const auto& set : sets) {
    if (!machine_runs(std::invoke(name_of, set))) break;
    ++count;
  }
  return count;
}

}  // namespace rhec
