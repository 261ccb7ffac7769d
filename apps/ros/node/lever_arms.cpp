#include "lever_arms.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <optional>

#include "../messages/heard_messages.hpp"
#include "../messages/type_hash.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

using Vector = std::array<double, 3>;
constexpr int deepest = 32;

/// A vector, turned by a quaternion x, y, z, w.
Vector turned(const double* q, const Vector& v) {
  const Vector a{q[0], q[1], q[2]};
  const auto cross = [](const Vector& b, const Vector& c) {
    return Vector{b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]};
  };
  const Vector first = cross(a, v);
  const Vector second = cross(a, {first[0] + q[3] * v[0], first[1] + q[3] * v[1], first[2] + q[3] * v[2]});
  return {v[0] + 2.0 * second[0], v[1] + 2.0 * second[1], v[2] + 2.0 * second[2]};
}

/// Frames by their names, as far as they are known.
using Tree = std::map<std::string, PlaceOfFrame>;

/// Where a frame's origin is in another one; none where nothing connects them.
std::optional<Vector> place_in(const Tree& tree, std::string frame, const std::string& vehicle) {
  Vector place{};
  for (int depth = 0; depth < deepest; ++depth) {
    if (frame == vehicle) return place;
    const auto found = tree.find(frame);
    if (found == tree.end()) return std::nullopt;
    place = turned(found->second.rotation, place);
    for (std::size_t i = 0; i < place.size(); ++i) place[i] += found->second.translation[i];
    frame = found->second.parent;
  }
  return std::nullopt;
}

}  // namespace

void set_lever_arms(Participant& wire, const RosOptions& options, Settings& settings) {
  std::vector<LeverArm> arms = read_lever_arms(options.lever_arms);
  if (arms.empty()) return;
  const char* const type = "tf2_msgs/msg/TFMessage";
  const int reader = wire.add_reader(
      {options.names.static_transforms, type, type_hash(type, logs::builtin_definitions())}, Delivery::kept, 100);
  wire.announce();
  Tree tree;
  const auto end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.patience));
  while (!arms.empty()) {
    if (Clock::now() >= end) {
      std::vector<std::string> known;
      for (const auto& [child, place] : tree) known.push_back(child + " on " + place.parent);
      throw arms.front().key.error(fmt::format(
          "no transform from {} to {} came on {} within {} s; what came is {}", options.frames.vehicle,
          arms.front().frame, options.names.static_transforms, options.patience,
          known.empty() ? "nothing: is a robot_state_publisher there?" : fmt::format("{}", fmt::join(known, ", "))));
    }
    wire.wait(end);
    wire.take([&](const Arrival& arrival) {
      if (arrival.reader != reader || arrival.cdr.empty()) return;
      try {
        for (PlaceOfFrame& place : read_transforms(arrival.cdr)) tree[place.child] = std::move(place);
      } catch (const logs::RecordError& error) {
        throw Error(fmt::format("{}: {}", options.names.static_transforms, error.what()));
      }
    });
    std::erase_if(arms, [&](const LeverArm& arm) {
      const std::optional<Vector> place = place_in(tree, arm.frame, options.frames.vehicle);
      if (!place) return false;
      const double value = arm.sign * (*place)[static_cast<std::size_t>(arm.axis)];
      settings.set("model." + arm.option, Settings::scalar(fmt::format("{}", value), arm.key.origin()));
      return true;
    });
  }
}

}  // namespace rhec::apps::ros
