#pragma once

#include <string>

namespace rhec {

/// Why a file is not taken as a plugin.
struct Refusal {
  std::string reason;  ///< what was found and what was expected; empty: nothing speaks against it
  std::string remedy;  ///< what to do

  bool empty() const noexcept { return reason.empty(); }
};

}  // namespace rhec
