#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "rhec/core/base/clock.hpp"

struct ddsi_serdata;
struct ddsi_sertype;

// Types of Cyclone DDS whose messages are the bytes on the wire: what they mean is known to who reads them
// (rhec/logs/cdr). Cyclone reserves this interface for those who bring types of their own.
namespace rhec::apps::ros {

/// A message larger than this is refused before it is copied [bytes].
inline constexpr std::size_t most_message_bytes = std::size_t{16} << 20;

/// A new type, "nav_msgs::msg::dds_::Odometry_". The caller has the one reference, which a topic takes over.
ddsi_sertype* make_raw_type(const std::string& name);

/// A message of such a type; `cdr` begins with the four bytes that say how it is encoded. The caller has the one
/// reference, which a write takes over. Throws std::bad_alloc.
ddsi_serdata* make_raw_message(const ddsi_sertype* type, std::span<const std::byte> cdr);

/// What lies in a message that was received.
struct RawMessage {
  std::span<const std::byte> cdr;  ///< empty: it was too large
  Clock::time_point received;      ///< when it came from the network
};
RawMessage look_into(const ddsi_serdata* message);

struct MessageRelease {
  void operator()(ddsi_serdata* message) const noexcept;
};
using MessageReference = std::unique_ptr<ddsi_serdata, MessageRelease>;

}  // namespace rhec::apps::ros
