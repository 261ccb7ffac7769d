// The formats that are texts.
#include <memory>
#include <string>
#include <vector>

#include "fuzz/targets.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "rhec/sim/problems/problem_format.hpp"
#include "rhec/sim/world/faults.hpp"
#include "rhec/sim/world/sensor_schedule.hpp"

namespace rhec::fuzz {
void configuration(std::string_view input) {
  answered([&] {
    const Settings settings = parse_yaml(std::string(input), "fuzz.yaml");
    answered([&] { sim::ScenarioOptions::table().parse(settings, "scenario"); });
    answered([&] { sim::LogScenarioOptions::table().parse(settings, "log"); });
    if (const Settings* faults = settings.find("faults")) {
      ModelDescription about;
      about.outputs = {{"x_gps", "m", ""}, {"y_gps", "m", ""}, {"delta", "rad", ""}};
      about.inputs = {{"u1", "m/s", ""}, {"u2", "rad/s", ""}};
      answered([&] { sim::read_faults(*faults, about); });
    }
  });
}

void scenario(std::string_view input) {
  static const Host host;
  answered([&] { sim::Scenario(host, parse_yaml(std::string(input), "fuzz.yaml")); });
}

void vehicle(std::string_view input) {
  answered([&] {
    Settings settings;
    settings.set("equations", parse_yaml(std::string(input), "fuzz.yaml"));
    const auto model = load_inline_vehicle(settings);
    std::vector<double> states(static_cast<std::size_t>(model->state_count()), 0.5), rates(states.size());
    const std::vector<double> inputs(static_cast<std::size_t>(model->input_count()), 0.5);
    const std::vector<double> parameters(static_cast<std::size_t>(model->parameter_count()), 0.5);
    model->rates(states.data(), inputs.data(), parameters.data(), rates.data());
  });
}

void problems(std::string_view input) {
  static const std::shared_ptr<Model> model = load_vehicle(RHEC_SOURCE "/examples/vehicles/bicycle.yaml");
  answered([&] {
    for (const sim::ProblemRecord& record : sim::read_problems(input, "fuzz.jsonl"))
      answered([&] { static_cast<void>(sim::problem_format(record.kind).build(record, model, record.intervals, {})); });
  });
}

void message_definitions(std::string_view input) {
  const std::string type = "pkg/msg/A";
  for (const auto parse : {logs::parse_ros2msg, logs::parse_ros2idl})
    answered([&] {
      logs::Definitions definitions = logs::builtin_definitions();
      parse(type, input, definitions);
      static_cast<void>(logs::ros2msg_text(type, definitions));
    });
}

void csv(std::string_view input) {
  for (const sim::CsvHeader header : {sim::CsvHeader::none, sim::CsvHeader::required, sim::CsvHeader::optional})
    answered([&] {
      const sim::CsvTable table = sim::parse_csv(input, "fuzz.csv", {.header = header});
      if (table.columns() > 0) sim::check_time_order(table);
    });
}

}  // namespace rhec::fuzz
