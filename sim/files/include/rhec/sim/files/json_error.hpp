#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// A value of JSON is of another kind than was asked for, or has no such member.
class RHEC_EXPORT JsonError : public std::runtime_error {
 public:
  explicit JsonError(const std::string& what) : std::runtime_error(what) {}
  ~JsonError() override;
};

/// A text is no JSON.
class RHEC_EXPORT JsonParseError final : public JsonError {
 public:
  enum class Cause {
    syntax,
    large_number,  ///< one that no double can hold
    repeated_key   ///< where these are refused
  };
  JsonParseError(Cause cause, std::size_t byte, std::string key);
  ~JsonParseError() override;
  Cause cause;
  std::size_t byte;  ///< how many had been read by then
  std::string key;   ///< that is repeated
};

}  // namespace rhec::sim
