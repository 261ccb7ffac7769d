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
#include "rhec/core/estimation/prior_bank.hpp"

namespace rhec {

/// What a PriorBank does; it has the same functions, which are described there. The private ones are described where
/// they are defined.
class PriorBank::Filters {
 public:
  Filters(std::shared_ptr<const Model> model, Setup setup);
  ~Filters();
  void reset(const Eigen::Ref<const Eigen::VectorXd>& state,
             const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept;
  void replace_vehicle(const Eigen::Ref<const Eigen::VectorXd>& state,
                       const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept;
  void update(Measured y, const double* robust_weights) noexcept;
  double robust_weight(int output) const noexcept;
  void predict(const MeasuredInterval& interval, Measured end_outputs) noexcept;
  bool looks_ahead() const noexcept { return !setup_.motion_outputs.empty(); }
  const Model& model() const noexcept { return *model_; }
  int member_count() const noexcept { return members_; }
  int most_between() const noexcept { return setup_.most_between; }
  std::span<const double> weights() const noexcept { return {weights_.data(), static_cast<std::size_t>(members_)}; }
  double guessed_input(int input) const noexcept;
  std::span<const double> log_likelihoods() const noexcept {
    return {log_likelihoods_.data(), static_cast<std::size_t>(members_)};
  }
  void moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept;
  void moments_of(int member, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const noexcept;
  int first_state(int parameter) const noexcept;
  int process_states(int parameter) const noexcept;
  int state_count() const noexcept { return n_; }
  std::size_t state_size() const noexcept;
  void save(double* state) const noexcept;
  void restore(const double* state) noexcept;
  void saved_moments(const double* state, int member, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) noexcept;
  void add_saved_weights(const double* state, double* sums) const noexcept;
  void write_process(int member, int parameter, const ProcessInterval& way, double* data) noexcept;
  double log_likelihood() const noexcept { return log_likelihood_; }
  double between_log_likelihood() const noexcept { return between_log_likelihood_; }
  bool knows_place() const noexcept { return knows_place_; }
  void take_share(double share, const double* mean, const double* covariance) noexcept;
  void forget_weights() noexcept;
  void take_noise(const Filters& other) noexcept;
  Noise noise(int output) const noexcept;
  double distance() const noexcept { return distance_; }

 private:
  struct Process;    ///< of a parameter
  struct LookAhead;  ///< what outputs of motion ask for
  struct Views;      ///< what the kernels are given
  struct Frame;      ///< what outputs are taken in by

  // prior_bank_filters.cpp: one step of all members.
  void find_places(Process& process) const;
  void write_start(int parameter, const Prior& prior, int lane) noexcept;
  void begin_step(const MeasuredInterval& interval) noexcept;
  void integrate_members(const double* mean, bool is_wide, double seconds, double share) noexcept;
  void observe_members(const double* states) noexcept;
  void find_distance(const double* input, double duration) noexcept;
  void advance_processes(const ProcessInterval& way) noexcept;
  void take_linearised_step() noexcept;
  void linearise_nodes() noexcept;
  int view_outputs(const double* gradients, std::ptrdiff_t entries, const double* y) noexcept;
  double take_outputs(const Frame& frame, const double* y, const double* robust_weights) noexcept;
  void mix_members() noexcept;
  void keep_near_bounds() noexcept;
  int own_places(int member, int parameter, int* places) const noexcept;

  // prior_bank_between.cpp: measurements between nodes, and outputs of motion.
  int plain_count() const noexcept { return 2 * n_ - nx_ + nu_; }  ///< of the wide vector, without the factors f
  int wide_count() const noexcept;
  void widen() noexcept;
  void narrow() noexcept;
  MeasuredInterval look_ahead(const MeasuredInterval& measured, Measured end_outputs) noexcept;
  void linearise_given(const double* y) noexcept;
  void linearise_about_point(const MeasuredInterval& interval, Measured end_outputs) noexcept;
  void linearise_outputs(int which, const double* y, double share, double from_first) noexcept;
  void expect_outputs(int which, const double* y, const double* mean) noexcept;
  bool move_point(const MeasuredInterval& interval, Measured end_outputs) noexcept;
  void take_between(const MeasuredInterval& interval, int which, bool about_point) noexcept;
  void take_step_from_point() noexcept;
  void write_wide_gradient(int output, double share, double from_first, double* gradient) const noexcept;
  double curvature_factor(int state, int factor, double from_first) const noexcept;
  void add_curvature(double from_first) noexcept;
  const double* reading_weights(int which) const noexcept;
  void weigh_readings(int which) noexcept;

  // prior_bank_inputs.cpp: inputs that are missing.
  void begin_inputs(const MeasuredInterval& interval) noexcept;
  void view_member(int lane) noexcept;
  void widen_guesses() noexcept;
  void take_guesses() noexcept;
  void update_guesses() noexcept;
  void hold_factors() noexcept;

  // prior_bank_noise.cpp: robust losses, and noise that is learnt.
  void reset_noise() noexcept;
  void adapt_noise(const Frame& frame, const double* y) noexcept;
  void spread_variances(const double* weights = nullptr) noexcept;
  void find_scale_slopes(const Frame& frame, const double* y) noexcept;
  void find_loss_scales();
  void weigh_outputs(const Frame& frame, const double* y, int taken, const double* given) noexcept;
  static double scale_weight(double s, double delta) noexcept;
  double robust_surplus(const double* y, int sensor, int lane) const noexcept;
  int most_probable() const noexcept;
  bool is_of_motion(int output) const noexcept;

  // prior_bank_map.cpp: slip by the place.
  void check_map() const;
  void follow_map() noexcept;
  void add_offsets() noexcept;

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
