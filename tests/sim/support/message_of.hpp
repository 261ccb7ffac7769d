#pragma once

#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "rhec/core/base/error.hpp"

namespace rhec::sim {

#define EXPECT_CONTAINS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

/// What the Error says that a call throws.
inline std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace rhec::sim
