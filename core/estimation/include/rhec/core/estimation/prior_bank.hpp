#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/estimation/prior_bank_setup.hpp"
#include "rhec/core/horizon/measured_interval.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// Extended Kalman filters with different priors of the parameters, side by side in the processor's lanes and mixed as
/// interacting multiple models (Blom and Bar-Shalom 1988; docs/method.md, section 8). Each works on [x; z], where z are
/// the states of its processes. With one member it is the Kalman filter of that prior. The ground covered on an
/// interval comes from the vehicle's motion at the mixture's mean, and is then data; see `distance`.
///
/// Values that are not finite, or lead to such, are skipped. Allocates in its constructor only.
class RHEC_EXPORT PriorBank {
 public:
  using Setup = PriorBankSetup;
  /// Throws Error if sizes do not match.
  PriorBank(std::shared_ptr<const Model> model, Setup setup);
  PriorBank(PriorBank&&) noexcept;
  ~PriorBank();

  /// Starts all members at a vehicle state (n_x) and its covariance, and their processes at their own starts.
  void reset(const Eigen::Ref<const Eigen::VectorXd>& state,
             const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept;
  /// Moves all members to a vehicle state and its covariance. Their processes stay, without correlation to it.
  void replace_vehicle(const Eigen::Ref<const Eigen::VectorXd>& state,
                       const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept;
  /// Measurement update with y (n_y, NaN where missing). `robust_weights` (n_y, or null) take the place of those that
  /// the robust losses give to the innovations; NaN: none.
  void update(Measured y, const double* robust_weights = nullptr) noexcept;
  /// The weight, above 0 and at most 1, by which the last update scaled an output's information, for the most probable
  /// member; 1 without a robust loss.
  double robust_weight(int output) const noexcept;
  /// Time update over an interval. Of an input that is missing each member knows what it can (InputGuess).
  /// Measurements between the two nodes are each used at its own time. The noise of an input and of a process is one
  /// value over the interval, as of a window. `end_outputs` (n_y, NaN where missing, or null) are those of the
  /// interval's end, for `update`: it is linearised where its outputs of motion put it, as by KalmanFilter::predict.
  void predict(const MeasuredInterval& interval, Measured end_outputs = nullptr) noexcept;
  void predict(const double* measured_input, double duration) noexcept { predict({duration, measured_input}); }
  /// Whether that depends on the outputs of the interval's end.
  bool looks_ahead() const noexcept;

  const Model& model() const noexcept;
  int member_count() const noexcept;
  int most_between() const noexcept;
  /// Probability of each member.
  std::span<const double> weights() const noexcept;
  double guessed_input(int input) const noexcept;  ///< the most probable member's; of a measured one, that
  /// Sum over the updates since `reset` of each member's log likelihood (less a constant common to all): weights have a
  /// floor. Neither `save` nor `restore` touches it.
  std::span<const double> log_likelihoods() const noexcept;
  /// Moments of the mixture: [x; p], n_x + n_p.
  void moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept;
  /// Moments of one member: [x; p].
  void moments_of(int member, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const noexcept;
  /// Index in [x; z] of the first state of a parameter's process, and the number of states that any of its priors has.
  int first_state(int parameter) const noexcept;
  int process_states(int parameter) const noexcept;
  int state_count() const noexcept;

  /// All that changes: moments, weights, and noise learnt. `state_size` doubles.
  std::size_t state_size() const noexcept;
  void save(double* state) const noexcept;
  void restore(const double* state) noexcept;

  /// What a window needs of a member to take its place, on the states of the member's own priors; the others are 0.
  /// Moments of [x; z] (n, n x n) in what `save` has written; the others have the variance 1.
  void saved_moments(const double* state, int member, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept;
  /// Adds the probabilities of the members in what `save` has written.
  void add_saved_weights(const double* state, double* sums) const noexcept;
  /// Interval data of a parameter's process, as in ProcessModel: ramp, F, L.
  void write_process(int member, int parameter, const ProcessInterval& way, double* data) noexcept;

  /// Logarithm of the last update's likelihood, but for a constant that is the same for all banks.
  double log_likelihood() const noexcept;
  /// The same of the measurements between the nodes of the last interval.
  double between_log_likelihood() const noexcept;
  /// Of a bank that follows a map: whether that knew the place where the last interval ended.
  bool knows_place() const noexcept;
  /// Every member becomes the mixture of itself with the share 1 - s, and of these moments of [x; p] with the share s.
  /// For priors without further states.
  void take_share(double share, const double* mean, const double* covariance) noexcept;
  /// Members become equally probable.
  void forget_weights() noexcept;
  /// Takes over what another bank of the same outputs has learnt of their noise.
  void take_noise(const PriorBank& other) noexcept;

  /// What has been learnt of an output's noise.
  struct Noise {
    double variance = 0.0;      ///< at present
    double counted = 0.0;       ///< by which measurements count: with what is not known of it
    bool is_identified = true;  ///< false while the residuals say little about it
  };
  Noise noise(int output) const noexcept;

  /// Ground covered on the last interval [m], at least half of what it would be without slip.
  double distance() const noexcept;

 private:
  class Filters;
  std::unique_ptr<Filters> filters_;
};

}  // namespace rhec
