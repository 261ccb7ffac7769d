#pragma once

#include <cstddef>
#include <functional>
#include <string_view>

namespace rhec {

/// Whether this machine has all that kernels of an instruction set ("generic", "avx2", "avx512") are compiled for, and
/// not only what is in its name (RHEC_WIDE_FLAGS in cmake/RhecModel.cmake).
inline bool machine_runs([[maybe_unused]] std::string_view set) noexcept {
  if (set == "generic") return true;
#if defined(__x86_64__)
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (set == "avx2") return has_avx2;
  if (set == "avx512")
    return has_avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512vl");
#endif
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
