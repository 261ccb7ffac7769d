// What libFuzzer calls, for the target that the macro TARGET names.
#include <cstddef>
#include <cstdint>

#include "fuzz/targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t count) {
  rhec::fuzz::TARGET({reinterpret_cast<const char*>(bytes), count});
  return 0;
}
