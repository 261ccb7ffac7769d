// What typical drives say: magnitudes against scales, and which states and parameters the measurements tell.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "model_checks.hpp"

namespace rhec::sim {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double far_off = 100.0;           // between a magnitude and its scale
constexpr double ill_conditioned = 1e6;     // of the scaled Jacobian of F
constexpr double least_sigma = 1e-9;        // of noise, in scales, lest one measurement hides all others
constexpr double largest_null_part = 1e-6;  // of a unit vector, in what is not determined
constexpr double heading = 0.5;             // of the drives [rad]; along no axis

enum class Course { straight, turn, slalom, standing };
struct CourseName {
  Course course;
  const char *name, *meaning;
};
constexpr CourseName courses[] = {
    {Course::straight, "straight", "straight ahead"},
    {Course::turn, "turn", "a steady turn"},
    {Course::slalom, "slalom", "left and right in turn"},
    {Course::standing, "standing", "standing still"},
};

/// A drive over one horizon with the sensitivities of its intervals.
struct Drive {
  std::string name, meaning, unusable;
  Matrix states, inputs;                 ///< columns: nodes, intervals
  std::vector<Matrix> jacobians;         ///< by interval, dF/d[x; u; p] or dF/d[x; u; p; p_end]
  std::vector<Matrix> output_jacobians;  ///< by node
  Matrix outputs;                        ///< columns: nodes
};

/// Which unknown stands for a parameter on each interval.
struct Blocks {
  std::vector<std::vector<int>> unknown;  ///< by parameter and interval, counted from 0
  std::vector<std::vector<bool>> ramp;    ///< the interval on which it runs to that value
  std::vector<int> parameter_of;          ///< by unknown
};

bool is_role(const Roles& roles, int state) {
  const auto& others = roles.other_headings;
  return state == roles.position_x || state == roles.position_y || state == roles.heading ||
         std::find(others.begin(), others.end(), state) != others.end();
}

class Drives {
 public:
  explicit Drives(const CheckedModel& checked)
      : checked_(checked),
        about_(checked.about),
        nx_(checked.model.state_count()),
        nu_(checked.model.input_count()),
        np_(checked.model.parameter_count()),
        ny_(checked.model.output_count()),
        intervals_(std::min(checked.options.horizon, ModelCheckOptions::longest_horizon)) {
    for (const Variable& p : about_.parameters) {
      const double middle = 0.5 * (p.lower + p.upper);
      parameters_.push_back(std::isfinite(middle) ? middle : std::clamp(p.nominal, p.lower, p.upper));
    }
    const auto typical = typical_speed(checked);
    makes_speed_ = typical.has_value();
    speed_ = checked.options.speed.value_or(typical.value_or(1.0));
    find_blocks();
  }

  std::vector<Drive> all() {
    std::vector<Drive> drives;
    for (const CourseName& course : courses) drives.push_back(drive(course));
    return drives;
  }

  DriveInformation information(const Drive& drive) const;
  double condition_of_jacobians(const Drive& drive) const;
  const Blocks& blocks() const { return blocks_; }
  int intervals() const { return intervals_; }
  double duration() const { return intervals_ * checked_.options.interval; }

 private:
  void find_blocks() {
    const Window window{0, intervals_};
    std::vector<std::uint8_t> begins(intervals_);
    for (int j = 0; j < np_; ++j) {
      std::fill(begins.begin(), begins.end(), 0);
      const Blocking* blocking = checked_.options.blockings.empty() ? nullptr : checked_.options.blockings[j].get();
      if (blocking && blocking->why_not(intervals_).empty()) blocking->starts(window, begins.data());
      std::vector<int> unknown;
      std::vector<bool> ramp;
      for (int i = 0; i < intervals_; ++i) {
        if (i == 0 || begins[i]) blocks_.parameter_of.push_back(j);
        unknown.push_back(static_cast<int>(blocks_.parameter_of.size()) - 1);
        ramp.push_back(i > 0 && begins[i] && blocking->transition() == Transition::ramp);
      }
      blocks_.unknown.push_back(std::move(unknown));
      blocks_.ramp.push_back(std::move(ramp));
    }
  }

