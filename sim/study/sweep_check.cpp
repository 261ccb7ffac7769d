// Checks of a sweep before it starts: its runs and whether their values are valid.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/study/sweep.hpp"
#include "rhec/sim/world/truth_estimator.hpp"

namespace rhec::sim {
namespace {

/// Constructs what a run needs before its first sample; throws Error for invalid settings.
void make_parts(const Host& host, const Settings& settings) {
  const Scenario scenario(host, settings);
  Robot robot = scenario.robot();
  const TruthVehicle truth(*robot.model(), scenario.terrain(), scenario.initial_state(), scenario.vehicle());
  robot.use_estimators(scenario_estimators(&truth));
  const MemorySection& memory = robot.memory();
  if (memory.is_given() && !memory.options().file.empty())
    throw memory.section().error("a map in a file is for single drives; runs of a sweep remember places without one");
  robot.make_estimator(scenario.initial_state());
  robot.make_controller(scenario.path());
}

}  // namespace

std::vector<RunIdentity> Sweep::identities() const {
  std::vector<RunIdentity> all;
  all.reserve(static_cast<std::size_t>(count_));
  for (std::int64_t run = 0; run < count_; ++run) all.push_back(identity_of(canonical_text(settings(run))));
  std::vector<std::int64_t> order(all.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::int64_t a, std::int64_t b) { return all[a] < all[b]; });
  const auto twice =
      std::adjacent_find(order.begin(), order.end(), [&](std::int64_t a, std::int64_t b) { return all[a] == all[b]; });
  if (twice == order.end()) return all;
  const std::int64_t first = *twice, second = *std::next(twice);
  const auto [block, indices] = place_of(second);
  const Values& values = block->axes.front().values.front();
  throw(values.listed.empty() ? Settings::null(values.origin) : values.listed.front())
      .error(fmt::format("two runs of the grid are the same: run {} ({}) and run {} ({}); take one of them out",
                         first + 1, assignments(first), second + 1, assignments(second)));
}

void Sweep::check_values(const Host& host, const std::function<void()>& between) const {
  for (const Block& block : blocks_) check_values(host, block, between);
}

void Sweep::check_values(const Host& host, const Block& block, const std::function<void()>& between) const {
  // The ends of a range suffice: valid values lie between two bounds or are integers.
  constexpr std::int64_t ends = 8, most_mates = 12;
  const std::size_t axes = block.axes.size();
  std::vector<Indices> tried(axes);
  std::vector<std::vector<bool>> fits(axes);
  std::int64_t longest = 0;
  for (std::size_t a = 0; a < axes; ++a) {
    const Axis& axis = block.axes[a];
    const bool is_listed = std::any_of(axis.values.begin(), axis.values.end(),
                                       [](const Values& values) { return !values.listed.empty(); });
    for (std::int64_t i = 0; i < axis.count; ++i) {
      if (!is_listed && i == ends && axis.count > 2 * ends) i = axis.count - ends;
      tried[a].push_back(i);
    }
    fits[a].assign(tried[a].size(), false);
    longest = std::max<std::int64_t>(longest, std::ssize(tried[a]));
  }

  // Tries the combination at these indices of `tried`; returns its error.
  const auto why_not = [&](const Indices& places) -> std::string {
    if (between) between();
    Indices indices(axes);
    for (std::size_t a = 0; a < axes; ++a) indices[a] = tried[a][static_cast<std::size_t>(places[a])];
    try {
      make_parts(host, settings_of(block, indices));
    } catch (const Error& mistake) {
      return mistake.what();
    }
    for (std::size_t a = 0; a < axes; ++a) fits[a][static_cast<std::size_t>(places[a])] = true;
    return {};
  };
  const auto places_at = [&](std::int64_t turn) {
    Indices places(axes);
    for (std::size_t a = 0; a < axes; ++a) places[a] = turn % std::ssize(tried[a]);
    return places;
  };

  for (std::int64_t turn = 0; turn < longest; ++turn) why_not(places_at(turn));
  for (std::size_t a = 0; a < axes; ++a) {
    for (std::int64_t i = 0; i < std::ssize(tried[a]); ++i) {
      if (fits[a][static_cast<std::size_t>(i)]) continue;
      const Settings value = block.axes[a].values.front().at(tried[a][static_cast<std::size_t>(i)]);
      std::string reason;
      for (std::int64_t turn = 0; turn < std::min(longest, most_mates) && !fits[a][static_cast<std::size_t>(i)];
           ++turn) {
        Indices places = places_at(turn);
        places[a] = i;
        const std::string found = why_not(places);
        // Prefer the error that refers to this value's line.
        if (reason.empty() || (found.starts_with(value.where() + ":") && !reason.starts_with(value.where() + ":")))
          reason = found;
      }
      if (fits[a][static_cast<std::size_t>(i)]) continue;
      const bool others_fit = std::find(fits[a].begin(), fits[a].end(), true) != fits[a].end();
      if (others_fit && !reason.starts_with(value.where() + ":"))
        throw value.error(fmt::format("no run can have {}: {}", value.found(), reason));
      throw Error(reason);
    }
  }
}

}  // namespace rhec::sim
