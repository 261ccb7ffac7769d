#pragma once

#include <string>

#include <gtest/gtest.h>

#include "rhec/core/base/error.hpp"

#define EXPECT_CONTAINS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

namespace rhec {

/// What the Error says that a call throws; empty where it throws none.
template <class Call>
std::string error_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

}  // namespace rhec