  double clamped(const Variable& v, double value) const { return std::clamp(value, v.lower, v.upper); }

  /// The inputs of going straight on or standing; the speeds among the states go to `state`.
  Vector base_inputs(Course course, Vector& state) const {
    Vector inputs = Vector::Zero(nu_);
    const double speed = course == Course::standing ? 0.0 : speed_;
    checked_.model.straight_motion(speed, parameters_.data(), state.data(), inputs.data());
    for (int j = 0; j < nu_; ++j)
      if (std::isfinite(inputs[j])) inputs[j] = clamped(about_.inputs[j], inputs[j]);
    return inputs;
  }

  /// How far the inputs leave those of the straight drive: half of what there is room for, or of a scale. Of inputs
  /// that all make speed (the wheels of two sides), every other one by a part of it up or down.
  Vector excitation(const Vector& base) const {
    Vector change = Vector::Zero(nu_);
    int driving = 0;
    for (int j = 0; j < nu_; ++j) driving += base[j] != 0.0;
    for (int j = 0, seen = 0; j < nu_; ++j) {
      const Variable& v = about_.inputs[j];
      if (base[j] != 0.0) {
        if (driving > 1) change[j] = 0.2 * std::abs(base[j]) * (seen++ % 2 == 0 ? 1.0 : -1.0);
        continue;
      }
      const double up = v.upper - base[j], down = base[j] - v.lower;
      change[j] = 0.5 * (up > 0.0 ? std::min(v.scale, up) : -std::min(v.scale, down));
    }
    return change;
  }

  /// By how much states leave the inner half of their bounds (their scale, where they have none), in scales.
  double excess(const Vector& x) const {
    double sum = 0.0;
    for (int j = 0; j < nx_; ++j) {
      if (is_role(about_.roles, j)) continue;
      const Variable& v = about_.states[j];
      const bool bounded = std::isfinite(v.lower) && std::isfinite(v.upper);
      const double middle = bounded ? 0.5 * (v.lower + v.upper) : 0.0;
      const double half = bounded ? 0.25 * (v.upper - v.lower) : v.scale;
      sum += std::max(0.0, std::abs(x[j] - middle) - half) / v.scale;
    }
    return sum;
  }

  Vector moved(const Vector& x, const Vector& u) const {
    Vector next(nx_);
    checked_.model.integrate({.count = 1,
                              .states = x.data(),
                              .inputs = u.data(),
                              .parameters = parameters_.data(),
                              .durations = &checked_.options.interval,
                              .substeps = checked_.options.substeps,
                              .next_states = next.data()});
    return next;
  }

  /// The inputs of interval k. What would drive a state too far (a steering angle, by its rate) is left out.
  Vector inputs_at(Course course, int k, const Vector& x, const Vector& base, const Vector& change) const {
    if (course == Course::straight || course == Course::standing) return base;
    // Left and right once within the horizon, twice as far as in the turn that goes on.
    const double phase = course == Course::turn ? 1.0 : 2.0 * std::cos(2.0 * std::numbers::pi * (k + 0.5) / intervals_);
    Vector inputs = base;
    for (int j = 0; j < nu_; ++j) {
      Vector tried = inputs;
      tried[j] = clamped(about_.inputs[j], base[j] + phase * change[j]);
      if (excess(moved(x, tried)) <= excess(moved(x, inputs))) inputs = tried;
    }
    return inputs;
  }

