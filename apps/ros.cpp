#include <memory>

#include "command.hpp"
#include "commands.hpp"
#include "crash_report.hpp"
#include "output.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "ros/live.hpp"

namespace rhec::apps {
namespace {

int run(const ros::LiveArguments& arguments) {
  Settings settings = load_yaml(arguments.file);
  apply_assignments(settings, arguments.assignments);
  const Host host = examined_host(arguments.plugin_path);
  return arguments.simulate ? ros::run_robot(host, std::move(settings), arguments)
                            : ros::run_node(host, std::move(settings), arguments);
}

}  // namespace

void add_ros(Program& program) {
  auto arguments = std::make_shared<ros::LiveArguments>();
  Command command = program.add(
      "ros", "Estimates and steers live, as a node of ROS 2; ROS itself is not needed.",
      "The section `signals` of the file says which topics are the model's outputs and inputs, the section `ros` all\n"
      "else. Nobody is steered unless ros.command.steer is true, and nothing but the loopback interface is heard "
      "unless\n"
      "another one is named. Ctrl-C stops the robot, then the node. --simulate is the other end: a simulated robot "
      "that\n"
      "publishes the sensors of the same file and obeys the commands.\n\n"
      "Examples:\n"
      "  rhec ros examples/ros/field_robot.yaml --simulate       in one terminal\n"
      "  rhec ros examples/ros/field_robot.yaml                  in another\n"
      "  rhec ros my_robot.yaml --interface eth0 --ros-distro humble\n"
      "  rhec ros my_robot.yaml --path field.csv --set ros.command.steer=true --priority 80 --cpu 3",
      [arguments] { return run(*arguments); });
  command.add("file", arguments->file, "a YAML file: a robot, or a scenario").required();
  command.add_flag("--simulate", arguments->simulate, "be the robot, in simulation");
  command.add("--path", arguments->path, "follow the waypoints of this table: x, y (, speed, ...)").value("FILE");
  command.add("--domain", arguments->domain, "of DDS; by default ROS_DOMAIN_ID, or 0").within(0, 232).value("ID");
  command.add("--interface", arguments->interface, "network interface, by name or address; by default ros.interface")
      .value("NAME");
  command
      .add("--ros-distro", arguments->distro,
           "what the other nodes run, e.g. humble or jazzy; by default ROS_DISTRO, or the newest")
      .value("NAME");
  command.add("--priority", arguments->priority, "real-time priority of the loop (SCHED_FIFO); 0: none")
      .within(0, 99)
      .value("N");
  command.add("--cpu", arguments->cpu, "the processor that the loop runs on").within(0, 1023).value("N");
  command.add_flag("--once", arguments->once, "end where the path ends");
  command.add("--seconds", arguments->seconds, "end after this time [s]").positive().value("S");
  command.add_list("--msg-path", arguments->msg_paths, "folder of packages with further message definitions")
      .value("DIR");
  add_json(command, arguments->json);
  add_assignments(command, arguments->assignments, "a key of the file");
  add_plugin_path(command, arguments->plugin_path);
}

}  // namespace rhec::apps
