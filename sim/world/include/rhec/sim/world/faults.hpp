#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/options.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/sim/numbers/random.hpp"
#include "rhec/sim/world/deliveries.hpp"

namespace rhec::sim {

/// What can go wrong with sensors, stamps and wheels (docs/faults.md).
enum class FaultKind {
  // Of the values of some sensors, or of measured inputs:
  spike,      ///< off by `size` in a direction drawn for each sample
  offset,     ///< off by `size` in one direction
  drift,      ///< off by `size` a second, in one direction
  noise,      ///< more noise, of standard deviation `size`
  multipath,  ///< an offset drawn anew for each span, of standard deviation `size`
  stuck,      ///< the last value before the span
  dropout,    ///< no value
  value,      ///< `size` itself
  // Of the vehicle:
  wheel_spin,  ///< of the input that is applied, the share `size` is lost; what is measured of it is not
  // Of whole measurements and their stamps:
  silence,  ///< none is sent
  late,     ///< sent `size` seconds later, with the stamp of its time
  stamp,    ///< the stamp is off by `size` seconds
  doubled,  ///< sent twice
  swapped,  ///< sent after the next one
  clock     ///< the robot's clock is off by `size` seconds, for all stamps and for what the estimator is asked
};

/// A fault as a scenario states it: one entry of the list `faults`.
struct FaultOptions {
  FaultKind kind = FaultKind::spike;
  double start = 0.0;                ///< [s]
  std::optional<double> length;      ///< [s]; none: see `table`
  std::optional<double> every;       ///< mean time from an end to the next start [s]; none: once
  std::vector<std::string> sensors;  ///< outputs of the model, or inputs
  std::optional<double> size;
  std::optional<int> seed;
  RHEC_EXPORT static const OptionTable<FaultOptions>& table();
};

/// The name of a kind in a scenario.
RHEC_EXPORT std::string_view name_of(FaultKind kind) noexcept;

/// Reads a list of faults. Throws Error with the place of what is wrong: an unknown kind or sensor, a size that is
/// missing, sensors of a kind that has none.
RHEC_EXPORT std::vector<FaultOptions> read_faults(const Settings& list, const ModelDescription& about);

/// The faults of a drive, sample by sample. Every fault has a random stream of its own. Call `begin` once for each time
/// at which something is measured, in order of time; then any of the others. Without faults nothing changes.
class RHEC_EXPORT Faults {
 public:
  /// `seed` is that of faults that have none.
  Faults(const std::vector<FaultOptions>& faults, const ModelDescription& about, std::uint64_t seed);

  void begin(double time);
  /// Changes the outputs in place.
  void change_outputs(double* outputs);
  /// Changes the measured inputs in place.
  void change_measured_inputs(double* inputs);
  /// The inputs that the vehicle gets.
  void change_applied_inputs(double* inputs) const;
  /// Sends a measurement made at the time of `begin`.
  void send(const std::vector<double>& outputs, double latency, Deliveries& to);
  /// What the robot's clock is off by, now [s].
  double clock() const;
  /// The kinds that were on since the last call, joined by '+'; empty: none.
  std::string take_names();

 private:
  struct Fault {
    FaultKind kind;
    double size;
    bool is_single;                ///< one sample, the first one in which it finds a value to change
    double mean_length, mean_gap;  ///< infinite: to the end; once
    std::vector<int> outputs, inputs;
    RandomStream random;
    double from, to;
    bool is_on = false, was_used = false, was_told = false;
    std::vector<double> direction, held;  ///< by output, then input; `held`: NaN until there was a value

    void choose_direction();
    void next_span();
    void begin(double time);
  };
  void change(Fault& fault, const std::vector<int>& which, std::size_t first, double* values) const;

  std::vector<Fault> faults_;
  std::vector<Deliveries::Row> waiting_;  ///< sent after the next one
  double time_ = 0.0;
};

}  // namespace rhec::sim