  Drive drive(const CourseName& named) {
    Drive made;
    made.name = named.name;
    const bool moves = makes_speed_ && named.course != Course::standing;
    made.meaning = fmt::format("{}{}", named.meaning, moves ? fmt::format(" at {:.3g} m/s", speed_) : "");
    const std::vector<double> start = state_in_line(checked_, heading);
    Vector x = Eigen::Map<const Vector>(start.data(), nx_);
    const Vector base = base_inputs(named.course, x);
    if (!base.allFinite() || !x.allFinite()) {
      made.unusable = "straight_motion is not finite";
      return made;
    }
    const Vector change = excitation(base);
    // A turn is steady once it has gone on for a while.
    if (named.course == Course::turn)
      for (int k = 0; k < intervals_; ++k) x = moved(x, inputs_at(named.course, k, x, base, change));
    made.states.resize(nx_, intervals_ + 1);
    made.inputs.resize(nu_, intervals_);
    for (int k = 0; k < intervals_; ++k) {
      made.states.col(k) = x;
      made.inputs.col(k) = inputs_at(named.course, k, x, base, change);
      made.jacobians.push_back(jacobian(x, made.inputs.col(k), k));
      x = moved(x, made.inputs.col(k));
    }
    made.states.col(intervals_) = x;
    observe(made);
    bool finite = made.states.allFinite() && made.outputs.allFinite();
    for (const Matrix& each : made.jacobians) finite = finite && each.allFinite();
    for (const Matrix& each : made.output_jacobians) finite = finite && each.allFinite();
    if (!finite) made.unusable = "states, outputs or derivatives along it are not finite";
    return made;
  }

  Matrix jacobian(const Vector& x, const Vector& u, int interval) const {
    bool ramp = false;
    for (int j = 0; j < np_; ++j) ramp = ramp || blocks_.ramp[j][interval];
    Matrix found = Matrix::Constant(nx_, nx_ + nu_ + (ramp ? 2 : 1) * np_, std::nan(""));
    checked_.model.integrate({.count = 1,
                              .states = x.data(),
                              .inputs = u.data(),
                              .parameters = parameters_.data(),
                              .parameters_end = ramp ? parameters_.data() : nullptr,
                              .durations = &checked_.options.interval,
                              .substeps = checked_.options.substeps,
                              .jacobians = found.data()});
    return found;
  }

  void observe(Drive& made) const {
    made.outputs.setConstant(ny_, intervals_ + 1, std::nan(""));
    for (int k = 0; k <= intervals_; ++k) {
      Matrix by_state = Matrix::Constant(ny_, nx_, std::nan(""));
      checked_.model.observe({.count = 1,
                              .states = made.states.col(k).data(),
                              .outputs = made.outputs.col(k).data(),
                              .jacobians = by_state.data()});
      made.output_jacobians.push_back(std::move(by_state));
    }
  }

  /// Adds to `by_unknowns` (n_x rows) what an interval's parameters do to its end.
  void add_parameters(const Drive& drive, int interval, Eigen::Ref<Matrix> by_unknowns) const {
    const Matrix& jacobian = drive.jacobians[interval];
    const bool with_end = jacobian.cols() > nx_ + nu_ + np_;
    for (int j = 0; j < np_; ++j) {
      const int now = nx_ + blocks_.unknown[j][interval];
      const auto at_start = jacobian.col(nx_ + nu_ + j);
      // On a ramp the interval starts with the value of the block before.
      by_unknowns.col(blocks_.ramp[j][interval] ? now - 1 : now) += at_start;
      if (with_end) by_unknowns.col(now) += jacobian.col(nx_ + nu_ + np_ + j);
    }
  }

  std::string name_of_unknown(int unknown) const {
    if (unknown < nx_) return about_.states[unknown].name;
    const int block = unknown - nx_, parameter = blocks_.parameter_of[block];
    const int first = blocks_.unknown[parameter].front(), last = blocks_.unknown[parameter].back();
    const std::string& name = about_.parameters[parameter].name;
    return first == last ? name : fmt::format("{}[{}]", name, block - first);
  }

  std::vector<std::string> combinations(Matrix null_space) const;

