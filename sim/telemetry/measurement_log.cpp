#include "rhec/sim/telemetry/measurement_log.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "mcap_channel.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/logs/cdr/cdr_writer.hpp"
#include "rhec/logs/mapping/signal_map.hpp"
#include "rhec/logs/mcap/mcap_writer.hpp"
#include "rhec/logs/storage/whole_file.hpp"
#include "rhec/sim/telemetry/robot_messages.hpp"

namespace rhec::sim {

class MeasurementLog::Form {
 public:
  virtual ~Form() = default;
  virtual void take(double arrival, double stamp, bool is_output, const double* values) = 0;
  virtual void close() = 0;
};

namespace {

class TableForm final : public MeasurementLog::Form {
 public:
  TableForm(const std::filesystem::path& file, const ModelDescription& about)
      : file_(file), outputs_(about.outputs.size()), inputs_(about.inputs.size()) {
    std::string header = "time,received";
    for (const auto* variables : {&about.outputs, &about.inputs})
      for (const Variable& variable : *variables) header += "," + variable.name;
    file_.write(header + "\n");
  }

  void take(double arrival, double stamp, bool is_output, const double* values) override {
    // A stamp that a fault has spoilt is no time, and a table has nothing else for it.
    if (!std::isfinite(stamp)) return;
    text_.clear();
    fmt::format_to(std::back_inserter(text_), "{:.9f},{:.9f}", stamp, arrival);
    if (!is_output) text_.append(outputs_, ',');
    for (std::size_t j = 0; j < (is_output ? outputs_ : inputs_); ++j) {
      text_ += ',';
      if (std::isfinite(values[j])) fmt::format_to(std::back_inserter(text_), "{}", values[j]);
    }
    if (is_output) text_.append(inputs_, ',');
    file_.write(text_ += '\n');
  }

  void close() override { file_.close(); }

 private:
  logs::WholeFile file_;
  std::size_t outputs_, inputs_;
  std::string text_;
};

class MessageForm final : public MeasurementLog::Form {
 public:
  MessageForm(const std::filesystem::path& file, const ModelDescription& about)
      : writer_(file), outputs_(about.outputs), inputs_(about.inputs) {
    measured_ = add_channel(writer_, logs::measured_topic, "sensor_msgs/msg/JointState");
    moved_ = add_channel(writer_, logs::inputs_topic, "sensor_msgs/msg/JointState");
  }

  void take(double arrival, double stamp, bool is_output, const double* values) override {
    if (!std::isfinite(stamp)) return;
    const std::vector<Variable>& variables = is_output ? outputs_ : inputs_;
    names_.clear();
    positions_.clear();
    for (std::size_t j = 0; j < variables.size(); ++j) {
      if (!std::isfinite(values[j])) continue;
      names_.push_back(variables[j].name);
      positions_.push_back(values[j]);
    }
    message_.clear();
    write_joint_state(stamp_at(stamp), "base_link", names_, positions_, {}, message_);
    writer_.write(is_output ? measured_ : moved_, stamp_at(arrival), message_.bytes());
  }

  void close() override { writer_.close(); }

 private:
  logs::McapWriter writer_;
  std::vector<Variable> outputs_, inputs_;
  std::uint16_t measured_ = 0, moved_ = 0;
  logs::CdrWriter message_;
  std::vector<std::string> names_;
  std::vector<double> positions_;
};

}  // namespace

MeasurementLog::MeasurementLog(const std::filesystem::path& file, const ModelDescription& about) {
  if (file.extension() == ".csv") {
    form_ = std::make_unique<TableForm>(file, about);
  } else if (file.extension() == ".mcap") {
    form_ = std::make_unique<MessageForm>(file, about);
  } else {
    throw Error(fmt::format("{}: expected a name that ends in .csv or .mcap", file.string()));
  }
}
MeasurementLog::~MeasurementLog() = default;

void MeasurementLog::take_outputs(double arrival, double stamp, const double* outputs) {
  form_->take(arrival, stamp, true, outputs);
}
void MeasurementLog::take_inputs(double stamp, const double* inputs) { form_->take(stamp, stamp, false, inputs); }
void MeasurementLog::listen(LoopHooks& hooks) {
  hooks.measured = [this](double arrival, double stamp, const double* outputs) {
    take_outputs(arrival, stamp, outputs);
  };
  hooks.moved = [this](double stamp, const double* inputs) { take_inputs(stamp, inputs); };
}
void MeasurementLog::close() { form_->close(); }

}  // namespace rhec::sim
