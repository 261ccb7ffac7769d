#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace rhec::sim {

/// The digest of FIPS 180-4, as eight words.
std::array<std::uint32_t, 8> sha256(std::string_view text);

}  // namespace rhec::sim
