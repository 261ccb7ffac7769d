#pragma once

// The blocking strategies, through their plugins, against METHOD's rules.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec::testing {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

inline std::shared_ptr<Blocking> make(const std::string& name, const std::string& yaml = "") {
  static const Host host({TEMPLATE_PLUGINS});
  return host.make_blocking(name, parse_yaml(yaml, "test"));
}

inline std::shared_ptr<Blocking> structured(int size, int overlap, const std::string& more = "") {
  return make("structured", "{size: " + std::to_string(size) + ", overlap: " + std::to_string(overlap) + more + "}");
}

/// What a strategy says of the window of `intervals` that ends at step k.
struct View {
  std::int64_t first_start;
  std::vector<std::int64_t> borders;  ///< absolute starts of blocks behind the window's first interval

  bool operator==(const View&) const = default;
};

inline View view(const Blocking& blocking, std::int64_t k, int intervals) {
  const std::int64_t first = k - intervals;
  std::vector<std::uint8_t> begins(intervals + 1, 7);  // rubbish, and one behind the end
  View result{blocking.starts({.first = first, .intervals = intervals}, begins.data()), {}};
  EXPECT_EQ(begins[0], 1);
  EXPECT_EQ(begins[intervals], 7) << "written behind the end";
  EXPECT_LE(result.first_start, first);
  EXPECT_GE(result.first_start, 0);
  for (int i = 1; i < intervals; ++i) {
    EXPECT_LE(begins[i], 1);
    if (begins[i]) result.borders.push_back(first + i);
  }
  return result;
}

/// What is said of options that make no sense.
inline std::string mistake(const std::string& name, const std::string& yaml) {
  return error_of([&] { make(name, yaml); });
}

}  // namespace rhec::testing
