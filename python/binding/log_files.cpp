// What is in a log: topics, their fields and values, and which of them could be a vehicle's signals.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "binding.hpp"
#include "columns.hpp"
#include "hosts.hpp"
#include "jobs.hpp"
#include "rhec/logs/files/open_log.hpp"
#include "rhec/logs/mapping/proposal.hpp"
#include "rhec/logs/signals/survey.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/replay/replay_scenario.hpp"
#include "settings.hpp"

namespace rhec::python {
namespace {

struct LogFile {
  std::shared_ptr<const logs::Log> log;
  logs::Survey survey;
};

/// [s] since the log's clock was 0.
double seconds_of(logs::Stamp stamp) { return stamp == logs::no_stamp ? NAN : 1e-9 * static_cast<double>(stamp); }

py::object damage_text(const std::optional<logs::Damage>& damage) {
  return damage ? py::object(py::str(damage->what)) : py::none();
}

std::unique_ptr<LogFile> open_log_file(const std::string& file, const std::vector<std::string>& msg_paths,
                                       const py::object& progress) {
  auto made = std::make_unique<LogFile>();
  do_watched(progress, [&](Job&) {
    made->log = logs::open_log(file, {.msg_paths = {msg_paths.begin(), msg_paths.end()}});
    made->survey = logs::survey(*made->log);
  });
  return made;
}

py::dict log_topics(const LogFile& self) {
  using Topic = logs::TopicSurvey;
  Columns columns(self.survey.topics);
  columns.objects("topic", [](const Topic& t) { return t.topic.name; });
  columns.objects("type", [](const Topic& t) { return t.topic.type; });
  columns.objects("records", [](const Topic& t) { return t.count; });
  columns.numbers("first", [](const Topic& t) { return seconds_of(t.first); });
  columns.numbers("last", [](const Topic& t) { return seconds_of(t.last); });
  columns.numbers("usual_interval", [](const Topic& t) { return t.usual_interval; });
  columns.numbers("longest_gap", [](const Topic& t) { return t.longest_gap; });
  columns.numbers("largest_lateness", [](const Topic& t) { return t.largest_lateness; });
  columns.objects("backwards", [](const Topic& t) { return t.backwards; });
  columns.objects("not_understood", [](const Topic& t) { return t.unreadable; });
  return columns.take();
}

/// A field with the topic that it is of.
struct FieldRow {
  const logs::TopicSurvey* topic;
  const logs::FieldSurvey* field;
  double value(double of_values) const { return field->count > 0 ? of_values : NAN; }
};

py::dict log_fields(const LogFile& self) {
  std::vector<FieldRow> rows;
  for (const logs::TopicSurvey& topic : self.survey.topics)
    for (const logs::FieldSurvey& field : topic.fields) rows.push_back({&topic, &field});
  Columns columns(rows);
  columns.objects("signal", [](const FieldRow& r) {
    const std::string& topic = r.topic->topic.name;
    return topic.empty() ? r.field->name : topic + ":" + r.field->name;
  });
  columns.objects("values", [](const FieldRow& r) { return r.field->count; });
  columns.objects("missing", [](const FieldRow& r) { return r.topic->count - r.field->count; });
  columns.numbers("least", [](const FieldRow& r) { return r.value(r.field->least); });
  columns.numbers("most", [](const FieldRow& r) { return r.value(r.field->most); });
  return columns.take();
}

/// Values of a topic's fields, as they are read.
struct Values {
  std::vector<double> time, received;
  std::vector<std::vector<double>> by_field;
  std::optional<logs::Damage> damage;
};

Values read_values(const logs::Log& log, int topic, const logs::FieldRequest& request, const Job& job) {
  Values values;
  values.by_field.resize(request.fields.size());
  const auto reader = log.reader(topic, request);
  std::vector<bool> wanted(log.topics().size());
  wanted[static_cast<std::size_t>(topic)] = true;
  std::vector<double> record_values(request.fields.size());
  std::optional<logs::Damage> undecoded;
  values.damage = log.read(wanted, [&](const logs::Record& record) {
    try {
      values.time.push_back(seconds_of(reader->read(record, record_values.data())));
    } catch (const logs::RecordError& error) {
      undecoded = log.damage_at(record, error);
      return false;
    }
    values.received.push_back(seconds_of(record.received));
    for (std::size_t i = 0; i < record_values.size(); ++i) values.by_field[i].push_back(record_values[i]);
    return !job.is_stopped();
  });
  if (undecoded) values.damage = std::move(undecoded);
  return values;
}

/// (columns, damage): time, received, and the fields of one topic by their names.
py::tuple read_log(const LogFile& self, const std::string& topic, const std::vector<std::string>& fields,
                   const std::string& clock, const py::object& progress) {
  Values values;
  do_watched(progress, [&](Job& job) {
    values = read_values(*self.log, self.log->topic(topic), {fields, clock}, job);
  });
  py::dict columns;
  columns["time"] = copy(values.time);
  columns["received"] = copy(values.received);
  for (std::size_t i = 0; i < fields.size(); ++i) columns[py::str(fields[i])] = copy(values.by_field[i]);
  return py::make_tuple(columns, damage_text(values.damage));
}

/// (text, the same as dicts) of the section `signals` that is proposed for the vehicle of a scenario.
py::tuple propose_for(const LogFile& self, const std::vector<std::string>& plugin_path, const Settings& settings) {
  const sim::ReplayScenario scenario(examined_host(plugin_path), settings);
  const std::string text = logs::propose_signals(self.survey, scenario.variants().front().robot.model()->description());
  return py::make_tuple(text, object_of(parse_yaml(text, "proposal")));
}

}  // namespace

void bind_log_files(py::module_& module) {
  py::class_<LogFile>(module, "LogFile")
      .def_property_readonly("name", [](const LogFile& self) { return self.log->name(); })
      .def_property_readonly("damage", [](const LogFile& self) { return damage_text(self.survey.damage); })
      .def("topics", &log_topics)
      .def("fields", &log_fields)
      .def("read", &read_log, py::arg("topic"), py::arg("fields"), py::arg("clock"), py::arg("progress"))
      .def("propose", &propose_for, py::arg("plugin_path"), py::arg("settings"))
      .def("__reduce_ex__", not_copied("open the file where it is used"));
  module.def("open_log", &open_log_file, py::arg("file"), py::arg("msg_paths"), py::arg("progress"));
}

}  // namespace rhec::python
