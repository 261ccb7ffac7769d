// Checks on typical drives: magnitudes against scales, and observability of states and parameters.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/base/infinity.hpp"

#include "drives.hpp"

namespace rhec::sim {
namespace {

using Matrix = Eigen::MatrixXd;

constexpr double far_off = 100.0;        // ratio of a magnitude to its scale
constexpr double ill_conditioned = 1e6;  // of the scaled Jacobian of F

/// The largest magnitude over all drives, and the drive where it occurred.
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
      if (seen.magnitude.value == 0.0) continue;  // zero on every drive: no information
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

  /// Effect of a parameter error of one scale on the state over the horizon, in scales of the state.
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

/// The combination, on the first drive that has one, in which something is not determined.
std::string combination_with(const std::vector<DriveInformation>& drives, const std::string& name) {
  for (const DriveInformation& drive : drives)
    for (const std::string& text : drive.undetermined)
      if (text == name || text.find(' ' + name) != std::string::npos)
        return fmt::format("{} (on '{}')", text, drive.name);
  return name;
}

/// The combination that is known least, of the first drive where that has something to do with it.
std::string weakest_with(const std::vector<DriveInformation>& drives, const std::string& name) {
  for (const DriveInformation& drive : drives)
    if (drive.weakest == name || drive.weakest.find(' ' + name) != std::string::npos)
      return fmt::format("{} (on '{}')", drive.weakest, drive.name);
  return name;
}

/// Of the errors of sensors: what each drive tells by itself, and with what the other drives tell of the same sensors.
struct ErrorInformation {
  std::vector<std::string> names;
  std::vector<double>
      known;  ///< by error: its standard deviation before anything is measured; infinite: nothing is known
  std::vector<DriveInformation> alone, together;
};

double best_of(const std::vector<DriveInformation>& drives, std::vector<double> DriveInformation::*sigmas,
               std::size_t index) {
  double best = infinity;
  for (const DriveInformation& drive : drives)
    if (drive.unusable.empty()) best = std::min(best, (drive.*sigmas)[index]);
  return best;
}

/// "(standing)": the drives that tell an error by themselves; empty if all do.
std::string told_on(const ErrorInformation& about, std::size_t error) {
  std::vector<std::string> on;
  std::size_t usable = 0;
  for (const DriveInformation& drive : about.alone) {
    if (!drive.unusable.empty()) continue;
    ++usable;
    if (drive.error_sigma[error] < about.known[error]) on.push_back(drive.name);
  }
  if (on.size() == usable) return {};
  return on.empty() ? " (by several drives together)" : fmt::format(" ({})", fmt::join(on, ", "));
}

/// Errors of sensors that the drives do not tell from the state, from slip, or from each other, and slip that no drive
/// tells from them. Sensors keep their errors from drive to drive, where starts and slip are others.
std::vector<Finding> judge_errors(const CheckedModel& checked, const ErrorInformation& about,
                                  const std::vector<DriveInformation>& without, double duration) {
  FindingList findings("observability");
  std::vector<std::string> notes;
  const auto is_usable = [](const DriveInformation& drive) { return drive.unusable.empty(); };
  if (std::none_of(about.together.begin(), about.together.end(), is_usable)) return findings.take();
  for (std::size_t e = 0; e < about.names.size(); ++e) {
    const std::string& name = about.names[e];
    const double best = best_of(about.together, &DriveInformation::error_sigma, e);
    if (!std::isfinite(best))
      findings.warn(name,
                    fmt::format("no drive tells it without a prior; what the data cannot separate: {}",
                                combination_with(about.together, name)),
                    "it stays as uncertain as its sigma and the start are: leave it out, or measure what it is "
                    "confused with by another sensor");
    else if (best > about.known[e])
      findings.warn(
          name,
          fmt::format("one horizon of {:.3g} s of each drive leaves a standard deviation of {:.3g}, more than "
                      "the {:.3g} that is known before; what the data hardly separate: {}",
                      duration, best, about.known[e], weakest_with(about.together, name)),
          "it stays about as uncertain as its sigma, and is learned over many horizons at best: leave it out, "
          "or measure what it is confused with by another sensor",
          {{"sigma", best}, {"known", about.known[e]}});
    else
      notes.push_back(fmt::format("{} to {:.2g}{}", name, best, told_on(about, e)));
  }
  for (std::size_t j = 0; j < checked.about.parameters.size(); ++j) {
    if (!std::isfinite(best_of(without, &DriveInformation::parameter_sigma, j)) ||
        std::isfinite(best_of(about.together, &DriveInformation::parameter_sigma, j)))
      continue;
    const std::string& name = checked.about.parameters[j].name;
    findings.warn(fmt::format("parameter {}", name),
                  fmt::format("no drive tells it beside the errors of sensors; what the data cannot separate: {}",
                              combination_with(about.together, name)),
                  "give one of the errors up, or measure what tells them apart");
  }
  if (!notes.empty()) findings.pass(fmt::format("errors of sensors, over one horizon: {}", fmt::join(notes, "; ")));
  return findings.take();
}

ErrorInformation information_about_errors(const CheckedModel& checked, const Drives& maker,
                                          const std::vector<Drive>& driven) {
  ErrorInformation about;
  about.names = maker.names_of_errors();
  const auto add_known = [&about](const std::vector<int>& which, const std::vector<double>& sigmas) {
    for (std::size_t j = 0; j < which.size(); ++j) about.known.push_back(sigmas.empty() ? infinity : sigmas[j]);
  };
  add_known(checked.options.biased, checked.options.bias_sigmas);
  add_known(checked.options.scaled, checked.options.scale_sigmas);
  std::vector<Drives::Root> roots;
  std::vector<Matrix> told;
  for (const Drive& drive : driven) {
    roots.push_back(maker.root(drive, true));
    told.push_back(maker.about_errors(roots.back()));
    about.alone.push_back(maker.information(drive, roots.back()));
  }
  for (std::size_t d = 0; d < driven.size(); ++d) {
    Matrix elsewhere(0, std::ssize(about.names));
    for (std::size_t other = 0; other < driven.size(); ++other) {
      if (other == d) continue;
      elsewhere.conservativeResize(elsewhere.rows() + told[other].rows(), Eigen::NoChange);
      elsewhere.bottomRows(told[other].rows()) = told[other];
    }
    about.together.push_back(maker.information(driven[d], roots[d], elsewhere));
  }
  return about;
}

}  // namespace

std::vector<Finding> check_drives(const CheckedModel& checked, std::vector<DriveInformation>& drives) {
  Drives maker(checked);
  const std::vector<Drive> driven = maker.all();
  ScaleCheck scaling(checked, maker);
  for (const Drive& drive : driven) {
    scaling.look_at(drive);
    drives.push_back(maker.information(drive, maker.root(drive, false)));
  }
  std::vector<Finding> findings = scaling.findings();
  for (Finding& finding : judge_observability(checked, drives, maker.duration()))
    findings.push_back(std::move(finding));
  if (maker.names_of_errors().empty()) return findings;
  const ErrorInformation about = information_about_errors(checked, maker, driven);
  for (Finding& finding : judge_errors(checked, about, drives, maker.duration()))
    findings.push_back(std::move(finding));
  return findings;
}

}  // namespace rhec::sim
