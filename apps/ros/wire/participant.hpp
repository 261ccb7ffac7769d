#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rhec/core/base/clock.hpp"

// What ROS 2 has on the wire, without ROS: topics of DDS with names, types and user data as its nodes expect them.
namespace rhec::apps::ros {

/// How a node takes part.
struct WireOptions {
  std::uint32_t domain = 0;
  std::string interface = "lo";  ///< a network interface, by its name or address; nothing else is listened to
  std::string node = "rhec";     ///< the name that `ros2 node list` shows
  std::size_t id_bytes = 16;     ///< of an endpoint in ros_discovery_info: 24 up to Humble, 16 from Iron on
};

/// A topic of ROS 2.
struct WireTopic {
  std::string name;  ///< "/cmd_vel"
  std::string type;  ///< "geometry_msgs/msg/TwistStamped"
  std::string hash;  ///< "RIHS01_..."; empty: none is told
};

/// Which publishers a reader hears, and which subscribers hear a writer.
enum class Delivery : std::uint8_t {
  latest,  ///< a reader that hears all publishers; what is lost is lost
  sure,    ///< a writer that all subscribers hear; or a reader of reliable publishers alone
  kept     ///< a topic whose last messages are kept for those who come later, as /tf_static
};

/// A message as it came.
struct Arrival {
  int reader = 0;
  std::span<const std::byte> cdr;  ///< empty: it was too large
  Clock::time_point received;      ///< when the network delivered it
};

/// A participant in a domain. Receiving and sending are for one thread; `wake` is for any.
class Participant {
 public:
  /// Throws Error if the interface does not exist, or the domain cannot be joined.
  explicit Participant(const WireOptions& options);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  /// Returns the reader's or writer's index. Throw Error. `depth`: how many messages wait.
  int add_reader(const WireTopic& topic, Delivery delivery, int depth = 32);
  int add_writer(const WireTopic& topic, Delivery delivery);
  /// Tells the nodes of ROS 2 which endpoints are this node's: once all are added.
  void announce();

  /// Waits for messages, or for `wake`, until a time. Returns whether there are any.
  bool wait(Clock::time_point until) noexcept;
  void wake() noexcept;
  /// Hands out what has come, reader by reader, in the order in which they were added.
  void take(const std::function<void(const Arrival&)>& use);
  /// Sends a message. False if it could not be sent at once; it is dropped then.
  bool write(int writer, std::span<const std::byte> cdr);
  /// Waits until what was written has reached those who hear it reliably, at most for a time. Returns whether it has.
  bool flush(int writer, Clock::duration most);
  /// How many readers of others a writer has, or writers a reader.
  int matched_readers(int writer) const noexcept;
  int matched_writers(int reader) const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// The domain that the environment names (ROS_DOMAIN_ID), 0 where it names none. Throws Error for what is none.
std::uint32_t domain_of_environment();
/// "nav_msgs/msg/Odometry" as "nav_msgs::msg::dds_::Odometry_".
std::string dds_type_name(const std::string& type);

}  // namespace rhec::apps::ros
