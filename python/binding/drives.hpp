#pragma once

#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/logs/recorded_log.hpp"

namespace rhec::python {

/// A log with the vehicle's own sensors, and what is asked of it.
struct DriveLog {
  std::string file;
  std::string name;  ///< as results have it; empty: that of the file
  std::vector<std::string> msg_paths, variants;
  sim::HoldOut hold_out;
};

/// `phase` -1: the last of every `every`. Throws Error for numbers that cannot be.
inline sim::HoldOut hold_out_of(int every, int phase) {
  if (every < 0) throw Error("hold_out: expected an integer, at least 0");
  if (every > 0 && phase >= every) throw Error("phase: expected a number below hold_out");
  return {every, phase >= 0 ? phase : every - 1};
}

}  // namespace rhec::python
