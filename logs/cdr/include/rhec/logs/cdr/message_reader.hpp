#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::logs {

/// Reads numbers out of messages in CDR, by the definition of their type. Fields are paths:
/// "twist.twist.linear.x", "pose.covariance[0]", "position[rear_left]": the item that the message's list of names puts
/// there (JointState), and "transforms[base_link].transform.translation.x": the item whose own name, id or child frame
/// this is. What no field asks for is passed over, and behind the last field nothing is read.
class RHEC_EXPORT MessageReader final : public FieldReader {
 public:
  /// Throws Error for a field that the type does not have, or that is no number.
  MessageReader(std::shared_ptr<const MessageType> type, const FieldRequest& request);
  ~MessageReader() override;
  Stamp read(const Record& record, double* values) override;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Paths of the numbers in a message, without those of its header; of long arrays and very many fields, none.
RHEC_EXPORT std::vector<std::string> number_paths(const MessageType& type, std::span<const std::byte> message);

}  // namespace rhec::logs
