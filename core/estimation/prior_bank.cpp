#include "rhec/core/estimation/prior_bank.hpp"

#include <utility>

#include "prior_bank_filters.hpp"

namespace rhec {

PriorBank::PriorBank(std::shared_ptr<const Model> model, Setup setup)
    : filters_(std::make_unique<Filters>(std::move(model), std::move(setup))) {}
PriorBank::PriorBank(PriorBank&&) noexcept = default;
PriorBank::~PriorBank() = default;

void PriorBank::reset(const Eigen::Ref<const Eigen::VectorXd>& state,
                      const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept {
  filters_->reset(state, covariance);
}
void PriorBank::replace_vehicle(const Eigen::Ref<const Eigen::VectorXd>& state,
                                const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept {
  filters_->replace_vehicle(state, covariance);
}
void PriorBank::update(Measured y, const double* robust_weights) noexcept { filters_->update(y, robust_weights); }
double PriorBank::robust_weight(int output) const noexcept { return filters_->robust_weight(output); }
void PriorBank::predict(const MeasuredInterval& interval, Measured end_outputs) noexcept {
  filters_->predict(interval, end_outputs);
}
bool PriorBank::looks_ahead() const noexcept { return filters_->looks_ahead(); }
const Model& PriorBank::model() const noexcept { return filters_->model(); }
int PriorBank::member_count() const noexcept { return filters_->member_count(); }
int PriorBank::most_between() const noexcept { return filters_->most_between(); }
std::span<const double> PriorBank::weights() const noexcept { return filters_->weights(); }
double PriorBank::guessed_input(int input) const noexcept { return filters_->guessed_input(input); }
std::span<const double> PriorBank::log_likelihoods() const noexcept { return filters_->log_likelihoods(); }
void PriorBank::moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept {
  filters_->moments(mean, covariance);
}
void PriorBank::moments_of(int member, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const noexcept {
  filters_->moments_of(member, mean, covariance);
}
int PriorBank::first_state(int parameter) const noexcept { return filters_->first_state(parameter); }
int PriorBank::process_states(int parameter) const noexcept { return filters_->process_states(parameter); }
int PriorBank::state_count() const noexcept { return filters_->state_count(); }
std::size_t PriorBank::state_size() const noexcept { return filters_->state_size(); }
void PriorBank::save(double* state) const noexcept { filters_->save(state); }
void PriorBank::restore(const double* state) noexcept { filters_->restore(state); }
void PriorBank::saved_moments(const double* state, int member, Eigen::VectorXd& mean,
                              Eigen::MatrixXd& covariance) noexcept {
  filters_->saved_moments(state, member, mean, covariance);
}
void PriorBank::add_saved_weights(const double* state, double* sums) const noexcept {
  filters_->add_saved_weights(state, sums);
}
void PriorBank::write_process(int member, int parameter, const ProcessInterval& way, double* data) noexcept {
  filters_->write_process(member, parameter, way, data);
}
double PriorBank::log_likelihood() const noexcept { return filters_->log_likelihood(); }
double PriorBank::between_log_likelihood() const noexcept { return filters_->between_log_likelihood(); }
bool PriorBank::knows_place() const noexcept { return filters_->knows_place(); }
void PriorBank::take_share(double share, const double* mean, const double* covariance) noexcept {
  filters_->take_share(share, mean, covariance);
}
void PriorBank::forget_weights() noexcept { filters_->forget_weights(); }
void PriorBank::take_noise(const PriorBank& other) noexcept { filters_->take_noise(*other.filters_); }
PriorBank::Noise PriorBank::noise(int output) const noexcept { return filters_->noise(output); }
double PriorBank::distance() const noexcept { return filters_->distance(); }

}  // namespace rhec
