#include "sensor_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

using logs::SignalForm;

// Where a simulated robot drives, unless `signals.origin` says: somewhere on land.
constexpr logs::GeodeticPoint usual_origin{.latitude = 51.0, .longitude = 7.0, .height = 100.0};

bool is_geodetic(SignalForm form) {
  return form == SignalForm::east || form == SignalForm::north || form == SignalForm::up;
}

std::string prefix_of(const logs::SignalName& name) { return name.field.empty() ? "" : name.field + "."; }

}  // namespace

SensorMessages::SensorMessages(const LiveTopics& topics, const logs::SignalMap& map, std::string frame)
    : topics_(topics),
      signals_(map.resolved(topics)),
      plane_(map.origin().value_or(usual_origin)),
      frame_(std::move(frame)) {
  for (const logs::MappedSignal& signal : signals_) {
    topic_of_.push_back(topics.topic(signal.from.front().topic));
    const bool is_parted =
        (is_geodetic(signal.options.form) || signal.options.form == SignalForm::heading) && signal.from.size() != 1;
    const bool is_turned = signal.options.form == SignalForm::direction || !signal.options.rpy.empty();
    if (signal.options.derivative || is_parted || is_turned)
      throw Error(
          fmt::format("signals: {}: a simulated robot cannot publish what this is made of; expected a signal "
                      "without derivative, direction and rpy, of a topic as a whole",
                      signal.variable.name));
    writers_.try_emplace({topic_of_.back(), signal.options.delay}, topics.message_type(topic_of_.back()));
  }
}

bool SensorMessages::is_made(int topic) const { return std::ranges::find(topic_of_, topic) != topic_of_.end(); }

void SensorMessages::write(bool is_output, logs::Stamp when, const double* values, const Take& take) {
  for (auto& [key, writer] : writers_) writer.clear();
  places_.clear();
  for (std::size_t i = 0; i < signals_.size(); ++i) {
    const logs::MappedSignal& signal = signals_[i];
    if (signal.is_output != is_output) continue;
    const double value = values[signal.index];
    if (std::isnan(value)) continue;
    const std::pair key{topic_of_[i], signal.options.delay};
    const double read = (value - signal.options.offset) / signal.factor;
    if (is_geodetic(signal.options.form))
      places_[key][static_cast<std::size_t>(signal.options.form) - static_cast<std::size_t>(SignalForm::east)] = read;
    set(signal, read, writers_.at(key));
  }
  for (auto& [key, writer] : writers_) {
    if (const auto place = places_.find(key); place != places_.end()) {
      const logs::GeodeticPoint point = plane_.reverse(place->second);
      writer.set("latitude", point.latitude);
      writer.set("longitude", point.longitude);
      writer.set("altitude", point.height);
    }
    const auto later = static_cast<logs::Stamp>(std::llround(key.second * 1e9));
    if (!writer.empty()) take(key.first, writer.write(when + later, frame_));
  }
}

void SensorMessages::set(const logs::MappedSignal& signal, double value, MessageWriter& message) {
  switch (signal.options.form) {
    case SignalForm::value:
      return message.set(signal.from.front().field, value);
    case SignalForm::mean:
      for (const logs::SignalName& name : signal.from) message.add(name.field, value);
      return;
    case SignalForm::turn:
      message.add(signal.from[0].field, -0.5 * value);
      message.add(signal.from[1].field, 0.5 * value);
      return;
    case SignalForm::heading:
      message.set(prefix_of(signal.from.front()) + "z", std::sin(0.5 * value));
      message.set(prefix_of(signal.from.front()) + "w", std::cos(0.5 * value));
      return;
    case SignalForm::yaw_rate:
      return message.set(prefix_of(signal.from.front()) + "z", value);
    case SignalForm::direction:  // refused
    case SignalForm::east:
    case SignalForm::north:
    case SignalForm::up:
      return;  // all three at once
  }
}

}  // namespace rhec::apps::ros
