#include "message_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

bool is_index(const std::string& item) {
  return !item.empty() && std::ranges::all_of(item, [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

MessageWriter::MessageWriter(std::shared_ptr<const logs::MessageType> type) : type_(std::move(type)) {}

void MessageWriter::clear() { values_.clear(); }

std::span<const std::byte> MessageWriter::write(logs::Stamp when, std::string_view frame) {
  stamp_ = when;
  frame_ = frame;
  message_.clear();
  write_structure(0, "");
  return message_.bytes();
}

/// What is in brackets behind a path, in the order of the paths.
std::vector<std::string> MessageWriter::items_of(const std::string& path) const {
  std::vector<std::string> items;
  const std::string begin = path + "[";
  for (auto at = values_.lower_bound(begin); at != values_.end() && at->first.starts_with(begin); ++at) {
    std::string item = at->first.substr(begin.size(), at->first.find(']', begin.size()) - begin.size());
    if (std::ranges::find(items, item) == items.end()) items.push_back(std::move(item));
  }
  return items;
}

void MessageWriter::write_structure(int index, const std::string& prefix) {
  const logs::StructureDefinition& structure = type_->structures[static_cast<std::size_t>(index)];
  if (structure.name == "std_msgs/msg/Header") return message_.header(stamp_, frame_);
  if (structure.fields.empty()) return message_.u8(0);
  // The names of items are those that any of the lists is asked for.
  std::vector<std::string> names;
  for (const logs::FieldDefinition& field : structure.fields)
    for (const std::string& item : items_of(prefix + field.name))
      if (field.shape == logs::Shape::sequence && !is_index(item) && std::ranges::find(names, item) == names.end())
        names.push_back(item);
  for (const logs::FieldDefinition& field : structure.fields) {
    const std::string path = prefix + field.name;
    if (field.shape == logs::Shape::single) {
      write_item(field, path);
    } else if (field.shape == logs::Shape::array) {
      for (std::uint64_t i = 0; i < field.length; ++i) write_item(field, fmt::format("{}[{}]", path, i));
    } else if (field.kind == logs::Kind::text && field.name == "name") {
      message_.length(names.size());
      for (const std::string& name : names) message_.text(name);
    } else {
      const std::vector<std::string> items = items_of(path);
      const bool is_named = !items.empty() && !is_index(items.front());
      std::size_t count = is_named ? names.size() : 0;
      if (!is_named)
        for (const std::string& item : items) count = std::max<std::size_t>(count, std::stoul(item) + 1);
      message_.length(count);
      for (std::size_t i = 0; i < count; ++i)
        write_item(field, is_named ? fmt::format("{}[{}]", path, names[i]) : fmt::format("{}[{}]", path, i));
    }
  }
}

void MessageWriter::write_item(const logs::FieldDefinition& field, const std::string& path) {
  if (field.kind == logs::Kind::structure) return write_structure(field.structure, path + ".");
  if (field.kind == logs::Kind::text) return message_.text("");
  const auto found = values_.find(path);
  write_number(field.kind, found == values_.end() ? 0.0 : found->second);
}

void MessageWriter::write_number(logs::Kind kind, double value) {
  switch (kind) {
    case logs::Kind::boolean:
      return message_.flag(value != 0.0);
    case logs::Kind::u8:
      return message_.u8(static_cast<std::uint8_t>(value));
    case logs::Kind::i8:
      return message_.i8(static_cast<std::int8_t>(value));
    case logs::Kind::u16:
      return message_.u16(static_cast<std::uint16_t>(value));
    case logs::Kind::i32:
      return message_.i32(static_cast<std::int32_t>(value));
    case logs::Kind::u32:
      return message_.u32(static_cast<std::uint32_t>(value));
    case logs::Kind::f32:
      return message_.f32(static_cast<float>(value));
    case logs::Kind::f64:
      return message_.f64(value);
    default:
      throw Error(fmt::format("a message of {} cannot be written: it has 64-bit or 16-bit integers or wide texts",
                              type_->name));
  }
}

}  // namespace rhec::apps::ros