  const CheckedModel& checked_;
  const ModelDescription& about_;
  int nx_, nu_, np_, ny_, intervals_;
  std::vector<double> parameters_;
  bool makes_speed_ = false;
  double speed_ = 1.0;
  Blocks blocks_;
};

/// Columns that span what is not determined, as short sums: each is made to have an unknown of its own.
std::vector<std::string> Drives::combinations(Matrix null_space) const {
  std::vector<std::pair<int, std::string>> texts;  // with the first unknown, to sort by
  for (Eigen::Index c = 0; c < null_space.cols(); ++c) {
    Eigen::Index pivot = 0;
    Matrix rest = null_space.rightCols(null_space.cols() - c).cwiseAbs();
    Eigen::Index column = 0;
    rest.maxCoeff(&pivot, &column);
    null_space.col(c).swap(null_space.col(c + column));
    null_space.col(c) /= null_space(pivot, c);
    for (Eigen::Index other = 0; other < null_space.cols(); ++other)
      if (other != c) null_space.col(other) -= null_space(pivot, other) * null_space.col(c);
  }
  for (Eigen::Index c = 0; c < null_space.cols(); ++c) {
    const Vector v = null_space.col(c).normalized();
    std::vector<int> order;
    for (int i = 0; i < v.size(); ++i)
      if (std::abs(v[i]) > 0.07 * v.cwiseAbs().maxCoeff()) order.push_back(i);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return std::abs(v[a]) > std::abs(v[b]) + 1e-9; });
    std::string text;
    for (std::size_t k = 0; k < order.size(); ++k) {
      if (k == 4) {
        text += " ...";
        break;
      }
      const double sign = v[order[0]] < 0.0 ? -1.0 : 1.0, weight = sign * v[order[k]];
      const std::string name = name_of_unknown(order[k]);
      if (order.size() == 1)
        text = name;
      else
        text += fmt::format("{}{:.2g} {}", k == 0 ? "" : weight < 0.0 ? " - " : " + ", std::abs(weight), name);
    }
    texts.emplace_back(*std::min_element(order.begin(), order.end()), std::move(text));
  }
  std::sort(texts.begin(), texts.end());
  std::vector<std::string> sorted;
  sorted.reserve(texts.size());
  for (auto& [first, text] : texts) sorted.push_back(std::move(text));
  return sorted;
}

