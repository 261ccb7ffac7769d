#include "rhec/sim/world/faults.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"

namespace rhec::sim {
namespace {

/// What a kind acts on, and whether it needs a size; without a length it lasts for one sample, or to the end.
struct KindTraits {
  FaultKind kind;
  const char* name;
  enum class Target { values, applied_inputs, measurements } target;
  bool has_size, is_single;
};
using Target = KindTraits::Target;

constexpr std::array kinds{
    KindTraits{FaultKind::spike, "spike", Target::values, true, true},
    KindTraits{FaultKind::offset, "offset", Target::values, true, false},
    KindTraits{FaultKind::drift, "drift", Target::values, true, false},
    KindTraits{FaultKind::noise, "noise", Target::values, true, false},
    KindTraits{FaultKind::multipath, "multipath", Target::values, true, false},
    KindTraits{FaultKind::stuck, "stuck", Target::values, false, false},
    KindTraits{FaultKind::dropout, "dropout", Target::values, false, false},
    KindTraits{FaultKind::value, "value", Target::values, true, true},
    KindTraits{FaultKind::wheel_spin, "wheel_spin", Target::applied_inputs, true, false},
    KindTraits{FaultKind::silence, "silence", Target::measurements, false, false},
    KindTraits{FaultKind::late, "late", Target::measurements, true, true},
    KindTraits{FaultKind::stamp, "stamp", Target::measurements, true, true},
    KindTraits{FaultKind::doubled, "doubled", Target::measurements, false, true},
    KindTraits{FaultKind::swapped, "swapped", Target::measurements, false, true},
    KindTraits{FaultKind::clock, "clock", Target::measurements, true, false},
};

const KindTraits& traits_of(FaultKind kind) {
  return *std::find_if(kinds.begin(), kinds.end(), [kind](const KindTraits& each) { return each.kind == kind; });
}

std::vector<std::pair<std::string, FaultKind>> choices() {
  std::vector<std::pair<std::string, FaultKind>> all;
  all.reserve(kinds.size());
  for (const KindTraits& each : kinds) all.emplace_back(each.name, each.kind);
  return all;
}

int index_of(const std::vector<Variable>& variables, std::string_view name) {
  for (std::size_t j = 0; j < variables.size(); ++j)
    if (variables[j].name == name) return static_cast<int>(j);
  return -1;
}

/// The place of a key of a fault; of the fault if it lacks the key.
const Settings& at(const Settings& fault, std::string_view key) {
  const Settings* found = fault.find(key);
  return found ? *found : fault;
}

void check_sensors(const Settings& fault, const FaultOptions& options, const ModelDescription& about) {
  const KindTraits& traits = traits_of(options.kind);
  std::vector<std::string> known;
  if (traits.target == Target::values) known = names_of(about.outputs);
  if (traits.target != Target::measurements)
    for (const Variable& input : about.inputs) known.push_back(input.name);
  if (traits.target == Target::measurements && !options.sensors.empty())
    throw at(fault, "sensors")
        .error(fmt::format("a fault '{}' is of whole measurements; leave 'sensors' out", traits.name));
  if (traits.target != Target::measurements && options.sensors.empty())
    throw at(fault, "sensors")
        .error(fmt::format("a fault '{}' needs sensors; expected a list of some of {}", traits.name,
                           fmt::join(known, ", ")));
  for (std::size_t j = 0; j < options.sensors.size(); ++j)
    read_choice(fault.find("sensors")->items()[j], known, {"fault", "what it is a fault of"});
}

void check_size(const Settings& fault, const FaultOptions& options) {
  const KindTraits& traits = traits_of(options.kind);
  if (traits.has_size != options.size.has_value())
    throw at(fault, "size")
        .error(traits.has_size ? fmt::format("a fault '{}' needs a size", traits.name)
                               : fmt::format("a fault '{}' has no size; leave it out", traits.name));
  if (!options.size || options.kind == FaultKind::value) return;
  const bool is_share = options.kind == FaultKind::wheel_spin,
             has_sign = options.kind == FaultKind::stamp || options.kind == FaultKind::clock;
  const bool fits =
      std::isfinite(*options.size) && (has_sign || *options.size >= 0.0) && (!is_share || *options.size <= 1.0);
  if (!fits)
    throw at(fault, "size")
        .error(fmt::format("found {}, expected {} for a fault '{}'", *options.size,
                           is_share   ? "a share from 0 to 1"
                           : has_sign ? "a finite number"
                                      : "a finite number, at least 0",
                           traits.name));
}

}  // namespace

const OptionTable<FaultOptions>& FaultOptions::table() {
  using F = FaultOptions;
  static const auto rows =
      OptionTable<F>()
          .choice("kind", &F::kind, choices(), "what goes wrong")
          .number("start", &F::start, "when [s]", at_least(0.0))
          .optional_number(
              "length", &F::length,
              "for how long [s]; none: one sample of spike, value, late, stamp, doubled and swapped, to the "
              "end of the others",
              greater_than(0.0))
          .optional_number(
              "every", &F::every,
              "again and again: the mean time from an end to the next start; both it and `length` are then "
              "drawn from exponential distributions [s]",
              greater_than(0.0))
          .names("sensors", &F::sensors,
                 "outputs of the model, or inputs for what is measured of them; of wheel_spin: inputs. A size is the "
                 "distance in the space of all that are named")
          .optional_number("size", &F::size,
                           "in the unit of the sensors; of drift a second; of value the value itself (also .inf); of "
                           "wheel_spin the share that is lost; of late, stamp and clock [s]",
                           or_infinite(any()))
          .optional_integer("seed", &F::seed, "of directions, sizes and times that are drawn; none: the scenario's",
                            between(0, 2147483647));
  return rows;
}

std::string_view name_of(FaultKind kind) noexcept { return traits_of(kind).name; }

std::vector<FaultOptions> read_faults(const Settings& list, const ModelDescription& about) {
  std::vector<FaultOptions> faults;
  if (list.is_null()) return faults;
  if (list.kind() != Settings::Kind::list)
    throw list.mismatch("a list of faults, such as [{kind: spike, start: 5, sensors: [NAME], size: 10}]");
  faults.reserve(list.items().size());
  for (const Settings& fault : list.items()) {
    const FaultOptions options = FaultOptions::table().parse(fault, "fault");
    if (!fault.find("kind"))
      throw fault.error(
          fmt::format("a fault without a kind; expected 'kind', {}", ChoiceValue<FaultKind>{choices()}.constraint()));
    check_sensors(fault, options, about);
    check_size(fault, options);
    faults.push_back(options);
  }
  return faults;
}

Faults::Faults(const std::vector<FaultOptions>& faults, const ModelDescription& about, std::uint64_t seed) {
  faults_.reserve(faults.size());
  for (std::size_t k = 0; k < faults.size(); ++k) {
    const FaultOptions& options = faults[k];
    const KindTraits& traits = traits_of(options.kind);
    const auto own_seed = options.seed ? static_cast<std::uint64_t>(*options.seed) : seed;
    Fault fault{.kind = options.kind,
                .size = options.size.value_or(0.0),
                .is_single = !options.length && traits.is_single,
                .mean_length = options.length.value_or(infinity),
                .mean_gap = options.every.value_or(infinity),
                .outputs = {},
                .inputs = {},
                .random = RandomStream(own_seed, fmt::format("fault {} {}", k, traits.name)),
                .from = options.start,
                .to = infinity,
                .direction = {},
                .held = {}};
    for (const std::string& name : options.sensors) {
      const int output = index_of(about.outputs, name), input = index_of(about.inputs, name);
      if (output >= 0 && traits.target == Target::values)
        fault.outputs.push_back(output);
      else
        fault.inputs.push_back(input);
    }
    fault.direction.resize(fault.outputs.size() + fault.inputs.size());
    fault.held.assign(fault.direction.size(), std::numeric_limits<double>::quiet_NaN());
    fault.from = options.start;
    fault.next_span();
    faults_.push_back(std::move(fault));
  }
}

/// A unit vector, all directions alike; of a multipath, its length is that of a normal number.
void Faults::Fault::choose_direction() {
  double squared = 0.0;
  for (double& component : direction) {
    component = random.normal();
    squared += component * component;
  }
  const double length = kind == FaultKind::multipath ? std::abs(random.normal()) : 1.0;
  for (double& component : direction) component *= length / std::sqrt(squared);
}

/// The span that starts at `from`: its length, and what is drawn once for all of it.
void Faults::Fault::next_span() {
  const bool recurs = std::isfinite(mean_gap);
  const double length =
      recurs && std::isfinite(mean_length) ? -mean_length * std::log1p(-random.uniform()) : mean_length;
  to = from + length;
  was_used = false;
  if (!direction.empty()) choose_direction();
}

void Faults::Fault::begin(double time) {
  const auto is_over = [&] { return is_single ? was_used : time >= to - Deliveries::tolerance; };
  while (is_over() && std::isfinite(mean_gap)) {
    from = (is_single ? std::max(from, time) : to) - mean_gap * std::log1p(-random.uniform());
    next_span();
  }
  is_on = time >= from - Deliveries::tolerance && !is_over();
  if (is_on && kind == FaultKind::spike && !is_single) choose_direction();
  // One that acts on whole measurements, or on nothing that is asked for at once, has its sample now.
  if (is_on && !is_single) was_told = true;
}

void Faults::begin(double time) {
  time_ = time;
  for (Fault& fault : faults_) fault.begin(time);
}

void Faults::change(Fault& fault, const std::vector<int>& which, std::size_t first, double* values) const {
  for (std::size_t j = 0; j < which.size(); ++j) {
    double& value = values[which[j]];
    if (std::isnan(value)) continue;
    double& held = fault.held[first + j];
    if (!fault.is_on) {
      held = value;
      continue;
    }
    fault.was_used = fault.was_told = true;
    const double part = fault.direction[first + j];
    switch (fault.kind) {
      case FaultKind::spike:
      case FaultKind::offset:
      case FaultKind::multipath:
        value += fault.size * part;
        break;
      case FaultKind::drift:
        value += fault.size * part * (time_ - fault.from);
        break;
      case FaultKind::noise:
        value += fault.size * fault.random.normal();
        break;
      case FaultKind::stuck:
        if (std::isnan(held)) held = value;
        value = held;
        break;
      case FaultKind::dropout:
        value = std::numeric_limits<double>::quiet_NaN();
        break;
      case FaultKind::value:
        value = fault.size;
        break;
      default:
        break;
    }
  }
}

void Faults::change_outputs(double* outputs) {
  for (Fault& fault : faults_) change(fault, fault.outputs, 0, outputs);
}

void Faults::change_measured_inputs(double* inputs) {
  for (Fault& fault : faults_)
    if (fault.kind != FaultKind::wheel_spin) change(fault, fault.inputs, fault.outputs.size(), inputs);
}

void Faults::change_applied_inputs(double* inputs) const {
  for (const Fault& fault : faults_) {
    if (fault.kind != FaultKind::wheel_spin || !fault.is_on) continue;
    for (const int input : fault.inputs) inputs[input] *= 1.0 - fault.size;
  }
}

void Faults::send(const std::vector<double>& outputs, double latency, Deliveries& to) {
  double arrival = time_ + latency, stamp = time_ + clock();
  int copies = 1;
  bool is_held_back = false;
  for (Fault& fault : faults_) {
    if (!fault.is_on || traits_of(fault.kind).target != Target::measurements) continue;
    fault.was_used = fault.was_told = true;
    if (fault.kind == FaultKind::silence) copies = 0;
    if (fault.kind == FaultKind::doubled) copies *= 2;
    if (fault.kind == FaultKind::late) arrival += fault.size;
    if (fault.kind == FaultKind::stamp) stamp += fault.size;
    if (fault.kind == FaultKind::swapped) is_held_back = waiting_.empty();
  }
  if (is_held_back && copies > 0) {
    waiting_.push_back({arrival, stamp, outputs});
    return;
  }
  for (int i = 0; i < copies; ++i) to.add(arrival, stamp, outputs);
  for (const Deliveries::Row& row : std::exchange(waiting_, {}))
    to.add(std::max(row.arrival, arrival), row.stamp, row.outputs);
}

double Faults::clock() const {
  double sum = 0.0;
  for (const Fault& fault : faults_)
    if (fault.kind == FaultKind::clock && fault.is_on) sum += fault.size;
  return sum;
}

std::string Faults::take_names() {
  std::string names;
  for (Fault& fault : faults_) {
    if (!std::exchange(fault.was_told, false)) continue;
    names += (names.empty() ? "" : "+") + std::string(name_of(fault.kind));
  }
  return names;
}

}  // namespace rhec::sim
