#include <array>
#include <optional>
#include <string>

#include "mcap_channel.hpp"
#include "rhec/logs/mcap/mcap_writer.hpp"
#include "rhec/sim/telemetry/track_messages.hpp"
#include "rhec/sim/telemetry/track_writer.hpp"

namespace rhec::sim {
namespace {

class McapTrack final : public TrackWriter {
 public:
  McapTrack(const std::filesystem::path& file, const Robot& robot, const Path* reference)
      : writer_(file), messages_(robot) {
    if (reference) reference_ = *reference;
    for (std::size_t i = 0; i < track_topic_count; ++i) {
      const auto which = static_cast<TrackTopic>(i);
      if (which == TrackTopic::path && !reference) continue;
      const TrackMessages::Topic& topic = TrackMessages::topic(which);
      channels_[i] = add_channel(writer_, topic.name, topic.type);
    }
  }

  void write(const TrackSample& sample) override {
    const auto keep = [this](TrackTopic topic, logs::Stamp when, std::span<const std::byte> message) {
      writer_.write(channels_[static_cast<std::size_t>(topic)], when, message);
    };
    if (reference_) messages_.write_path(*reference_, sample.stamp, keep);
    reference_.reset();
    messages_.write(sample, keep);
  }
  void close() override { writer_.close(); }

 private:
  logs::McapWriter writer_;
  TrackMessages messages_;
  std::optional<Path> reference_;  ///< until it is written
  std::array<std::uint16_t, track_topic_count> channels_{};
};

}  // namespace

std::unique_ptr<TrackWriter> open_track_mcap(const std::filesystem::path& file, const Robot& robot,
                                             const Path* reference) {
  return std::make_unique<McapTrack>(file, robot, reference);
}

}  // namespace rhec::sim