DriveInformation Drives::information(const Drive& drive) const {
  const int blocks = static_cast<int>(blocks_.parameter_of.size()), unknowns = nx_ + blocks, steps = nu_ * intervals_,
            rows = ny_ * (intervals_ + 1);
  DriveInformation found;
  found.name = drive.name;
  found.meaning = drive.meaning;
  found.unusable = drive.unusable;
  found.unknowns = unknowns;
  found.parameter_sigma.assign(np_, infinity);
  found.state_determined.assign(nx_, false);
  if (!drive.unusable.empty()) return found;

  // Unknowns in scales, inputs in standard deviations, rows in standard deviations: [inputs, unknowns] of the outputs,
  // and below it the identity of the measured inputs. Its triangular factor has in its last corner the square root of
  // the information once the inputs are eliminated (the Schur complement), without a product being formed.
  const auto noise = [](double sigma, double scale) {
    return std::clamp(sigma, least_sigma * scale, scale / least_sigma);
  };
  Vector scales(unknowns);
  for (int j = 0; j < nx_; ++j) scales[j] = about_.states[j].scale;
  for (int b = 0; b < blocks; ++b) scales[nx_ + b] = about_.parameters[blocks_.parameter_of[b]].scale;
  Matrix by_unknowns = Matrix::Zero(nx_, unknowns), by_inputs = Matrix::Zero(nx_, steps);
  by_unknowns.leftCols(nx_).setIdentity();
  Matrix stacked = Matrix::Zero(rows + steps, steps + unknowns);
  stacked.block(rows, 0, steps, steps).setIdentity();
  for (int k = 0; k <= intervals_; ++k) {
    const Matrix& seen = drive.output_jacobians[k];
    for (int r = 0; r < ny_; ++r) {
      const double weight = 1.0 / noise(checked_.output_sigmas[r], about_.outputs[r].scale);
      stacked.row(k * ny_ + r).head(steps) = weight * seen.row(r) * by_inputs;
      stacked.row(k * ny_ + r).tail(unknowns) = weight * (seen.row(r) * by_unknowns).cwiseProduct(scales.transpose());
    }
    if (k == intervals_) break;
    const auto by_state = drive.jacobians[k].leftCols(nx_);
    by_unknowns = (by_state * by_unknowns).eval();
    by_inputs = (by_state * by_inputs).eval();
    add_parameters(drive, k, by_unknowns);
    for (int j = 0; j < nu_; ++j)
      by_inputs.col(k * nu_ + j) +=
          noise(checked_.input_sigmas[j], about_.inputs[j].scale) * drive.jacobians[k].col(nx_ + j);
  }
  if (!stacked.allFinite()) {
    found.unusable = "its sensitivities are not finite";
    return found;
  }
  Matrix root = Matrix::Zero(unknowns, unknowns);
  const Matrix factor = Eigen::HouseholderQR<Matrix>(stacked).matrixQR();
  const Eigen::Index height = std::min<Eigen::Index>(unknowns, factor.rows() - steps);
  root.topRows(height) = factor.block(steps, steps, height, unknowns).template triangularView<Eigen::Upper>();

  const Eigen::JacobiSVD<Matrix> svd(root, Eigen::ComputeFullV);
  const Vector& values = svd.singularValues();
  while (found.rank < unknowns && values[found.rank] > rank_threshold * values[0]) ++found.rank;
  if (found.rank > 0) found.condition = values[0] / values[found.rank - 1];
  const Matrix& directions = svd.matrixV();
  const auto sigma = [&](int unknown) {
    if (directions.row(unknown).tail(unknowns - found.rank).norm() > largest_null_part) return infinity;
    const Vector parts = directions.row(unknown).head(found.rank).transpose().cwiseQuotient(values.head(found.rank));
    return scales[unknown] * parts.norm();
  };
  for (int j = 0; j < nx_; ++j) found.state_determined[j] = std::isfinite(sigma(j));
  for (int b = 0; b < blocks; ++b) {
    double& best = found.parameter_sigma[blocks_.parameter_of[b]];
    best = std::min(best, sigma(nx_ + b));
  }
  found.undetermined = combinations(directions.rightCols(unknowns - found.rank));
  if (found.rank > 0) found.weakest = combinations(directions.col(found.rank - 1)).front();
  return found;
}

double Drives::condition_of_jacobians(const Drive& drive) const {
  double largest = 0.0;
  for (Matrix jacobian : drive.jacobians) {
    for (int r = 0; r < nx_; ++r) jacobian.row(r) /= about_.states[r].scale;
    for (int c = 0; c < jacobian.cols(); ++c) {
      const Variable& v = c < nx_         ? about_.states[c]
                          : c < nx_ + nu_ ? about_.inputs[c - nx_]
                                          : about_.parameters[(c - nx_ - nu_) % np_];
      jacobian.col(c) *= v.scale;
    }
    const Vector values = Eigen::JacobiSVD<Matrix>(jacobian).singularValues();
    largest = std::max(largest, values[0] / values[values.size() - 1]);
  }
  return largest;
}

/// The largest magnitude that something had on a drive, and on which one.
struct Magnitude {
  double value = 0.0;
  std::string drive;
  void take(double other, const std::string& on) {
    if (!(std::abs(other) > value)) return;
    value = std::abs(other);
    drive = on;
  }
};

class ScaleCheck {
 public:
  ScaleCheck(const CheckedModel& checked, const Drives& drives) : about_(checked.about), drives_(drives) {}

