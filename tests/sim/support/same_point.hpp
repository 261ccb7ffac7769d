#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "rhec/core/ocp/ocp.hpp"

namespace rhec::sim {

/// The first difference in bits, none for NaN and NaN.
inline ::testing::AssertionResult same_bits(const char* what, int stage, const double* a, const double* b, int count) {
  for (int j = 0; j < count; ++j)
    if (std::bit_cast<std::uint64_t>(a[j]) != std::bit_cast<std::uint64_t>(b[j]) &&
        !(std::isnan(a[j]) && std::isnan(b[j])))
      return ::testing::AssertionFailure() << fmt::format("{} {}[{}]: {} is not {}", what, stage, j, a[j], b[j]);
  return ::testing::AssertionSuccess();
}

inline void expect_same_point(const Ocp& ocp, const Iterate& a, const Iterate& b) {
  for (int i = 0; i <= ocp.intervals(); ++i) {
    const int states = ocp.state_count(i);
    ASSERT_TRUE(same_bits("state", i, a.state(i), b.state(i), states));
    ASSERT_TRUE(same_bits("costate", i, a.costate(i), b.costate(i), states));
    ASSERT_TRUE(same_bits("state bound", i, a.state_bound(i), b.state_bound(i), states));
    if (i == ocp.intervals()) break;
    ASSERT_TRUE(same_bits("control", i, a.control(i), b.control(i), ocp.control_count(i)));
    ASSERT_TRUE(same_bits("control bound", i, a.control_bound(i), b.control_bound(i), ocp.control_count(i)));
  }
}

}  // namespace rhec::sim
