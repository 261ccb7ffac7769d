#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "../messages/message_writer.hpp"
#include "../node/live_topics.hpp"
#include "rhec/logs/mapping/signal_map.hpp"

namespace rhec::apps::ros {

/// What the sensors of a robot publish: a section `signals`, read backwards. A model's outputs and inputs become the
/// fields that they would be read from.
class SensorMessages {
 public:
  /// Throws Error for a signal that cannot be made of a value, such as a derivative.
  SensorMessages(const LiveTopics& topics, const logs::SignalMap& map, std::string frame);

  /// By topic of `topics`: whether there are messages.
  bool is_made(int topic) const;
  /// The messages of what was measured at a time: n_y outputs, NaN where missing, or n_u inputs.
  using Take = std::function<void(int topic, std::span<const std::byte> message)>;
  void write(bool is_output, logs::Stamp when, const double* values, const Take& take);

 private:
  void set(const logs::MappedSignal& signal, double value, MessageWriter& message);

  const LiveTopics& topics_;
  std::vector<logs::MappedSignal> signals_;
  std::vector<int> topic_of_;  ///< by signal
  logs::LocalPlane plane_;
  std::string frame_;
  std::map<std::pair<int, double>, MessageWriter> writers_;  ///< by topic and delay
  std::map<std::pair<int, double>, std::array<double, 3>> places_;
};

}  // namespace rhec::apps::ros