  void look_at(const Drive& drive) {
    if (!drive.unusable.empty()) return;
    ++usable_;
    take("state", about_.states, drive.states, drive.name);
    take("input", about_.inputs, drive.inputs, drive.name);
    take("output", about_.outputs, drive.outputs, drive.name);
    take_sensitivities(drive);
    condition_ = std::max(condition_, drives_.condition_of_jacobians(drive));
  }

  std::vector<Finding> findings() {
    FindingList list("scaling");
    if (usable_ == 0) {
      list.skip("no drive could be driven; see 'observability'");
      return list.take();
    }
    double widest = 1.0;
    for (const Seen& seen : seen_) {
      if (seen.magnitude.value == 0.0) continue;  // it rests at zero on every drive, which says nothing
      const double ratio = seen.magnitude.value / seen.scale;
      widest = std::max({widest, ratio, 1.0 / ratio});
      if (ratio < far_off && ratio > 1.0 / far_off) continue;
      list.warn(fmt::format("{} {}", seen.kind, seen.name),
                fmt::format("{} is at most {:.3g}{} on the drives ('{}'); its scale is {:g}", seen.what,
                            seen.magnitude.value, seen.unit, seen.magnitude.drive, seen.scale),
                "make the scale the magnitude that it typically has (or give a typical speed)",
                {{"magnitude", seen.magnitude.value}, {"scale", seen.scale}});
    }
    if (condition_ > ill_conditioned)
      list.warn("dF/dz", fmt::format("the condition number of the scaled Jacobian of F is {:.2g}", condition_),
                "look for a scale that is far off, or for a state that forgets its past within one interval",
                {{"condition", condition_}});
    if (list.empty())
      list.pass(fmt::format("magnitudes on the drives are within a factor of {:.2g} of the scales; condition of the "
                            "scaled Jacobian of F {:.2g}",
                            widest, condition_),
                {{"factor", widest}, {"condition", condition_}});
    return list.take();
  }

 private:
  struct Seen {
    const char* kind;
    std::string name, what, unit;
    double scale;
    Magnitude magnitude;
  };

  Seen& seen(const char* kind, const std::string& name) {
    const auto at = std::find_if(seen_.begin(), seen_.end(),
                                 [&](const Seen& each) { return each.kind == kind && each.name == name; });
    if (at != seen_.end()) return *at;
    return seen_.emplace_back(Seen{kind, name, {}, {}, 1.0, {}});
  }

  void take(const char* kind, const std::vector<Variable>& variables, const Matrix& values, const std::string& drive) {
    for (std::size_t j = 0; j < variables.size(); ++j) {
      Seen& one = seen(kind, variables[j].name);
      one.what = "it";
      one.unit = " " + variables[j].unit;
      one.scale = variables[j].scale;
      for (Eigen::Index k = 0; k < values.cols(); ++k) one.magnitude.take(values(j, k), drive);
    }
  }

  /// What a parameter that is off by its scale does to the state over the horizon, in scales of the state.
  void take_sensitivities(const Drive& drive) {
    const int nx = static_cast<int>(about_.states.size()), nu = static_cast<int>(about_.inputs.size()),
              np = static_cast<int>(about_.parameters.size());
    Matrix by_parameters = Matrix::Zero(nx, np);
    for (const Matrix& jacobian : drive.jacobians) {
      by_parameters = (jacobian.leftCols(nx) * by_parameters).eval();
      for (int j = 0; j < jacobian.cols() - nx - nu; ++j) by_parameters.col(j % np) += jacobian.col(nx + nu + j);
    }
    for (int j = 0; j < np; ++j) {
      Seen& one = seen("parameter", about_.parameters[j].name);
      one.what = "what a change by its scale does to a state over the horizon, in the state's scales,";
      for (int r = 0; r < nx; ++r)
        one.magnitude.take(by_parameters(r, j) * about_.parameters[j].scale / about_.states[r].scale, drive.name);
    }
  }

  const ModelDescription& about_;
  const Drives& drives_;
  std::vector<Seen> seen_;
  int usable_ = 0;
  double condition_ = 0.0;
};

