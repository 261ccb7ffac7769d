#include "rhec/sim/tuning/innovations.hpp"

#include <algorithm>
#include <cmath>  // lgamma_r of glibc, too
#include <memory>
#include <numbers>
#include <utility>

#include <Eigen/LU>

#include "rhec/core/estimation/measurement.hpp"

namespace rhec::sim {
namespace {

// Tails heavier than Cauchy's are no measurement's.
constexpr double least_degrees = 1.0;

/// std::lgamma writes the sign to a variable that all threads share.
double log_gamma(double x) noexcept {
  int sign = 0;
  return ::lgamma_r(x, &sign);
}

/// An estimation method that is asked, before each fix, what it expects.
class InnovationMethod final : public EstimationMethod {
 public:
  InnovationMethod(std::unique_ptr<EstimationMethod> method, const RecordedLog& log, std::vector<int> places,
                   std::vector<double> variances, std::vector<Innovation>& innovations)
      : method_(std::move(method)),
        log_(log),
        places_(std::move(places)),
        variances_(std::move(variances)),
        innovations_(innovations),
        predicted_(method_->model().output_count()),
        jacobian_(predicted_.size() * static_cast<std::size_t>(method_->model().state_count())),
        nothing_(predicted_.size(), missing_value),
        no_input_(static_cast<std::size_t>(method_->model().input_count()), missing_value) {}

  const Model& model() const noexcept override { return method_->model(); }
  int substeps() const noexcept override { return method_->substeps(); }
  void start(Measured outputs) noexcept override { method_->start(outputs); }
  // Without measurements between nodes: each is asked for at a node.
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override {
    const bool is_fix = std::any_of(places_.begin(), places_.end(), [&](int j) { return !std::isnan(outputs[j]); });
    if (!is_fix) return method_->add(interval, outputs);
    if (interval.duration > 0.0) method_->add(interval, nothing_.data());
    note(outputs);
    method_->add_node(0.0, no_input_.data(), outputs);
  }
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override { method_->estimate(result, deadline); }
  void reset() noexcept override { method_->reset(); }
  bool rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept override {
    return method_->rebase(mean, covariance);
  }

 private:
  void note(Measured outputs) noexcept {
    // Fixes come in their order; those that nobody pushed are passed over.
    const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
    while (next_ < log_.fixes.size() &&
           !(same(log_.fixes[next_].x, outputs[places_[0]]) && same(log_.fixes[next_].y, outputs[places_[1]])))
      ++next_;
    if (next_ == log_.fixes.size()) return;
    Innovation& innovation = innovations_[next_++];
    method_->estimate(expected_, Clock::time_point::max());
    const Model& m = model();
    const int ny = m.output_count(), nx = m.state_count();
    m.observe(
        {.count = 1, .states = expected_.state.data(), .outputs = predicted_.data(), .jacobians = jacobian_.data()});
    Eigen::Matrix2d S = Eigen::Matrix2d::Identity();
    Eigen::Vector2d error = Eigen::Vector2d::Zero();
    const Eigen::Map<const Eigen::MatrixXd> H(jacobian_.data(), ny, nx);
    int taken[2] = {}, size = 0;
    for (std::size_t k = 0; k < places_.size(); ++k)
      if (!std::isnan(outputs[places_[k]])) taken[size++] = static_cast<int>(k);
    for (int a = 0; a < size; ++a) {
      const int j = places_[taken[a]];
      error[a] = outputs[j] - predicted_[j];
      for (int b = 0; b < size; ++b)
        S(a, b) = H.row(j) * expected_.covariance.topLeftCorner(nx, nx) * H.row(places_[taken[b]]).transpose();
      S(a, a) += variances_[taken[a]] / outputs.weight(j);
    }
    const double determinant = size == 2 ? S.determinant() : S(0, 0);
    innovation.size = size;
    innovation.squared = size == 2 ? error.dot(S.inverse() * error) : error[0] * error[0] / S(0, 0);
    innovation.log_determinant = std::log(determinant);
    // A filter that has lost its way expected nothing of the kind.
    if (!std::isfinite(innovation.squared) || !std::isfinite(innovation.log_determinant) || !(determinant > 0.0))
      innovation = {.size = size, .squared = squared_of_lost, .log_determinant = 0.0};
  }

