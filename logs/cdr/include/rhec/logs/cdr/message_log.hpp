#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// How logs of messages are opened.
struct MessageLogOptions {
  std::vector<std::filesystem::path> msg_paths;  ///< folders of packages with .msg or .idl files
  std::string name = {};                         ///< what the user calls the file; empty: its path
};

/// How the messages of a topic are written.
struct MessageEncoding {
  std::string serialization;    ///< "cdr"
  std::string schema_encoding;  ///< "ros2msg", "ros2idl"; empty: the file does not define the type
  std::string schema;
  bool operator==(const MessageEncoding&) const = default;
};

/// A log of messages in CDR, whatever file they lie in.
class RHEC_EXPORT MessageLog : public Log {
 public:
  std::unique_ptr<FieldReader> reader(int topic, const FieldRequest& request) const override;
  std::vector<std::string> fields_of(const Record& record) const override;

 protected:
  MessageLog(std::string name, MessageLogOptions options);
  /// Adds a topic, or finds the one that has this name and type. Returns its index, and that of the encoding among the
  /// topic's: a type may be defined anew while it is recorded.
  struct Place {
    int topic = 0, form = 0;
  };
  Place add_topic(const std::string& name, const std::string& type, MessageEncoding encoding);
  /// What the messages of a topic are made of. Throws Error for a type that nobody defines.
  std::shared_ptr<const MessageType> type_of(int topic, int form = 0) const;

 private:
  MessageLogOptions options_;
  struct Form {
    MessageEncoding encoding;
    mutable std::shared_ptr<const MessageType> type = {};  ///< once it is asked for
  };
  std::vector<std::vector<Form>> forms_;  ///< by topic
};

}  // namespace rhec::logs
