#include "intake.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "../messages/heard_messages.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"

namespace rhec::apps::ros {
namespace {

constexpr const char* fix_type = "sensor_msgs/msg/NavSatFix";

bool begins_with_header(const std::string& type) {
  const logs::Definitions& definitions = logs::builtin_definitions();
  const auto found = definitions.find(type);
  return found != definitions.end() && !found->second.fields.empty() &&
         found->second.fields.front().type == "std_msgs/msg/Header" &&
         found->second.fields.front().shape == logs::Shape::single;
}

}  // namespace

const char* name_of(Refusal refusal) noexcept {
  constexpr std::array names{"too large", "broken", "stamp", "frame", "fix", "number", "left out"};
  static_assert(names.size() == refusal_count);
  return names[static_cast<std::size_t>(refusal)];
}

std::int64_t TopicCount::refusals() const noexcept {
  return std::accumulate(refused.begin(), refused.end(), std::int64_t{0});
}

std::optional<std::string> stamp_mistake(logs::Stamp stamp, logs::Stamp now, const CheckOptions& checks) {
  const double age = logs::seconds_between(stamp, now);
  if (stamp == 0 || (age <= checks.behind && age >= -checks.ahead)) return std::nullopt;
  return fmt::format("its stamp is {:.3g} s {} the node's clock", std::abs(age), age > 0.0 ? "behind" : "ahead of");
}

Intake::Intake(const LiveTopics& topics, const logs::SignalMap& map, const ModelDescription& about,
               const CheckOptions& checks)
    : topics_(topics), checks_(checks), about_(about), stream_(topics, map) {
  for (const logs::Topic& topic : topics.topics()) {
    counts_.push_back({.topic = topic.name, .refused = {}, .last = ""});
    known_.push_back({.has_header = begins_with_header(topic.type), .is_fix = topic.type == fix_type, .frame = ""});
  }
  measured_.assign(about.outputs.size(), false);
  for (const logs::MappedSignal& signal : map.resolved(topics)) {
    if (signal.is_output) measured_[static_cast<std::size_t>(signal.index)] = true;
    if (signal.options.clock == logs::received_clock)
      known_[static_cast<std::size_t>(topics.topic(signal.from.front().topic))].has_own_clock = false;
  }
}

std::span<const logs::SignalRow> Intake::take(int topic, std::span<const std::byte> message, logs::Stamp now) {
  rows_.clear();
  if (message.empty()) {
    refuse(topic, Refusal::too_large, "it was too large");
    return rows_;
  }
  try {
    if (const auto refusal = why_not(topic, message, now)) {
      refuse(topic, *refusal, found_);
      return rows_;
    }
    const std::int64_t missing = stream_.missing(), left_out = stream_.left_out();
    const std::span<const logs::SignalRow> rows = stream_.take({.topic = topic, .received = now, .bytes = message});
    // Joints may come in several messages: what one of them lacks is no fault, unless it has nothing.
    const bool is_void = rows.empty() && stream_.missing() > missing;
    if (is_void || !std::ranges::all_of(rows, [this](const auto& row) { return is_possible(row); })) {
      refuse(topic, Refusal::number, "a value was missing, not finite or beyond its bounds");
      return rows_;
    }
    if (rows.empty() && stream_.left_out() > left_out) {
      refuse(topic, Refusal::left_out, "a condition on its signals (signals.SIGNAL.when) does not hold");
      return rows_;
    }
    ++counts_[static_cast<std::size_t>(topic)].used;
    return rows;
  } catch (const logs::RecordError& error) {
    refuse(topic, Refusal::broken, error.what());
    return rows_;
  }
}

std::optional<Refusal> Intake::why_not(int topic, std::span<const std::byte> message, logs::Stamp now) {
  Known& known = known_[static_cast<std::size_t>(topic)];
  if (!known.has_header) return std::nullopt;
  const MessageHeader header = read_header(message);
  if (const auto mistake = known.has_own_clock ? stamp_mistake(header.stamp, now, checks_) : std::nullopt) {
    found_ = *mistake;
    return Refusal::stamp;
  }
  if (known.is_fix) {
    const FixQuality quality = read_fix_quality(message);
    if (!quality.has_fix || quality.sigma.value_or(0.0) > checks_.fix_sigma) {
      found_ = quality.has_fix ? fmt::format("it states a standard deviation of {:.3g} m", *quality.sigma)
                               : "the receiver has no fix";
      return Refusal::fix;
    }
  }
  if (known.has_frame && known.frame != header.frame) {
    found_ = fmt::format("its frame is {}, and was {}", logs::in_quotes(header.frame), logs::in_quotes(known.frame));
    return Refusal::frame;
  }
  known.has_frame = true;
  known.frame = header.frame;
  return std::nullopt;
}

bool Intake::is_possible(const logs::SignalRow& row) const {
  if (!row.is_output) return true;  // what inputs can be is judged by the estimator, as a whole
  for (std::size_t j = 0; j < row.values.size(); ++j) {
    const Variable& output = about_.outputs[j];
    if (!std::isnan(row.values[j]) && !(row.values[j] >= output.lower && row.values[j] <= output.upper)) return false;
  }
  return true;
}

void Intake::refuse(int topic, Refusal refusal, std::string text) {
  TopicCount& count = counts_[static_cast<std::size_t>(topic)];
  ++count.refused[static_cast<std::size_t>(refusal)];
  count.last = std::move(text);
}

}  // namespace rhec::apps::ros
