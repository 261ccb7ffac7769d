// The formats that are texts.
#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "apps/ros/ros_options.hpp"
#include "fuzz/targets.hpp"
#include "plugins/host/verdict.hpp"
#include "rhec/core/term/term_functions.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/plugins/equations/equation_term.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "rhec/sim/problems/problem_format.hpp"
#include "rhec/sim/study/sweep.hpp"
#include "rhec/sim/world/faults.hpp"
#include "rhec/sim/world/sensor_schedule.hpp"

namespace rhec::fuzz {
namespace {

/// All that a controller asks of terms: a node's data and bounds, then values, slopes and curvature at every stage.
void evaluate(const TermFunctions& functions, const TermPlace& place) {
  std::vector<double> arguments(static_cast<std::size_t>(functions.argument_row()), 0.5);
  const auto limits = static_cast<std::size_t>(functions.limit_count());
  std::vector<double> lower(limits), upper(limits), scratch(functions.scratch_size());
  const std::size_t first_data = arguments.size() - static_cast<std::size_t>(functions.data_count());
  functions.terms().front().term->write_data(place, arguments.data() + first_data, lower.data(), upper.data());
  using enum TermFunctions::Stage;
  for (const TermFunctions::Stage stage : {first, middle, last}) {
    const TermFunctions::Rows& rows = functions.rows(stage);
    std::vector<double> values(static_cast<std::size_t>(rows.count())), slopes(rows.slopes.size()),
        weights(values.size(), 1.0), bends(rows.bends.size());
    functions.evaluate(stage, 1, arguments.data(), values.data(), slopes.data(), scratch.data());
    functions.curve(stage, 1, arguments.data(), weights.data(), bends.data(), scratch.data());
  }
}

}  // namespace

void configuration(std::string_view input) {
  answered([&] {
    const Settings settings = parse_yaml(std::string(input), "fuzz.yaml");
    answered([&] { sim::ScenarioOptions::table().parse(settings, "scenario"); });
    answered([&] { sim::LogScenarioOptions::table().parse(settings, "log"); });
    if (const Settings* ros = settings.find("ros"))
      answered([&] { apps::ros::read_lever_arms(apps::ros::read_ros_options(*ros).lever_arms); });
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

void term(std::string_view input) {
  static const std::shared_ptr<const Model> model = load_vehicle(RHEC_SOURCE "/examples/vehicles/bicycle.yaml");
  answered([&] {
    const std::shared_ptr<const Term> made = load_inline_term(parse_yaml(std::string(input), "fuzz.yaml"));
    const TermFunctions functions(*model, {{"it", made}});
    evaluate(functions, {.time = 1.0, .x = 2.0, .y = 3.0, .heading = 0.5, .speed = 2.0, .arc_length = 4.0});
    evaluate(functions, {.left = 1.0, .right = 1.0});
  });
}

void sweep(std::string_view input) {
  answered([&] {
    const sim::Sweep sweep(parse_yaml(std::string(input), "fuzz.yaml"));
    for (const std::int64_t run : {std::int64_t{0}, sweep.count() / 2, sweep.count() - 1})
      answered([&] {
        static_cast<void>(sweep.settings(run));
        static_cast<void>(sweep.assignments(run));
      });
  });
}

void verdict(std::string_view input) {
  const auto taken = [](std::string_view text) {
    Verdict found;
    for (const auto& [key, value] : report_lines(text)) {
      static_cast<void>(stamp_from(value));
      static_cast<void>(take_line(key, value, found));
    }
    return found;
  };
  const std::string written = lines_of(taken(input));
  if (lines_of(taken(written)) != written) throw std::logic_error("a verdict is not what was written down");
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
