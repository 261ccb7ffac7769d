#include "heard_messages.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "rhec/logs/cdr/cdr_cursor.hpp"

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

MessageHeader read_header(CdrCursor& cursor) {
  MessageHeader header;
  header.stamp = read_time(cursor);
  header.frame = cursor.text();
  return header;
}

double read_finite(CdrCursor& cursor) {
  const double value = cursor.number(Kind::f64);
  if (!std::isfinite(value)) throw logs::RecordError("found a number that is not finite");
  return value;
}

Position read_pose(CdrCursor& cursor) {
  Position position;
  position.x = read_finite(cursor);
  position.y = read_finite(cursor);
  cursor.skip_numbers(Kind::f64, 5);  // z, and the orientation
  return position;
}

}  // namespace

MessageHeader read_header(std::span<const std::byte> message) {
  CdrCursor cursor(message);
  return read_header(cursor);
}

Positions read_path(std::span<const std::byte> message) {
  constexpr std::size_t least_pose = 68;
  CdrCursor cursor(message);
  Positions path{read_header(cursor), {}};
  for (std::uint64_t left = cursor.length(least_pose); left > 0; --left) {
    read_header(cursor);
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
  return read_time(cursor);
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
