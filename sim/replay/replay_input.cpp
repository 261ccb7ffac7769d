#include "rhec/sim/replay/replay_input.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace rhec::sim {
namespace {

/// Progress of one part of several equal ones.
std::function<void(double)> part_of(const LoopHooks& hooks, int part, int parts) {
  if (!hooks.progress) return {};
  return [shown = hooks.progress, part, parts](double share) { shown((part + share) / parts); };
}

/// The two replays of a variant: with all measurements, and, if some are withheld, without those.
struct Parts {
  Parts(const ReplayInput& input, std::size_t variant, const LoopHooks& hooks)
      : asked(input.scenario.variants()[variant]),
        drive(input.drives[variant]),
        start(input.scenario.simulated_start()),
        first(hooks) {
    const int parts = input.hold_out.every > 0 ? 2 : 1;
    first.progress = part_of(hooks, 0, parts);
    if (parts > 1) second = LoopHooks{.progress = part_of(hooks, 1, parts)};
  }
  const ReplayVariant& asked;
  const logs::Drive& drive;
  const std::optional<Eigen::VectorXd>& start;
  LoopHooks first;
  std::optional<LoopHooks> second;
};

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
  const Parts of(input, variant, hooks);
  DriveResult result;
  result.all = replay_drive(of.asked.robot, of.drive, {}, of.start, of.first);
  result.all.name = of.asked.name;
  // Accuracy is that of a replay of its own: the estimates have all measurements.
  if (!of.second) return result;
  LoopHooks second = *of.second;
  second.robot = std::move(withheld_robot);
  result.withheld = replay_drive(of.asked.robot, of.drive, input.hold_out, of.start, second);
  return result;
}

SmoothedVariant smooth_variant(const ReplayInput& input, std::size_t variant, const LoopHooks& hooks) {
  const Parts of(input, variant, hooks);
  SmoothedVariant result;
  result.all = smooth_drive(of.asked.name, of.asked.robot, of.drive, {}, of.start, of.first);
  if (of.second)
    result.withheld =
        smooth_drive(of.asked.name, of.asked.robot, of.drive, input.hold_out, of.start, *of.second).smoothed;
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
