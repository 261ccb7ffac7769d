#include "rhec/core/estimation/sensor_watch.hpp"

#include <utility>

#include "sensor_judge.hpp"

namespace rhec {

SensorWatch::SensorWatch(std::shared_ptr<const Model> model, const Setup& setup)
    : judge_(std::make_unique<SensorJudge>(std::move(model), setup)) {}
SensorWatch::~SensorWatch() = default;

const std::vector<Sensor>& SensorWatch::sensors() const noexcept { return judge_->sensors(); }
const std::vector<Sensor>& SensorWatch::inputs() const noexcept { return judge_->inputs(); }
std::string SensorWatch::in_words(const Health& health) const { return rhec::in_words(health, sensors(), inputs()); }
const SensorWatch::Setup& SensorWatch::setup() const noexcept { return judge_->setup(); }
std::shared_ptr<const FilterMemo> SensorWatch::make_memo() { return judge_->make_memo(); }
void SensorWatch::reset() noexcept { judge_->reset(); }
void SensorWatch::clean_inputs(double* inputs) noexcept { judge_->clean_inputs(inputs); }
bool SensorWatch::doubts_input(std::size_t input) const noexcept { return judge_->doubts_input(input); }
bool SensorWatch::doubts_any_input() const noexcept {
  for (std::size_t j = 0; j < inputs().size(); ++j)
    if (doubts_input(j)) return true;
  return false;
}
void SensorWatch::advance(double duration, const double* inputs, const double* more_sigmas) noexcept {
  judge_->advance(duration, inputs, more_sigmas);
}
SensorWatch::Finding SensorWatch::judge(double time, double* outputs, const double* weights) noexcept {
  return judge_->judge(time, outputs, weights);
}
SensorWatch::Finding SensorWatch::judge_late(double time, double* outputs, const double* weights,
                                             bool may_search) noexcept {
  return judge_->judge_late(time, outputs, weights, may_search);
}
void SensorWatch::remember_for(double time) noexcept { judge_->remember_for(time); }
double SensorWatch::search_on(double time, bool is_hasty) noexcept { return judge_->search_on(time, is_hasty); }
bool SensorWatch::is_heading_unknown() const noexcept { return judge_->is_heading_unknown(); }
void SensorWatch::begin_ahead() noexcept { judge_->begin_ahead(); }
void SensorWatch::advance_ahead(double duration, const double* inputs) noexcept {
  judge_->advance_ahead(duration, inputs);
}
void SensorWatch::judge_ahead(double* outputs, const double* weights) noexcept {
  judge_->judge_ahead(outputs, weights);
}
const std::vector<SensorWatch::Held>& SensorWatch::held() const noexcept { return judge_->held(); }
int SensorWatch::held_count() const noexcept { return judge_->held_count(); }
std::span<const double> SensorWatch::jumps() const noexcept { return judge_->jumps(); }
SensorWatch::Retraction SensorWatch::retraction() const noexcept { return judge_->retraction(); }
const Eigen::VectorXd& SensorWatch::mean() const noexcept { return judge_->mean(); }
const Eigen::MatrixXd& SensorWatch::covariance() const noexcept { return judge_->covariance(); }
std::span<const SensorHealth> SensorWatch::sensor_states() const noexcept { return judge_->sensor_states(); }
bool SensorWatch::is_active() const noexcept { return judge_->is_active(); }
void SensorWatch::restart(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  judge_->restart(mean, covariance);
}
void SensorWatch::follow(const Estimate& estimate) noexcept { judge_->follow(estimate); }
void SensorWatch::predict(double duration, const double* inputs, const double* input_sigmas,
                          Estimate& estimate) noexcept {
  judge_->predict(duration, inputs, input_sigmas, estimate);
}
void SensorWatch::begin_predicting() noexcept { judge_->begin_predicting(); }
bool SensorWatch::is_correlated() const noexcept { return judge_->is_correlated(); }
void SensorWatch::scale(Estimate& estimate) const noexcept { judge_->scale(estimate); }
bool SensorWatch::is_in_doubt() const noexcept { return judge_->is_in_doubt(); }
void SensorWatch::widen(Estimate& estimate) noexcept { judge_->widen(estimate); }
void SensorWatch::begin_innovations() noexcept { judge_->begin_innovations(); }
std::span<const Innovation> SensorWatch::innovations() const noexcept { return judge_->innovations(); }
void SensorWatch::assess(const Estimate& estimate, std::span<const Presence> presence, Presence inputs,
                         std::uint32_t reasons, Health& health) noexcept {
  judge_->assess(estimate, presence, inputs, reasons, health);
}

}  // namespace rhec
