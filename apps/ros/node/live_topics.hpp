#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../ros_options.hpp"
#include "rhec/logs/cdr/message_log.hpp"
#include "rhec/logs/mapping/signal_map.hpp"

namespace rhec::apps::ros {

/// The topics of a section `signals` as a log that is never at its end: what there is to hear, and how it is read.
class LiveTopics final : public logs::MessageLog {
 public:
  /// `types` is the section `ros.types`; `msg_paths` have the definitions of types that are not built in. Throws Error
  /// for a topic whose type nobody says.
  LiveTopics(const Settings& signals, const Settings& types, std::vector<std::filesystem::path> msg_paths);

  /// What a topic's messages are made of.
  std::shared_ptr<const logs::MessageType> message_type(int topic) const { return type_of(topic); }
  /// Of a topic's type; empty for one that is not built in.
  std::string hash(int topic) const;
  std::optional<logs::Damage> read(const std::vector<bool>& wanted, const Take& take) const override;
  logs::Damage damage_at(const logs::Record& record, const logs::RecordError& error) const override;
};

}  // namespace rhec::apps::ros
