#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"

namespace rhec::apps::ros {

/// Writes messages by the definition of their type: the numbers that are given by paths, as `logs::MessageReader` reads
/// them ("position[left_wheel]", "orientation.z"), and zeros. A list is as long as the paths into it ask for; one whose
/// items have names gets these names.
class MessageWriter {
 public:
  explicit MessageWriter(std::shared_ptr<const logs::MessageType> type);

  /// Forgets all numbers.
  void clear();
  void set(const std::string& path, double value) { values_[path] = value; }
  /// What is there already, 0 where nothing is.
  void add(const std::string& path, double value) { values_[path] += value; }
  bool empty() const noexcept { return values_.empty(); }
  /// The message; a header has this stamp and frame. Valid until the next call.
  std::span<const std::byte> write(logs::Stamp when, std::string_view frame);

 private:
  void write_structure(int index, const std::string& prefix);
  void write_item(const logs::FieldDefinition& field, const std::string& path);
  void write_number(logs::Kind kind, double value);
  std::vector<std::string> items_of(const std::string& path) const;

  std::shared_ptr<const logs::MessageType> type_;
  std::map<std::string, double> values_;
  logs::CdrWriter message_;
  logs::Stamp stamp_ = 0;
  std::string_view frame_;
  std::vector<std::string> names_;  ///< of items, in the structure at hand
};

}  // namespace rhec::apps::ros
