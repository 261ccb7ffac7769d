#include "rhec/logs/cdr/message_log.hpp"

#include <fmt/format.h>

#include <utility>

#include "message_finder.hpp"
#include "rhec/logs/cdr/message_reader.hpp"

namespace rhec::logs {

MessageLog::MessageLog(std::string name, MessageLogOptions options)
    : Log(std::move(name)), options_(std::move(options)) {
  for (const std::filesystem::path& folder : options_.msg_paths)
    if (!std::filesystem::is_directory(folder))
      throw Error(
          fmt::format("--msg-path {}: found no folder; give one that holds packages with .msg files", folder.string()));
}

int MessageLog::add_topic(const std::string& name, const std::string& type, MessageEncoding encoding) {
  std::string full = full_type_name(type);
  for (std::size_t i = 0; i < topics_.size(); ++i)
    if (topics_[i].name == name && topics_[i].type == full) return static_cast<int>(i);
  topics_.push_back({.name = name, .type = std::move(full)});
  encodings_.push_back(std::move(encoding));
  types_.emplace_back();
  return static_cast<int>(topics_.size()) - 1;
}

std::shared_ptr<const MessageType> MessageLog::type_of(int topic) const {
  const auto i = static_cast<std::size_t>(topic);
  if (types_[i]) return types_[i];
  const MessageEncoding& encoding = encodings_[i];
  try {
    if (encoding.serialization == "ros1")
      throw Error(
          "its messages are those of ROS 1; convert the bag by `rosbags-convert` of the Python package 'rosbags'");
    if (encoding.serialization != "cdr")
      throw Error(fmt::format("its messages are in {}; expected cdr", in_quotes(encoding.serialization)));
    types_[i] = find_message(topics_[i].type, encoding.schema_encoding, encoding.schema, options_.msg_paths);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: topic {}: {}", name(), topics_[i].name, error.what()));
  }
  return types_[i];
}

std::unique_ptr<FieldReader> MessageLog::reader(int topic, const FieldRequest& request) const {
  const std::shared_ptr<const MessageType> type = type_of(topic);
  try {
    return std::make_unique<MessageReader>(type, request);
  } catch (const Error& error) {
    throw Error(fmt::format("{}: topic {}: {}", name(), topics_[static_cast<std::size_t>(topic)].name, error.what()));
  }
}

std::vector<std::string> MessageLog::fields_of(const Record& record) const {
  return number_paths(*type_of(record.topic), record.bytes);
}

}  // namespace rhec::logs
