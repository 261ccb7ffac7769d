#pragma once

#include <string>

namespace rhec {

/// Why a file is not accepted as a plugin.
struct Refusal {
  std::string reason;  ///< what was found and what was expected; empty if the file is fine
  std::string remedy;  ///< what to do

  bool empty() const noexcept { return reason.empty(); }
};

}  // namespace rhec
