#include "rhec/sim/replay/replay_input.hpp"

#include <algorithm>
#include <utility>

namespace rhec::sim {
namespace {

/// Progress of one part of several equal ones.
std::function<void(double)> part_of(const LoopHooks& hooks, int part, int parts) {
  if (!hooks.progress) return {};
  return [shown = hooks.progress, part, parts](double share) { shown((part + share) / parts); };
}

}  // namespace

ReplayInput::ReplayInput(ReplayScenario asking, const HoldOut& withheld, const logs::Log& recorded)
    : scenario(std::move(asking)), hold_out(withheld), log(recorded.name()) {
  for (const ReplayVariant& variant : scenario.variants()) drives.push_back(read_drive(recorded, variant.signals));
}

std::int64_t ReplayInput::estimates(std::size_t variant) const {
  const std::vector<logs::DriveEvent>& events = drives[variant].events;
  if (events.empty()) return 0;
  const double seconds = events.back().arrival - events.front().time;
  return static_cast<std::int64_t>(std::max(0.0, seconds) / scenario.variants()[variant].robot.step()) + 1;
}

DriveResult estimate_variant(const ReplayInput& input, std::size_t variant, const LoopHooks& hooks,
                             std::shared_ptr<const RobotHooks> withheld_robot) {
  const ReplayVariant& asked = input.scenario.variants()[variant];
  const logs::Drive& drive = input.drives[variant];
  const int parts = input.hold_out.every > 0 ? 2 : 1;
  LoopHooks first = hooks;
  first.progress = part_of(hooks, 0, parts);
  DriveResult result;
  result.all = replay_drive(asked.robot, drive, {}, input.scenario.simulated_start(), first);
  result.all.name = asked.name;
  // Accuracy is that of a replay of its own: the estimates have all measurements.
  if (parts > 1)
    result.withheld = replay_drive(asked.robot, drive, input.hold_out, input.scenario.simulated_start(),
                                   {.progress = part_of(hooks, 1, parts), .robot = std::move(withheld_robot)});
  return result;
}

SmoothedVariant smooth_variant(const ReplayInput& input, std::size_t variant, const LoopHooks& hooks) {
  const ReplayVariant& asked = input.scenario.variants()[variant];
  const logs::Drive& drive = input.drives[variant];
  const int parts = input.hold_out.every > 0 ? 2 : 1;
  LoopHooks first = hooks;
  first.progress = part_of(hooks, 0, parts);
  SmoothedVariant result;
  result.all = smooth_drive(asked.name, asked.robot, drive, {}, input.scenario.simulated_start(), first);
  if (parts > 1)
    result.withheld = smooth_drive(asked.name, asked.robot, drive, input.hold_out, input.scenario.simulated_start(),
                                   {.progress = part_of(hooks, 1, parts)})
                          .smoothed;
  return result;
}

std::string write_drive_files(OutputFolder& folder, const ReplayInput& input, const std::vector<DriveResult>& results,
                              const DriveReplay* beside) {
  const Robot& robot = input.scenario.variants().front().robot;
  const logs::Drive& drive = input.drives.front();
  folder.write("estimates.csv", drive_estimates_csv(results, robot));
  folder.write("measurements.csv", measurements_csv(results.front(), robot, drive));
  folder.write("innovations.csv", innovations_csv(results, robot));
  folder.write("predictions.csv", predictions_csv(results, robot));
  folder.write("times.csv", drive_times_csv(results));
  std::string summary = drive_summary_json(results, input.scenario.name(), robot, drive, input.log, input.hold_out);
  folder.write("summary.json", summary);
  folder.write("run.svg", drive_svg(results.front(), input.scenario.name(), robot, drive, beside));
  return summary;
}

}  // namespace rhec::sim
