#pragma once

#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/study/sweep.hpp"
#include "support/error_of.hpp"

// Sweeps as texts, for tests that are told the folder of scenarios as SCENARIOS.
namespace rhec::sim {

inline const Host& host() {
  static const Host found;
  return found;
}

/// Of a text that stands for a file beside the scenarios.
inline Sweep sweep_of(const std::string& text) {
  return Sweep(parse_yaml(text, std::string(SCENARIOS) + "/sweep.yaml"));
}
inline Sweep grid_of(const std::string& grid) { return sweep_of("scenario: paper/figure8.yaml\ngrid:\n" + grid); }

/// What the error says, without the folder; empty where there is none.
template <class Call>
std::string mistake_of(const Call& call) {
  std::string text = error_of(call);
  const std::string folder = std::string(SCENARIOS) + "/";
  for (std::size_t at = text.find(folder); at != std::string::npos; at = text.find(folder))
    text.erase(at, folder.size());
  return text;
}
inline std::string mistake_in(const std::string& text) {
  return mistake_of([&] {
    const Sweep sweep = sweep_of(text);
    sweep.check_values(host());
    sweep.identities();
  });
}
inline std::string mistake_in_grid(const std::string& grid) {
  return mistake_in("scenario: paper/figure8.yaml\ngrid:\n" + grid);
}

}  // namespace rhec::sim
