// What limits cost: a controller of a vehicle with jerk inputs (6 states, 2 inputs, 15 intervals) that follows a moving
// reference past obstacles, in a corridor. Compared are the stage QPs of all samples with and without their 5 limits a
// stage: a corridor, three obstacles (a half-plane each, as linearised), and a limit on both accelerations. Prints
// medians and 99th percentiles of preparation, and of feedback, in microseconds.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/qp/stage_qp_solver.hpp"
#include "rhec/core/qp/stage_qp_views.hpp"

namespace rhec::bench {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity(), step = 0.1;
constexpr int intervals = 15, states = 6, controls = 2, limits = 5;

enum class Softness { none, linear, quadratic };

struct Course {
  bool has_limits;
  Softness softness;
  double obstacle_radius, corridor, acceleration;
};

/// The state is [x, vx, ax, y, vy, ay]; the reference drives at 1 m/s along y = 0.6 sin(0.5 x).
void write(StageQp& qp, const Course& course, double time, const double* now, const Iterate& last) {
  qp.set_intervals(intervals);
  qp.initial_state_is_given = true;
  std::copy_n(now, states, qp.initial_step());
  for (int i = 0; i <= intervals; ++i) {
    const int m = i < intervals ? controls : 0;
    qp.set_sizes(i, states, m);
    const double x = time + step * i, y = 0.6 * std::sin(0.5 * x);
    const double weights[states] = {10.0, 1.0, 0.1, 10.0, 1.0, 0.1}, target[states] = {x, 1.0, 0.0, y, 0.0, 0.0};
    for (int j = 0; j < states; ++j) {
      Q_of(qp, i)(j, j) = weights[j];
      qp.q(i)[j] = -weights[j] * target[j];
    }
    for (int k = 0; k < m; ++k) {
      R_of(qp, i)(k, k) = 0.02;
      qp.control_lower(i)[k] = -4.0;
      qp.control_upper(i)[k] = 4.0;
      for (int r = 0; r < 3; ++r) {
        double* row = qp.AB(i) + (3 * k + r) * qp.stride();
        for (int c = r; c < 3; ++c) row[3 * k + c] = c == r ? 1.0 : c == r + 1 ? step : 0.5 * step * step;
        row[states + k] = r == 0 ? step * step * step / 6.0 : r == 1 ? 0.5 * step * step : step;
      }
    }
    if (!course.has_limits || i == 0) continue;
    qp.set_limits(i, limits);
    double* G = qp.G(i);
    std::fill_n(G, limits * qp.stride(), 0.0);
    const auto set = [&](int r, double lower, double upper) {
      qp.limit_lower(i)[r] = lower;
      qp.limit_upper(i)[r] = upper;
      qp.limit_linear(i)[r] = course.softness == Softness::none ? infinity : 20.0;
      qp.limit_quadratic(i)[r] = course.softness == Softness::quadratic ? 100.0 : 0.0;
    };
    G[3] = 1.0;
    set(0, -course.corridor, course.corridor);
    // Obstacles stand beside the reference, one every 3 m; the next three are looked at.
    const double px = last.state(std::min(i + 1, intervals))[0], py = last.state(std::min(i + 1, intervals))[3];
    for (int o = 0; o < 3; ++o) {
      const double ox = 3.0 * (std::floor((time - 0.5) / 3.0) + 1 + o),
                   oy = 0.6 * std::sin(0.5 * ox) + (o % 2 ? 0.35 : -0.35);
      const double dx = px - ox, dy = py - oy, distance = std::hypot(dx, dy) + 1e-6;
      double* row = G + (1 + o) * qp.stride();
      row[0] = dx / distance;
      row[3] = dy / distance;
      set(1 + o, course.obstacle_radius + row[0] * ox + row[3] * oy, infinity);
    }
    double* row = G + 4 * qp.stride();
    row[2] = row[5] = 1.0;
    set(4, -course.acceleration, course.acceleration);
  }
}

struct Times {
  std::vector<double> preparation, feedback;
  int active_samples = 0, changed = 0, robust = 0, infeasible = 0, violated = 0;
  double active_rows = 0.0;
};

Times drive(const Course& course, int samples) {
  const Capacity capacity{intervals, states, controls, course.has_limits ? limits : 0};
  StageQp qp(capacity);
  StageQpSolver solver(capacity);
  Iterate guess(capacity), solution(capacity);
  double now[states] = {0.0, 1.0, 0.0, 0.0, 0.3, 0.0};
  for (int i = 0; i <= intervals; ++i) guess.state(i)[0] = step * i;
  Times times;
  std::vector<int> before;
  for (int sample = 0; sample < samples; ++sample) {
    write(qp, course, step * sample, now, guess);
    const auto start = std::chrono::steady_clock::now();
    solver.guess_from(qp, guess);
    solver.prepare(qp);
    const auto prepared = std::chrono::steady_clock::now();
    const auto outcome = solver.solve(qp, solution);
    const auto end = std::chrono::steady_clock::now();
    const auto us = [](auto d) { return std::chrono::duration<double, std::micro>(d).count(); };
    times.preparation.push_back(us(prepared - start));
    times.feedback.push_back(us(end - prepared));
    times.robust += outcome == StageQpSolver::Outcome::interior_point;
    if (outcome == StageQpSolver::Outcome::infeasible) {
      ++times.infeasible;
      solution = guess;
    }
    std::vector<int> active;
    for (int i = 0; course.has_limits && i <= intervals; ++i)
      for (int r = 0; r < qp.limits(i); ++r)
        if (const double size = std::abs(solution.limit_bound(i)[r]); size > 0.0) {
          active.push_back((i + sample) * limits + r);
          times.violated += size >= qp.limit_linear(i)[r];
        }
    times.active_samples += !active.empty();
    times.active_rows += static_cast<double>(active.size());
    times.changed += active != before;
    before = active;
    std::copy_n(solution.state(1), states, now);
    // The shifted guess.
    for (int i = 0; i < intervals; ++i) {
      std::copy_n(solution.row(i + 1), capacity.row(), guess.row(i));
      std::copy_n(solution.bound_row(i + 1), capacity.row(), guess.bound_row(i));
      std::copy_n(solution.costate(i + 1), capacity.row(), guess.costate(i));
      if (course.has_limits) std::copy_n(solution.limit_bound(i + 1), capacity.limit_row(), guess.limit_bound(i));
    }
  }
  return times;
}

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * (static_cast<double>(values.size()) - 1.0))];
}