  std::unique_ptr<EstimationMethod> method_;
  const RecordedLog& log_;
  std::vector<int> places_;
  std::vector<double> variances_;
  std::vector<Innovation>& innovations_;
  std::vector<double> predicted_, jacobian_, nothing_, no_input_;
  std::size_t next_ = 0;
  Estimate expected_;
};

class InnovationHooks final : public RobotHooks {
 public:
  InnovationHooks(const Robot& robot, const RecordedLog& log, const LogOptions& options,
                  std::vector<Innovation>& innovations)
      : log_(log), innovations_(innovations) {
    const std::vector<std::string> names = names_of(robot.model()->description().outputs);
    for (const std::string& name : options.position) {
      places_.push_back(static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin()));
      variances_.push_back(robot.output_sigmas()[places_.back()] * robot.output_sigmas()[places_.back()]);
    }
  }
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override {
    return std::make_unique<InnovationMethod>(std::move(method), log_, places_, variances_, innovations_);
  }

 private:
  const RecordedLog& log_;
  std::vector<Innovation>& innovations_;
  std::vector<int> places_;
  std::vector<double> variances_;
};

double total_at(const std::vector<Innovation>& innovations, const std::vector<bool>& counts, double degrees) {
  double total = 0.0;
  for (std::size_t i = 0; i < innovations.size(); ++i)
    if (counts[i]) total += log_density(innovations[i], degrees);
  return total;
}

}  // namespace

std::vector<Innovation> innovations(const Robot& robot, const RecordedLog& log, const LogOptions& options,
                                    const HoldOut& hold_out) {
  std::vector<Innovation> result(log.fixes.size());
  RecordedLog known = log;
  for (std::size_t i = known.rows.size(); i-- > 1;)
    known.rows[i].stamp = std::min(known.rows[i].stamp, known.rows[i - 1].time);
  LoopHooks hooks;
  hooks.robot = std::make_shared<InnovationHooks>(robot, known, options, result);
  replay(robot, known, options, hold_out, hooks);
  return result;
}

double log_density(const Innovation& innovation, double degrees) noexcept {
  if (innovation.size == 0) return 0.0;
  const double n = innovation.size;
  if (degrees >= normal_degrees)
    return -0.5 * (innovation.squared + innovation.log_determinant + n * std::log(2.0 * std::numbers::pi));
  // The constants of one and of two coordinates; of two, Gamma(d / 2 + 1) / Gamma(d / 2) = d / 2.
  const double constant =
      innovation.size == 2 ? std::log(0.5 * degrees) : log_gamma(0.5 * (degrees + n)) - log_gamma(0.5 * degrees);
  return constant - 0.5 * (n * std::log(degrees * std::numbers::pi) + innovation.log_determinant +
                           (degrees + n) * std::log1p(innovation.squared / degrees));
}

LogLikelihood log_likelihood(const std::vector<Innovation>& innovations, const std::vector<bool>& counts) {
  LogLikelihood result;
  for (std::size_t i = 0; i < innovations.size(); ++i) result.count += counts[i] && innovations[i].size > 0;
  // Golden sections of the logarithm: the likelihood has one maximum there.
  double lower = std::log(least_degrees), upper = std::log(normal_degrees);
  const double share = std::numbers::phi - 1.0;
  const auto value = [&](double at) { return total_at(innovations, counts, std::exp(at)); };
  double a = upper - share * (upper - lower), b = lower + share * (upper - lower);
  double at_a = value(a), at_b = value(b);
  while (upper - lower > 1e-4) {
    if (at_a > at_b) {
      upper = b, b = a, at_b = at_a;
      a = upper - share * (upper - lower), at_a = value(a);
    } else {
      lower = a, a = b, at_a = at_b;
      b = lower + share * (upper - lower), at_b = value(b);
    }
  }
  result.degrees = std::exp(0.5 * (lower + upper));
  result.total = total_at(innovations, counts, result.degrees);
  const double normal = total_at(innovations, counts, normal_degrees);
  if (normal >= result.total) {
    result.total = normal;
    result.degrees = normal_degrees;
  }
  return result;
}

}  // namespace rhec::sim