std::string joined(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, ", ")); }

std::vector<Finding> judge_observability(const CheckedModel& checked, const std::vector<DriveInformation>& drives,
                                         double duration) {
  const ModelDescription& about = checked.about;
  FindingList findings("observability");
  std::vector<std::string> usable;
  for (const DriveInformation& drive : drives) {
    if (drive.unusable.empty())
      usable.push_back(drive.name);
    else
      findings.warn(fmt::format("drive '{}'", drive.name), drive.unusable,
                    "see the other checks; or give another speed or noise");
  }
  if (usable.empty() || about.outputs.empty()) {
    findings.skip(usable.empty() ? "no drive could be driven" : "nothing is measured");
    return findings.take();
  }
  std::vector<std::string> notes;
  for (std::size_t j = 0; j < about.parameters.size(); ++j) {
    const Variable& p = about.parameters[j];
    double best = infinity;
    std::string weakest;
    std::vector<std::string> seen_on;
    for (const DriveInformation& drive : drives) {
      if (!std::isfinite(drive.parameter_sigma[j])) continue;
      if (drive.parameter_sigma[j] < best) weakest = drive.weakest;
      best = std::min(best, drive.parameter_sigma[j]);
      seen_on.push_back(drive.name);
    }
    const std::string where = fmt::format("parameter {}", p.name);
    const double width = std::isfinite(p.upper - p.lower) ? p.upper - p.lower : 10.0 * p.scale;
    if (seen_on.empty()) {
      std::string combination;
      for (const DriveInformation& drive : drives)
        for (const std::string& text : drive.undetermined)
          if (combination.empty() && text != p.name && text.find(" " + p.name) != std::string::npos)
            combination = fmt::format("; not determined on '{}': {}", drive.name, text);
      findings.fail(where,
                    fmt::format("the estimator can never learn it: no output tells it on any drive{}", combination),
                    "measure something that depends on it ('model.outputs'), tie it to another parameter, or make it a "
                    "constant");
    } else if (best > width && width > 0.0) {
      findings.warn(
          where,
          fmt::format("the best drive leaves a standard deviation of {:.3g} over one horizon of {:.3g} s, more "
                      "than its range of {:.3g}; what is known least there: {}",
                      best, duration, width, weakest),
          "expect it to be learned over many horizons only; less noise, longer horizons or another output help",
          {{"sigma", best}, {"range", width}});
    } else {
      notes.push_back(fmt::format("{} to {:.2g} ({})", p.name, best,
                                  seen_on.size() == usable.size() ? "every drive" : joined(seen_on)));
    }
  }
  for (std::size_t j = 0; j < about.states.size(); ++j) {
    const bool seen = std::any_of(drives.begin(), drives.end(),
                                  [&](const DriveInformation& drive) { return drive.state_determined[j]; });
    if (!seen)
      findings.warn(fmt::format("state {}", about.states[j].name), "no output tells it on any drive without a prior",
                    "measure something that depends on it, or give a good initial value and sigma");
  }
  if (!notes.empty())
    findings.pass(
        fmt::format("standard deviations over one horizon of {:.3g} s: {}", duration, fmt::join(notes, "; ")));
  if (findings.empty()) findings.pass("the state is determined; the model has no parameters");
  return findings.take();
}

}  // namespace

std::vector<Finding> check_drives(const CheckedModel& checked, std::vector<DriveInformation>& drives) {
  Drives maker(checked);
  const std::vector<Drive> driven = maker.all();
  ScaleCheck scaling(checked, maker);
  for (const Drive& drive : driven) {
    scaling.look_at(drive);
    drives.push_back(maker.information(drive));
  }
  std::vector<Finding> findings = scaling.findings();
  for (Finding& finding : judge_observability(checked, drives, maker.duration()))
    findings.push_back(std::move(finding));
  return findings;
}

}  // namespace rhec::sim