void report(const std::string& name, const Times& t) {
  std::vector<double> both;
  for (std::size_t k = 0; k < t.feedback.size(); ++k) both.push_back(t.preparation[k] + t.feedback[k]);
  fmt::print(
      "{:32} both {:6.1f} p99 {:6.1f} | preparation {:6.1f} p99 {:6.1f} | feedback {:6.1f} p99 {:6.1f} max {:7.1f} us "
      "| rows "
      "{:5.2f} violated {:5.2f}, set changes {:5.1f} %, interior point {}, infeasible {}\n",
      name, quantile(both, 0.5), quantile(both, 0.99), quantile(t.preparation, 0.5), quantile(t.preparation, 0.99),
      quantile(t.feedback, 0.5), quantile(t.feedback, 0.99), quantile(t.feedback, 1.0),
      t.active_rows / static_cast<double>(both.size()), t.violated / static_cast<double>(both.size()),
      100.0 * t.changed / static_cast<double>(both.size()), t.robust, t.infeasible);
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) {
  using namespace rhec::bench;
  const int samples = count > 1 ? std::atoi(words[1]) : 20000;
  report("no limits", drive({false, Softness::none, 0.0, 0.0, 0.0}, samples));
  report("hard, none active", drive({true, Softness::none, -10.0, 5.0, 50.0}, samples));
  report("hard, corridor", drive({true, Softness::none, -10.0, 0.58, 50.0}, samples));
  report("hard, corridor and obstacles", drive({true, Softness::none, 0.3, 0.58, 1.5}, samples));
  report("soft, linear", drive({true, Softness::linear, 0.45, 0.55, 1.5}, samples));
  report("soft, linear and quadratic", drive({true, Softness::quadratic, 0.45, 0.55, 1.5}, samples));
  return 0;
}
