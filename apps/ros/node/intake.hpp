#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "../ros_options.hpp"
#include "live_topics.hpp"
#include "rhec/logs/mapping/signal_stream.hpp"

namespace rhec::apps::ros {

/// Why a message is not used.
enum class Refusal : std::uint8_t {
  too_large,
  broken,   ///< it is no message of its type
  stamp,    ///< too old, or from the future
  frame,    ///< another frame than before
  fix,      ///< a receiver without a fix, or one that states a large error
  number,   ///< a value that is missing, not finite or beyond its bounds
  left_out  ///< by a condition: `signals.SIGNAL.when`
};
inline constexpr std::size_t refusal_count = 7;
const char* name_of(Refusal refusal) noexcept;

/// What came on one topic.
struct TopicCount {
  std::string topic;
  std::int64_t used = 0;
  std::array<std::int64_t, refusal_count> refused{};
  std::string last;  ///< why the last one was refused
  std::int64_t refusals() const noexcept;
};

/// What is wrong with a message's stamp, in words: it is too old, or from the future. A stamp of 0 says nothing.
std::optional<std::string> stamp_mistake(logs::Stamp stamp, logs::Stamp now, const CheckOptions& checks);

/// Messages checked, and turned into outputs and inputs: what is refused is counted, and goes no further.
class Intake {
 public:
  /// `about` has the bounds of the outputs. The topics must outlive this.
  Intake(const LiveTopics& topics, const logs::SignalMap& map, const ModelDescription& about,
         const CheckOptions& checks);

  /// By topic: whether anything reads it.
  bool is_wanted(int topic) const { return stream_.wanted()[static_cast<std::size_t>(topic)]; }
  /// By output of the model: whether any topic tells of it.
  const std::vector<bool>& measured() const noexcept { return measured_; }
  /// The outputs and inputs that a message completes; none if it is refused. Valid until the next call.
  std::span<const logs::SignalRow> take(int topic, std::span<const std::byte> message, logs::Stamp now);

  /// The time has jumped back: what comes next has nothing to do with what came before. Counts and the origin stay.
  void begin_anew() { stream_.begin_anew(); }

  const std::vector<TopicCount>& counts() const noexcept { return counts_; }
  std::optional<logs::GeodeticPoint> origin() const { return stream_.origin(); }

 private:
  std::optional<Refusal> why_not(int topic, std::span<const std::byte> message, logs::Stamp now);
  void refuse(int topic, Refusal refusal, std::string text);
  bool is_possible(const logs::SignalRow& row) const;

  const LiveTopics& topics_;
  CheckOptions checks_;
  ModelDescription about_;
  logs::SignalStream stream_;
  std::vector<TopicCount> counts_;
  struct Known {
    bool has_header = false, is_fix = false, has_own_clock = true;
    bool has_frame = false;
    std::string frame;
  };
  std::vector<Known> known_;
  std::vector<bool> measured_;
  std::vector<logs::SignalRow> rows_;
  std::string found_;
};

}  // namespace rhec::apps::ros
