#include "rhec/logs/mapping/signal_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/logs/signals/units.hpp"

namespace rhec::logs {
namespace {

constexpr double most_delay = 10.0, whole_turn = 2.0 * std::numbers::pi;

bool is_geodetic(SignalForm form) {
  return form == SignalForm::east || form == SignalForm::north || form == SignalForm::up;
}

/// What kind of number comes out of a form, without a unit of its own.
std::string unit_after(SignalForm form, const std::string& unit) {
  if (is_geodetic(form)) return "m";
  if (form == SignalForm::heading || form == SignalForm::direction) return "rad";
  if (form == SignalForm::turn && unit == "m/s") return "rad/s";
  return unit;
}

/// Of a wheel: what it rolls by.
std::string unit_rolled(const std::string& unit) {
  if (unit == "rad/s") return "m/s";
  if (unit == "m/s") return "rad/s";
  if (unit == "rad") return "m";
  return unit == "m" ? "rad" : "";
}

std::string unit_of_rate(const std::string& unit) {
  if (unit == "m") return "m/s";
  if (unit == "rad") return "rad/s";
  return unit == "m/s" ? "m/s^2" : "";
}

std::vector<SignalName> names_in(const Settings& from) {
  std::vector<SignalName> names;
  if (from.kind() == Settings::Kind::scalar) {
    names.push_back(parse_signal_name(from.as_text()));
  } else if (from.kind() == Settings::Kind::list && !from.items().empty()) {
    for (const std::string& name : from.as_names()) names.push_back(parse_signal_name(name));
  } else {
    throw from.mismatch("a signal, such as /odom:twist.twist.linear.x or the name of a column, or a list of them");
  }
  return names;
}

struct ConditionOptions {
  std::string of;
  std::optional<double> at_least, at_most;
  static const OptionTable<ConditionOptions>& table() {
    static const auto rows = OptionTable<ConditionOptions>()
                                 .text("of", &ConditionOptions::of, "a signal of the same topic or table")
                                 .optional_number("at_least", &ConditionOptions::at_least, "the least that it may be")
                                 .optional_number("at_most", &ConditionOptions::at_most, "the most that it may be");
    return rows;
  }
};

std::vector<SignalCondition> conditions_in(const Settings& when) {
  std::vector<SignalCondition> conditions;
  const std::span<const Settings> each =
      when.kind() == Settings::Kind::list ? std::span<const Settings>(when.items()) : std::span(&when, 1);
  for (const Settings& item : each) {
    const ConditionOptions options = ConditionOptions::table().parse(item, "a condition");
    if (options.of.empty() || (!options.at_least && !options.at_most))
      throw item.error("expected `of` and `at_least` or `at_most`, as in {of: \"/fix:status.status\", at_least: 2}");
    const SignalCondition condition{parse_signal_name(options.of), options.at_least.value_or(-infinity),
                                    options.at_most.value_or(infinity)};
    if (!(condition.at_least <= condition.at_most)) throw item.error("expected at_least up to at_most");
    conditions.push_back(condition);
  }
  return conditions;
}

/// A condition is looked at in the records that have the value. Before it is known what there is in a log, "/a" may be
/// a topic or a column.
void check_topics(const MappedSignal& signal, bool is_resolved) {
  const auto check = [&](const SignalName& of, const Settings& key) {
    for (const SignalName& from : signal.from)
      if (from.topic != of.topic && (is_resolved || (!from.field.empty() && !of.field.empty())))
        throw key.error(fmt::format("'{}{}{}' is in other records than the value itself; expected a signal {}",
                                    of.topic, of.topic.empty() ? "" : ":", of.field,
                                    from.topic.empty() ? "of the table" : "of " + from.topic));
  };
  for (const SignalCondition& condition : signal.conditions) check(condition.of, signal.options.when);
  if (signal.accuracy)
    check(signal.accuracy->of, signal.accuracy->is_variance ? signal.options.variance : signal.options.sigma);
}

/// `sigma` or `variance`: what records say of their own accuracy.
void set_accuracy(MappedSignal& signal, const Settings& keys) {
  const SignalOptions& options = signal.options;
  const bool is_variance = !options.variance.is_null();
  const Settings& key = is_variance ? options.variance : options.sigma;
  if (key.is_null()) {
    for (const char* lone : {"sigma_scale", "least_sigma"})
      if (const Settings* found = keys.find(lone))
        throw found->error("is for what `sigma` or `variance` states; expected one of these beside it");
    return;
  }
  if (is_variance && !options.sigma.is_null()) throw key.error("found beside `sigma`; expected one of them");
  if (!signal.is_output) throw key.error("is for outputs; the noise of an input is that of the scenario");
  if (key.kind() != Settings::Kind::scalar)
    throw key.mismatch("a signal, such as /fix:position_covariance[0] or the name of a column");
  signal.accuracy = {parse_signal_name(key.as_text()), is_variance};
  if (options.derivative) throw key.error("is of what is measured, and not of its rate; leave it out");
  if (signal.accuracy->of.field.empty())
    throw key.error(fmt::format("'{}' is a topic; expected one of its fields, e.g. '{}:position_covariance[0]'",
                                signal.accuracy->of.topic, signal.accuracy->of.topic));
}

/// `is_resolved`: names are known to be topics or columns; before, "fix" may be either.
void check_count(const MappedSignal& signal, const Settings& entry, bool is_resolved) {
  const std::size_t count = signal.from.size();
  const SignalForm form = signal.options.form;
  const bool is_whole_topic = count == 1 && (!is_resolved || !signal.from.front().topic.empty());
  const bool are_topics = std::ranges::all_of(
      signal.from, [&](const SignalName& each) { return !is_resolved || (!each.topic.empty() && each.field.empty()); });
  if (form == SignalForm::value && count != 1)
    throw entry.error(fmt::format(
        "found {} signals, expected one; or give the form: mean, turn, heading, direction, east, north", count));
  if (is_resolved && form == SignalForm::value && signal.from.front().field.empty())
    throw entry.error(
        fmt::format("'{}' is a topic; expected one of its fields, e.g. '{}:data'; or the form: east, "
                    "north, up, heading",
                    signal.from.front().topic, signal.from.front().topic));
  if (form == SignalForm::heading && !is_whole_topic && count != 4)
    throw entry.error(
        fmt::format("found {} signals, expected the field of a quaternion, or the four columns x, y, z, w", count));
  if (is_geodetic(form) && !is_whole_topic && count != 2 && count != 3)
    throw entry.error(
        fmt::format("found {} signals, expected a topic such as /fix, or latitude, longitude and height", count));
  if (form == SignalForm::direction && count != 4 &&
      !(count == 2 &&
        (are_topics || std::ranges::none_of(signal.from, [](const SignalName& each) { return each.field.empty(); }))))
    throw entry.error(
        fmt::format("found {} signals, expected two topics of fixes, two numbers, to the east and to the north, or the "
                    "columns latitude, longitude, latitude, longitude",
                    count));
  if (form == SignalForm::yaw_rate && !is_whole_topic && count != 3)
    throw entry.error(fmt::format(
        "found {} signals, expected a vector, such as /imu:angular_velocity, or the three columns x, y, z", count));
  if (form == SignalForm::turn && count != 2)
    throw entry.error(fmt::format("found {} signals, expected two: of the left and of the right side", count));
}

/// What rates and rotations may lack.
std::string hint_for(const std::string& unit, const MappedSignal& signal) {
  if (unit == unit_rolled(signal.variable.unit)) return ", or the `radius` of a wheel";
  if (unit_of_rate(unit) == signal.variable.unit && !signal.options.derivative) return ", or `derivative: true`";
  return "";
}

/// sign * scale * unit * radius, once it is sure that what comes out has the variable's unit. `unit_name` is that of
/// the signal, `place` where it is told.
void set_factor(MappedSignal& signal, const std::string& unit_name, const Settings& place, const Settings& entry) {
  const SignalOptions& options = signal.options;
  std::string unit;
  signal.factor = options.sign * options.scale.value_or(1.0);
  if (!unit_name.empty()) {
    const std::optional<Unit> found = find_unit(unit_name);
    if (!found)
      throw place.error(
          fmt::format("found '{}', expected a unit{}", unit_name, suggestion_for(unit_name, unit_names())));
    unit = found->si;
    signal.factor *= found->factor;
  }
  if (options.counts) {
    if (!unit.empty()) throw place.error("is given by `counts`, which makes angles; leave one of them out");
    unit = "rad";
    signal.factor *= whole_turn / *options.counts;
  }
  const bool is_direction = options.form == SignalForm::heading || options.form == SignalForm::direction;
  signal.is_angle =
      is_direction || (!options.counts && (unit == "rad" || (unit.empty() && signal.variable.unit == "rad/s")));
  signal.period = options.wraps ? *options.wraps * std::abs(signal.factor) : signal.is_angle ? whole_turn : 0.0;
  if (options.radius) {
    const bool is_inverse = unit == "m/s" || unit == "m";
    signal.factor *= is_inverse ? 1.0 / *options.radius : *options.radius;
    signal.period *= is_inverse ? 1.0 / *options.radius : *options.radius;
    if (!unit.empty()) unit = unit_rolled(unit);
  }
  if (options.form == SignalForm::turn) {
    if (!options.track) throw entry.error("as: turn: needs `track`, the distance of the two sides [m]");
    signal.factor /= *options.track;
    signal.period /= *options.track;
  }
  if (options.form == SignalForm::mean && options.wraps) signal.period /= static_cast<double>(signal.from.size());
  signal.sigma_factor = options.sigma_scale * std::abs(signal.factor);
  if (is_geodetic(options.form) || is_direction) {
    if (!unit_name.empty()) throw place.error("is given by the form; leave it out");
  } else if (unit.empty() || options.scale) {
    return;  // who scales knows
  }
  unit = unit_after(options.form, unit);
  if (options.derivative) unit = unit_of_rate(unit);
  if (unit != signal.variable.unit)
    throw entry.error(fmt::format("gives [{}], but {} is in [{}]; expected another unit or form{}", unit,
                                  signal.variable.name, signal.variable.unit, hint_for(unit, signal)));
}

/// What belongs to some forms alone.
void check_form(const MappedSignal& signal, const Settings& keys) {
  const SignalOptions& options = signal.options;
  const SignalForm form = options.form;
  if (!options.rpy.empty() && form != SignalForm::heading && form != SignalForm::yaw_rate)
    throw keys.find("rpy")->error("is for `as: heading` and `as: yaw_rate`; expected one of them");
  if (!options.rpy.empty() && options.rpy.size() != 3)
    throw keys.find("rpy")->error(
        fmt::format("found {} numbers, expected roll, pitch and yaw [rad]", options.rpy.size()));
  if (options.wraps && !options.derivative)
    throw keys.find("wraps")->error("is for the rate of a count; expected `derivative: true` beside it");
  if (options.derivative && signal.is_output && signal.variable.unit != "m/s" && signal.variable.unit != "rad/s")
    throw keys.find("derivative")
        ->error(
            fmt::format("is for rates, but {} is in [{}]; leave it out", signal.variable.name, signal.variable.unit));
}

/// Of a log, what a name means there: topics may be called "fix", and columns "/fix/latitude".
SignalName resolved_name(const SignalName& name, const Log& log, bool is_table) {
  const std::string text = name.topic.empty()   ? name.field
                           : name.field.empty() ? name.topic
                                                : name.topic + ":" + name.field;
  if (is_table) return {"", text};
  const std::string* best = nullptr;
  for (const Topic& each : log.topics())
    if ((text == each.name || text.starts_with(each.name + ":")) && (!best || each.name.size() > best->size()))
      best = &each.name;
  if (!best && name.topic.empty()) log.topic(text.substr(0, text.find(':')));  // says what there is
  if (!best) return name;
  return {*best, text.size() == best->size() ? "" : text.substr(best->size() + 1)};
}

/// The unit of a table's columns, where their heads say it.
std::string unit_in(const Log& log, const MappedSignal& signal) {
  std::string unit;
  for (const SignalName& each : signal.from) {
    const std::string found = log.unit_of(0, each.field);
    if (!unit.empty() && found != unit) return {};
    unit = found;
  }
  return unit;
}

/// What nobody has said of units, the heads of columns may say.
void take_units_of_heads(const Log& log, MappedSignal& signal, const Settings& entry) {
  const SignalOptions& options = signal.options;
  const bool has_unit =
      is_geodetic(options.form) || options.form == SignalForm::heading || options.form == SignalForm::direction;
  if (options.unit.empty() && !options.scale && !options.counts && !has_unit)
    if (const std::string unit = unit_in(log, signal); !unit.empty()) {
      try {
        set_factor(signal, unit, entry, entry);
      } catch (const Error& error) {
        throw Error(fmt::format("{}; the head of the column '{}' of {} says [{}]: give a `unit` if that is wrong",
                                error.what(), signal.from.front().field, log.name(), unit));
      }
    }
  if (!signal.accuracy || signal.accuracy->is_variance) return;
  const std::optional<Unit> stated = find_unit(log.unit_of(0, signal.accuracy->of.field));
  if (stated && stated->si == signal.variable.unit) signal.sigma_factor = options.sigma_scale * stated->factor;
}

}  // namespace

const OptionTable<SignalOptions>& SignalOptions::table() {
  static const auto rows =
      OptionTable<SignalOptions>()
          .subtree(
              "from", &SignalOptions::from,
              "`topic:field`, or the name of a column; several in a list. An item of a list by its index or by name: "
              "`/joint_states:position[rear_left]`. None: the signal of the variable's name")
          .choice(
              "as", &SignalOptions::form,
              {{"value", SignalForm::value},
               {"east", SignalForm::east},
               {"north", SignalForm::north},
               {"up", SignalForm::up},
               {"heading", SignalForm::heading},
               {"mean", SignalForm::mean},
               {"turn", SignalForm::turn},
               {"direction", SignalForm::direction},
               {"yaw_rate", SignalForm::yaw_rate}},
              "the number itself; latitude, longitude (and height), or a topic with them, in the local plane; the "
              "heading of a quaternion; the mean of several; the yaw rate of a left and a right speed; the direction "
              "from one fix to another, or of a vector to the east and north; the yaw rate of an angular velocity")
          .text("unit", &SignalOptions::unit,
                "of the signal, e.g. deg, rpm, km/h; none: what the head of the column says, else that of the variable")
          .integer("sign", &SignalOptions::sign, "-1: the signal counts the other way", between(-1, 1))
          .optional_number("scale", &SignalOptions::scale,
                           "what the signal is multiplied by; units are then not checked")
          .number("offset", &SignalOptions::offset, "what is added, in the variable's unit")
          .optional_number("counts", &SignalOptions::counts,
                           "of an encoder: how many it counts in one turn of what it is on; makes an angle of them",
                           greater_than(0.0))
          .optional_number("wraps", &SignalOptions::wraps,
                           "of a `derivative`: after how many of its units the signal begins anew, such as 65536 for a "
                           "counter of 16 bits; 0: never; none: an angle after a turn, unless it has counted more",
                           at_least(0.0))
          .numbers(
              "rpy", &SignalOptions::rpy,
              "of `as: heading` and `as: yaw_rate`: roll, pitch and yaw of the sensor on the vehicle [rad], as in a "
              "robot's description")
          .optional_number("radius", &SignalOptions::radius,
                           "of a wheel [m]: makes speeds of its rotation, or the other way round", greater_than(0.0))
          .optional_number("track", &SignalOptions::track, "of `as: turn`: the distance of the two sides [m]",
                           greater_than(0.0))
          .number("delay", &SignalOptions::delay, "how much later than it was measured it is stamped [s]",
                  between(-most_delay, most_delay))
          .flag("derivative", &SignalOptions::derivative,
                "the rate at which the signal changes between records, for an input that nothing measures")
          .subtree(
              "when", &SignalOptions::when,
              "values count only in records in which this holds: `{of: SIGNAL, at_least: NUMBER, at_most: NUMBER}`, "
              "or a list of such, of the same topic or table; e.g. the status or covariance of a fix")
          .subtree("sigma", &SignalOptions::sigma,
                   "of an output: the signal, of the same topic or table, that says how accurate a record is: its "
                   "standard deviation, in the unit of the signal; records in which it is not above 0 are as "
                   "`noise.outputs` says")
          .subtree("variance", &SignalOptions::variance,
                   "the same of its variance, as messages have it: `/fix:position_covariance[0]`")
          .number("sigma_scale", &SignalOptions::sigma_scale,
                  "what stated standard deviations are multiplied by: above 1 for a receiver that claims too much",
                  greater_than(0.0))
          .number("least_sigma", &SignalOptions::least_sigma,
                  "the least standard deviation that is believed, in the variable's unit", at_least(0.0))
          .text("clock", &SignalOptions::clock,
                "what says when it was measured: `received`, or a field or column that counts seconds (`name [ms]`: "
                "others); empty: `signals.clock`");
  return rows;
}

const OptionTable<SignalMapOptions>& SignalMapOptions::table() {
  static const auto rows =
      OptionTable<SignalMapOptions>()
          .text(
              "clock", &SignalMapOptions::clock,
              "what says when something was measured; empty: the stamp of a header or the column `time`, else when it "
              "was received")
          .numbers("origin", &SignalMapOptions::origin,
                   "latitude, longitude [deg] and height [m] of the local plane's origin; none: the first fix")
          .map("outputs", &SignalMapOptions::outputs,
               {{"OUTPUT", "text or map", "", "", "a signal, or a map: see signals.SIGNAL; `none`: not measured"}})
          .map("inputs", &SignalMapOptions::inputs, {{"INPUT", "text or map", "", "", "the same"}});
  return rows;
}

std::vector<OptionSection> signal_sections() {
  return {{"signals",
           "For `rhec estimate`, `rhec smooth`, `rhec log` and `rhec ros`: which signals of a log, or topics of a "
           "robot, are the model's outputs and "
           "inputs. One that is "
           "not named is the signal of its own name.",
           SignalMapOptions::table().schema()},
          {"signals.SIGNAL", "How one output or input is read: sign * scale * unit * signal + offset.",
           SignalOptions::table().schema()}};
}

SignalMap::SignalMap(const Settings& section, const ModelDescription& about)
    : section_(section),
      outputs_(static_cast<int>(about.outputs.size())),
      inputs_(static_cast<int>(about.inputs.size() - about.noisy_states.size())) {
  const SignalMapOptions options = SignalMapOptions::table().parse(section, "signals");
  clock_ = options.clock;
  if (!options.origin.empty()) {
    const Settings& key = *section.find("origin");
    if (options.origin.size() != 2 && options.origin.size() != 3)
      throw key.error(fmt::format("found {} numbers, expected latitude, longitude and height", options.origin.size()));
    origin_ = {options.origin[0], options.origin[1], options.origin.size() > 2 ? options.origin[2] : 0.0};
    if (!is_valid(*origin_)) throw key.error("expected a latitude within 90 degrees, and a longitude, in degrees");
  }
  add(options.outputs, about.outputs, true);
  add(options.inputs, {about.inputs.begin(), about.inputs.begin() + inputs_}, false);
}

void SignalMap::add(const Settings& map, const std::vector<Variable>& variables, bool is_output) {
  check_keys(map, names_of(variables), is_output ? "signals.outputs" : "signals.inputs");
  for (std::size_t j = 0; j < variables.size(); ++j) {
    MappedSignal signal{.variable = variables[j], .is_output = is_output, .index = static_cast<int>(j)};
    signal.options.clock = clock_;
    const Settings* entry = map.find(variables[j].name);
    const bool is_none = entry && entry->kind() == Settings::Kind::scalar && entry->text() == "none";
    if (entry && !is_none) {
      Settings keys = *entry;
      if (entry->kind() != Settings::Kind::map) {
        keys = Settings::map(entry->origin());
        keys.add("from", *entry);
      }
      SignalOptions::table().parse_into(signal.options, keys, is_output ? "an output" : "an input");
      if (signal.options.sign == 0) throw entry->error("sign: found 0, expected 1 or -1");
      check_form(signal, keys);
      // Without `from` it is the signal of the variable's own name, in another unit or with an offset.
      if (keys.find("from") || signal.options.form != SignalForm::value) {
        signal.from = names_in(keys.find("from") ? *keys.find("from") : keys);
        check_count(signal, *entry, false);
      }
      if (!signal.options.when.is_null()) signal.conditions = conditions_in(signal.options.when);
      set_accuracy(signal, keys);
      check_topics(signal, false);
      const Settings* const unit = keys.find("unit");
      set_factor(signal, signal.options.unit, unit ? *unit : *entry, *entry);
    }
    signals_.push_back(std::move(signal));
    is_none_.push_back(is_none);
    entries_.push_back(entry ? *entry : section_);
  }
}

std::vector<MappedSignal> SignalMap::resolved(const Log& log) const {
  const std::vector<Topic>& topics = log.topics();
  const bool is_table = topics.size() == 1 && topics.front().name.empty();
  std::vector<MappedSignal> result;
  for (std::size_t i = 0; i < signals_.size(); ++i) {
    if (is_none_[i]) continue;
    MappedSignal signal = signals_[i];
    if (signal.from.empty()) {
      const char* own = signal.is_output ? measured_topic : inputs_topic;
      const bool has_own =
          std::any_of(topics.begin(), topics.end(), [&](const Topic& each) { return each.name == own; });
      if (!is_table && !has_own)
        throw section_.error(
            fmt::format("nothing says which signal of {} is the {} {}; name it under `signals.{}`, or write `{}: none` "
                        "there; `rhec "
                        "log` lists what there is",
                        log.name(), signal.is_output ? "output" : "input", signal.variable.name,
                        signal.is_output ? "outputs" : "inputs", signal.variable.name));
      signal.from = {is_table ? SignalName{"", signal.variable.name}
                              : SignalName{own, fmt::format("position[{}]", signal.variable.name)}};
    }
    for (SignalName& each : signal.from) each = resolved_name(each, log, is_table);
    for (SignalCondition& each : signal.conditions) each.of = resolved_name(each.of, log, is_table);
    if (signal.accuracy) signal.accuracy->of = resolved_name(signal.accuracy->of, log, is_table);
    check_count(signal, entries_[i], true);
    check_topics(signal, true);
    if (is_table) take_units_of_heads(log, signal, entries_[i]);
    result.push_back(std::move(signal));
  }
  return result;
}

}  // namespace rhec::logs
