#pragma once

#include <filesystem>
#include <memory>

#include "rhec/core/model/model.hpp"
#include "rhec/sim/problems/recording_solver.hpp"

namespace rhec::sim {

/// Keeps what the sensors of a closed loop measured, and its inputs as measured: a log that `rhec estimate` replays. Of
/// the file's name, `.csv` is a table (`time` when it was measured, `received` when it was known) and `.mcap` a log of
/// JointState messages whose items bear the names of outputs and inputs.
class RHEC_EXPORT MeasurementLog {
 public:
  /// Throws Error if the name has another ending, or the file cannot be written.
  MeasurementLog(const std::filesystem::path& file, const ModelDescription& about);
  ~MeasurementLog();
  MeasurementLog(const MeasurementLog&) = delete;
  MeasurementLog& operator=(const MeasurementLog&) = delete;

  /// As LoopHooks::measured and LoopHooks::moved; times in [s].
  void take_outputs(double arrival, double stamp, const double* outputs);
  void take_inputs(double stamp, const double* inputs);
  /// Takes what the loop with these hooks tells; they must not outlive this.
  void listen(LoopHooks& hooks);
  /// Puts the file in its place.
  void close();

  class Form;  ///< table or messages

 private:
  std::unique_ptr<Form> form_;
};

}  // namespace rhec::sim
