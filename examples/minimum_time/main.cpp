// A car turns round in a narrow lane in the shortest time: forwards, in reverse and forwards again, past an obstacle.
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <string>

#include "minimum_time_problem.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace {

constexpr double pi = std::numbers::pi;

/// A first guess, which says what kind of manoeuvre is meant: a third of the time forwards, one in reverse, one
/// forwards, while the car turns evenly.
rhec::Iterate guess_for(const MinimumTimeProblem& problem, const MinimumTimeProblem::Setup& setup, double time) {
  rhec::Iterate iterate(problem.capacity());
  const int N = problem.intervals();
  double x = setup.start[0], y = setup.start[1];
  for (int i = 0; i <= N; ++i) {
    const double share = static_cast<double>(i) / N;
    const bool in_reverse = share > 1.0 / 3.0 && share < 2.0 / 3.0;
    const double speed = in_reverse ? -0.7 * setup.reverse : 0.5 * setup.forwards;
    const double heading = setup.start[2] + share * (setup.goal[2] - setup.start[2]);
    double* s = iterate.state(i);
    const double at[] = {x, y, heading, in_reverse ? -0.3 : 0.3, speed, time};
    std::copy_n(at, MinimumTimeProblem::ns, s);
    x += time / N * speed * std::cos(heading);
    y += time / N * speed * std::sin(heading);
  }
  std::copy_n(setup.start.data(), MinimumTimeProblem::nx, iterate.state(0));
  std::copy_n(setup.goal.data(), MinimumTimeProblem::nx, iterate.state(N));
  return iterate;
}

/// The lane, the obstacle and the car at every third node; in reverse it is red.
void draw(const MinimumTimeProblem& problem, const MinimumTimeProblem::Setup& setup, const rhec::Iterate& iterate,
          const char* file) {
  std::ofstream out(file);
  out << "<svg xmlns='http://www.w3.org/2000/svg' viewBox='-6 -9 20 14' width='1000' height='700'>"
      << "<rect x='-6' y='-9' width='20' height='14' fill='white'/><g transform='scale(1,-1)'>";
  const double radius = setup.clearance - 1.0;
  out << "<circle cx='" << setup.car.obstacle_x << "' cy='" << setup.car.obstacle_y << "' r='" << radius
      << "' fill='#888'/>";
  for (int i = 0; i <= problem.intervals(); i += 3) {
    const double* s = iterate.state(i);
    out << "<rect x='-0.7' y='-0.9' width='" << setup.car.wheelbase + 1.4 << "' height='1.8' fill='none' stroke='"
        << (s[4] < 0.0 ? "#c0392b" : "#1f5fa8") << "' stroke-width='0.05' transform='translate(" << s[0] << ' ' << s[1]
        << ") rotate(" << s[2] * 180.0 / pi << ")'/>";
  }
  out << "</g></svg>\n";
  if (!out.flush()) throw rhec::Error(std::string(file) + ": cannot be written; choose another file");
}

}  // namespace

int main(int count, char** words) try {
  if (count > 3) throw rhec::Error("expected: minimum_time [SOLVER [PICTURE.svg]]");
  const rhec::Host host;
  const std::string name = count > 1 ? words[1] : "ipopt";
  const rhec::Settings options = name == "ipopt" || name == "sparse_sqp"
                                     ? rhec::parse_yaml("{max_iterations: 500}", "options of the solver")
                                     : rhec::Settings::map();
  const auto solver = host.make_solver(name, options);
  MinimumTimeProblem::Setup setup;
  setup.start = {0.0, 0.0, 0.0, 0.0, 0.0};
  setup.goal = {0.0, 3.0, pi, 0.0, 0.0};
  setup.car.obstacle_x = 6.5;
  setup.car.obstacle_y = 3.5;
  const MinimumTimeProblem problem(setup);
  if (const std::string reason = solver->why_not(problem); !reason.empty()) throw rhec::Error(name + ": " + reason);

  rhec::Iterate iterate = guess_for(problem, setup, 10.0);
  solver->setup(problem);
  const rhec::Report report = solver->solve(iterate);
  int changes = 0;
  double nearest = rhec::infinity, direction = 1.0;
  for (int i = 0; i <= problem.intervals(); ++i) {
    const double* s = iterate.state(i);
    if (s[4] * direction < -1e-3) {
      direction = -direction;
      ++changes;
    }
    nearest = std::min(nearest, std::hypot(s[0] + setup.car.wheelbase * std::cos(s[2]) - setup.car.obstacle_x,
                                           s[1] + setup.car.wheelbase * std::sin(s[2]) - setup.car.obstacle_y));
  }
  std::printf(
      "%s after %d iterations, KKT residual %.1e: T %.4f s, %d changes of direction, front axle %.3f m from the "
      "obstacle\n",
      rhec::name_of(report.status), report.iterations, report.kkt.largest(), iterate.state(0)[5], changes, nearest);
  if (count > 2) draw(problem, setup, iterate, words[2]);
  return report.status == rhec::Status::solved ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
