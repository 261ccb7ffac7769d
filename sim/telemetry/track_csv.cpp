#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/logs/storage/whole_file.hpp"
#include "rhec/sim/telemetry/track_writer.hpp"

namespace rhec::sim {
namespace {

/// A stamp in seconds, to the nanosecond: "1700000000.123456789".
void append_seconds(logs::Stamp stamp, std::string& text) {
  constexpr logs::Stamp second = 1'000'000'000;
  const bool is_negative = stamp < 0;
  const auto size = is_negative ? -static_cast<unsigned long long>(stamp) : static_cast<unsigned long long>(stamp);
  fmt::format_to(std::back_inserter(text), "{}{}.{:09}", is_negative ? "-" : "", size / second, size % second);
}

class CsvTrack final : public TrackWriter {
 public:
  CsvTrack(const std::filesystem::path& file, const Robot& robot)
      : file_(file), inputs_(robot.model()->description().inputs.size()) {
    const ModelDescription& about = robot.estimated_description();
    std::string header = "time";
    for (const char* prefix : {"", "sigma_"})
      for (const auto* variables : {&about.states, &about.parameters})
        for (const Variable& variable : *variables) header += fmt::format(",{}{}", prefix, variable.name);
    for (std::size_t j = 0; j < inputs_; ++j) header += "," + robot.model()->description().inputs[j].name;
    file_.write(header + ",health\n");
  }

  void write(const TrackSample& sample) override {
    text_.clear();
    append_seconds(sample.stamp, text_);
    for (const double value : sample.state) append(value);
    for (const double value : sample.parameters) append(value);
    const Eigen::Index values = sample.state.size() + sample.parameters.size();
    for (Eigen::Index j = 0; j < values; ++j) append(sample.sigmas.size() > 0 ? sample.sigmas[j] : std::nan(""));
    for (std::size_t j = 0; j < inputs_; ++j) append(j < sample.inputs.size() ? sample.inputs[j] : std::nan(""));
    fmt::format_to(std::back_inserter(text_), ",{}\n", static_cast<int>(sample.health));
    file_.write(text_);
  }
  void close() override { file_.close(); }

 private:
  void append(double value) {
    text_ += ',';
    if (std::isfinite(value)) fmt::format_to(std::back_inserter(text_), "{:.10g}", value);
  }
  logs::WholeFile file_;
  std::size_t inputs_;
  std::string text_;
};

class TumTrack final : public TrackWriter {
 public:
  TumTrack(const std::filesystem::path& file, const Robot& robot)
      : file_(file), roles_(robot.model()->description().roles) {
    if (roles_.position_x < 0 || roles_.position_y < 0)
      throw Error(fmt::format("{}: a trajectory needs a position, which this model does not have", file.string()));
  }
  void write(const TrackSample& sample) override {
    text_.clear();
    append_seconds(sample.stamp, text_);
    const double heading = roles_.heading >= 0 ? sample.state[roles_.heading] : 0.0;
    fmt::format_to(std::back_inserter(text_), " {:.9g} {:.9g} 0 0 0 {:.9g} {:.9g}\n", sample.state[roles_.position_x],
                   sample.state[roles_.position_y], std::sin(0.5 * heading), std::cos(0.5 * heading));
    file_.write(text_);
  }
  void close() override { file_.close(); }

 private:
  logs::WholeFile file_;
  Roles roles_;
  std::string text_;
};

}  // namespace

std::unique_ptr<TrackWriter> open_track_csv(const std::filesystem::path& file, const Robot& robot) {
  return std::make_unique<CsvTrack>(file, robot);
}
std::unique_ptr<TrackWriter> open_track_tum(const std::filesystem::path& file, const Robot& robot) {
  return std::make_unique<TumTrack>(file, robot);
}

}  // namespace rhec::sim
