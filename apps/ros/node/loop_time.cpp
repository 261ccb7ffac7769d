// What the loop does with the time of /clock: it waits for it, stands still with it, and begins anew where it jumps
// back.
#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "loop.hpp"

namespace rhec::apps::ros {
namespace {

// Clocks of recordings tick ten times a second and more: one that has not for so long stands still [s].
constexpr double least_standstill = 0.5;

}  // namespace

void Loop::hear_clock(logs::Stamp clock, Clock::time_point received) {
  if (!time_.is_known()) say("the time begins on " + options_.names.clock);
  if (std::exchange(has_told_standstill_, false)) say("the time goes on");
  if (const std::optional<double> back = time_.take(clock, received)) begin_anew(*back);
}

/// Whoever plays a recording in a circle, or begins a simulation anew, sets the robot back to another place: nothing of
/// what was estimated holds.
void Loop::begin_anew(double back) {
  say(fmt::format("the time jumped back by {:.3g} s: estimates begin anew", back));
  stop_robot();
  if (controller_) controller_->finish();
  if (estimator_) estimator_->end_drive();
  estimator_.reset();
  controller_.reset();
  intake_.begin_anew();
  forget_inputs_and_outputs();
  obstacles_.clear();
  last_measured_ = last_received_ = due_ = time_.instant();
  is_triggered_ = has_driven_ = is_finished_ = false;
  rests_ = true;
  driving_ = Driving::waiting;
  {
    const std::lock_guard lock(mutex_);
    slip_ahead_.reset();
    next_controller_.reset();
  }
  ++jumps_;
}

/// While the time stands still no step is due; a robot that is driven all the same must not go on.
void Loop::watch_clock() {
  if (!time_.is_simulated()) return;
  const double silence = time_.silence(Clock::now());
  if (silence <= std::max(options_.command.timeout, least_standstill)) return;
  if (!std::exchange(has_told_standstill_, true))
    say(fmt::format("the time stands still: nothing came on {} for {:.2g} s", options_.names.clock, silence));
  driving_ = Driving::clock;
  if (command_writer_ < 0 || !has_driven_) return;
  rests_ = true;
  if (!wire_.write(command_writer_, command_message_.stop(time_.now(), options_.frames.vehicle))) ++report_.unsent;
}

}  // namespace rhec::apps::ros
