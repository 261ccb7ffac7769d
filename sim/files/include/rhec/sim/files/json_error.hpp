#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// A JSON value has the wrong kind or lacks a member.
class RHEC_EXPORT JsonError : public std::runtime_error {
 public:
  explicit JsonError(const std::string& what) : std::runtime_error(what) {}
  ~JsonError() override;
};

/// A text is not valid JSON.
class RHEC_EXPORT JsonParseError final : public JsonError {
 public:
  enum class Cause {
    syntax,
    large_number,  ///< beyond the range of double
    repeated_key,  ///< if repeated keys are refused
    nesting        ///< more than `most_levels` arrays and objects within each other
  };
  JsonParseError(Cause cause, std::size_t byte, std::string key);
  ~JsonParseError() override;
  static constexpr std::size_t most_levels = 200;
  Cause cause;
  std::size_t byte;  ///< bytes read so far
  std::string key;   ///< the repeated key
};

}  // namespace rhec::sim
