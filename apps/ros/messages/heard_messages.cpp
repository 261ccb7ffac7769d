#include "heard_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace rhec::apps::ros {
namespace {

using logs::CdrCursor;
using logs::Kind;

constexpr logs::Stamp second = 1'000'000'000;

logs::Stamp read_time(CdrCursor& cursor) {
  const auto seconds = static_cast<logs::Stamp>(cursor.number(Kind::i32));
  const auto rest = static_cast<logs::Stamp>(cursor.number(Kind::u32));
  if (rest >= second) throw logs::RecordError("found a stamp of more than 999999999 nanoseconds");
  return seconds * second + rest;
}

double read_finite(CdrCursor& cursor) {
  const double value = cursor.number(Kind::f64);
  if (!std::isfinite(value)) throw logs::RecordError("found a number that is not finite");
  return value;
}

Position read_pose(CdrCursor& cursor) {
  Position position;
  position.x = read_coordinate(cursor, Kind::f64);
  position.y = read_coordinate(cursor, Kind::f64);
  cursor.skip_numbers(Kind::f64, 5);  // z, and the orientation
  return position;
}

}  // namespace

MessageHeader read_header(CdrCursor& cursor) {
  MessageHeader header;
  header.stamp = read_time(cursor);
  header.frame = cursor.text();
  return header;
}

double read_coordinate(CdrCursor& cursor, Kind kind) {
  constexpr double farthest = 1e8;  // [m]
  const double value = cursor.number(kind);
  if (!(std::abs(value) <= farthest))
    throw logs::RecordError(
        fmt::format("found a coordinate of {}, expected a number of at most {:g} m", value, farthest));
  return value;
}

MessageHeader read_header(std::span<const std::byte> message) {
  CdrCursor cursor(message);
  return read_header(cursor);
}

Positions read_path(std::span<const std::byte> message) {
  constexpr std::size_t least_pose = 68;
  CdrCursor cursor(message);
  Positions path{read_header(cursor), {}};
  for (std::uint64_t left = cursor.length(least_pose); left > 0; --left) {
    const MessageHeader own = read_header(cursor);
    if (!own.frame.empty() && own.frame != path.header.frame)
      throw logs::RecordError(fmt::format("found a pose in the frame {} on a path in the frame {}",
                                          logs::in_quotes(own.frame), logs::in_quotes(path.header.frame)));
    path.places.push_back(read_pose(cursor));
  }
  return path;
}

Positions read_pose_array(std::span<const std::byte> message) {
  constexpr std::size_t least_pose = 56;
  CdrCursor cursor(message);
  Positions poses{read_header(cursor), {}};
  for (std::uint64_t left = cursor.length(least_pose); left > 0; --left) poses.places.push_back(read_pose(cursor));
  return poses;
}

std::vector<PlaceOfFrame> read_transforms(std::span<const std::byte> message) {
  constexpr std::size_t least_transform = 72;
  CdrCursor cursor(message);
  std::vector<PlaceOfFrame> transforms;
  for (std::uint64_t left = cursor.length(least_transform); left > 0; --left) {
    PlaceOfFrame transform;
    transform.parent = read_header(cursor).frame;
    transform.child = cursor.text();
    for (double& value : transform.translation) value = read_finite(cursor);
    for (double& value : transform.rotation) value = read_finite(cursor);
    transforms.push_back(std::move(transform));
  }
  return transforms;
}

bool read_flag(std::span<const std::byte> message) { return CdrCursor(message).number(Kind::boolean) != 0.0; }

logs::Stamp read_clock(std::span<const std::byte> message) {
  CdrCursor cursor(message);
  const logs::Stamp time = read_time(cursor);
  if (time < 0) throw logs::RecordError("found a time before 1970");
  return time;
}

FixQuality read_fix_quality(std::span<const std::byte> message) {
  CdrCursor cursor(message);
  read_header(cursor);
  FixQuality quality;
  quality.has_fix = cursor.number(Kind::i8) >= 0.0;
  cursor.skip_numbers(Kind::u16, 1);
  cursor.skip_numbers(Kind::f64, 3);
  double variances[9];
  for (double& variance : variances) variance = cursor.number(Kind::f64);
  const bool is_known = cursor.number(Kind::u8) != 0.0;
  const double largest = std::max(variances[0], variances[4]);  // east, north
  if (is_known && largest >= 0.0) quality.sigma = std::sqrt(largest);
  return quality;
}

}  // namespace rhec::apps::ros
