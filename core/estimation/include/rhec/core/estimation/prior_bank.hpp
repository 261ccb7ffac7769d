#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/estimation/input_factors.hpp"
#include "rhec/core/estimation/input_guess.hpp"
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
  bool looks_ahead() const noexcept { return !setup_.motion_outputs.empty(); }

  const Model& model() const noexcept { return *model_; }
  int member_count() const noexcept { return members_; }
  int most_between() const noexcept { return setup_.most_between; }
  /// Probability of each member.
  std::span<const double> weights() const noexcept { return {weights_.data(), static_cast<std::size_t>(members_)}; }
  double guessed_input(int input) const noexcept;  ///< the most probable member's; of a measured one, that
  /// Sum over the updates since `reset` of each member's log likelihood (less a constant common to all): weights have a
  /// floor. Neither `save` nor `restore` touches it.
  std::span<const double> log_likelihoods() const noexcept {
    return {log_likelihoods_.data(), static_cast<std::size_t>(members_)};
  }
  /// Moments of the mixture: [x; p], n_x + n_p.
  void moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept;
  /// Moments of one member: [x; p].
  void moments_of(int member, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const noexcept;
  /// Index in [x; z] of the first state of a parameter's process, and the number of states that any of its priors has.
  int first_state(int parameter) const noexcept;
  int process_states(int parameter) const noexcept;
  int state_count() const noexcept { return n_; }

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
  double log_likelihood() const noexcept { return log_likelihood_; }
  /// The same of the measurements between the nodes of the last interval.
  double between_log_likelihood() const noexcept { return between_log_likelihood_; }
  /// Of a bank that follows a map: whether that knew the place where the last interval ended.
  bool knows_place() const noexcept { return knows_place_; }
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
  double distance() const noexcept { return distance_; }

 private:
  struct Process;    ///< of a parameter
  struct LookAhead;  ///< what outputs of motion ask for
  void find_places(Process& process) const;
  void write_start(int parameter, const Prior& prior, int lane) noexcept;
  struct Views;  ///< what the kernels are given
  struct Frame;  ///< what outputs are taken in by
  int view_outputs(const double* gradients, std::ptrdiff_t entries, const double* y) noexcept;
  double take_outputs(const Frame& frame, const double* y, const double* robust_weights) noexcept;
  void begin_step(const MeasuredInterval&interval) noexcept, take_linearised_step() noexcept;
  void begin_inputs(const MeasuredInterval&interval) noexcept, view_member(int lane) noexcept;
  void widen_guesses() noexcept, take_guesses() noexcept, update_guesses() noexcept, hold_factors() noexcept;
  void integrate_members(const double* mean, bool is_wide, double seconds, double share) noexcept;
  void observe_members(const double* states) noexcept;
  void widen() noexcept;
  bool is_of_motion(int output) const noexcept;
  void write_wide_gradient(int output, double share, double from_first, double* gradient) const noexcept;
  MeasuredInterval look_ahead(const MeasuredInterval& measured, Measured end_outputs) noexcept;
  const double* reading_weights(int which) const noexcept;
  void weigh_readings(int which) noexcept, add_curvature(double from_first) noexcept;
  void linearise_about_point(const MeasuredInterval& interval, Measured end_outputs) noexcept;
  void linearise_outputs(int which, const double* y, double share, double from_first) noexcept;
  void expect_outputs(int which, const double* y, const double* mean) noexcept;
  bool move_point(const MeasuredInterval& interval, Measured end_outputs) noexcept;
  double curvature_factor(int state, int factor, double from_first) const noexcept;
  void take_step_from_point() noexcept, linearise_nodes() noexcept;
  void linearise_given(const double* y) noexcept;
  void take_between(const MeasuredInterval& interval, int which, bool about_point) noexcept;
  void narrow() noexcept;
  int plain_count() const noexcept { return 2 * n_ - nx_ + nu_; }  ///< of the wide vector, without the factors f
  int wide_count() const noexcept;
  void find_distance(const double* input, double duration) noexcept;
  void advance_processes(const ProcessInterval&way) noexcept, mix_members() noexcept;
  void find_loss_scales();
  void weigh_outputs(const Frame& frame, const double* y, int taken, const double* given) noexcept;
  void check_map() const;
  void follow_map() noexcept, add_offsets() noexcept;
  void adapt_noise(const Frame& frame, const double* y) noexcept;
  void find_scale_slopes(const Frame& frame, const double* y) noexcept;
  static double scale_weight(double s, double delta) noexcept;
  double robust_surplus(const double* y, int sensor, int lane) const noexcept;
  int most_probable() const noexcept;
  void reset_noise() noexcept, keep_near_bounds() noexcept;
  void spread_variances(const double* weights = nullptr) noexcept;
  int own_places(int member, int parameter, int* places) const noexcept;

  std::shared_ptr<const Model> model_;
  Setup setup_;
  int members_, lanes_, nx_, nu_, np_, ny_, n_ = 0;
  std::vector<Process> processes_;
  std::vector<int> sensor_, loss_of_;  ///< per output: the first output of its sensor; its robust loss, or -1
  /// Per robust loss and number of outputs that are not missing: what an output without outliers says of its noise.
  std::vector<std::vector<double>> loss_scales_;
  /// Per output: its noise variance, and the variance of that, relative to its square.
  AlignedDoubles learnt_;
  AlignedDoubles mean_, covariance_, work_, weights_, log_likelihoods_, keep_, take_, next_, jacobian_, predicted_,
      gradient_, squares_, innovation_variances_, output_variances_, surprises_;
  /// Within an interval: [x; z; u; q; f], with the noise q of the processes (docs/method.md, section 8), and the
  /// transition to [x; z] at its end. f are the factors of second-order terms, as of a KalmanFilter: they are those of
  /// the mixture, common to all members, so that they do not tell for or against one of them.
  AlignedDoubles wide_mean_, wide_before_, wide_covariance_, wide_work_, transition_;
  /// Per measurement between the nodes, and for the end: outputs as expected at `point_`, and their gradients.
  AlignedDoubles wide_predicted_, wide_gradient_;
  AlignedDoubles point_;                 ///< where the interval is linearised
  std::vector<int> limited_;             ///< entries of [x; z] with bounds
  std::vector<double> limits_;           ///< beyond these: lower and upper of each
  std::vector<double> stated_weights_;   ///< of the outputs of the last update, n_y; empty: all were 1
  std::unique_ptr<LookAhead> ahead_;     ///< null without outputs of motion
  bool is_curved_ = false;               ///< whether the interval has second-order terms
  std::vector<double> added_, counted_;  ///< n_y: variances of second-order terms; Noise::counted
  // Rows of the model: one per member.
  std::vector<double> states_, inputs_, parameters_, ends_, durations_, next_rows_, jacobian_rows_, output_rows_,
      gradient_rows_;
  std::vector<double> input_, variances_;
  std::vector<InputGuess> guesses_;  ///< of each lane
  std::unique_ptr<InputFactors> factors_;
  std::vector<std::uint8_t> is_own_;                                               ///< per entry of [x; z]
  std::vector<double> start_, own_, own_covariance_, filled_, filled_covariance_;  ///< moments of one process
  Eigen::VectorXd full_mean_;
  Eigen::MatrixXd full_covariance_;
  double distance_ = 0.0, log_likelihood_ = 0.0, between_log_likelihood_ = 0.0;
  bool knows_place_ = false;
  std::vector<double> map_means_, map_variances_;  ///< at the interval's start, then at its end
  std::unique_ptr<Views> views_;
};

}  // namespace rhec
