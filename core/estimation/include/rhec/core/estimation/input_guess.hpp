#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// How an input walks that is not measured: within a second by its typical magnitude (Variable::scale), or by as much
/// as it was seen to change in the last seconds, if that is more; up to three typical magnitudes, and between its
/// bounds.
class RHEC_EXPORT InputWalk {
 public:
  explicit InputWalk(const Variable& input) noexcept;
  /// Its mean over an interval [s], the one behind those before; NaN if it is missing.
  void see(double measured, double duration) noexcept;
  /// By how much its variance grows in a duration [s].
  double growth(double duration) const noexcept { return seen_.rate * duration; }
  void walk_at_least(double rate) noexcept { seen_.rate = rate > seen_.rate ? rate : seen_.rate; }
  void forget() noexcept { seen_ = {least_rate_, std::numeric_limits<double>::quiet_NaN(), 0.0}; }

  double lower, upper;
  double widest;  ///< standard deviation, also that of one of which nothing is known
  double start;   ///< mean of one of which nothing is known

  /// What was seen: `state_size` numbers.
  static constexpr std::size_t state_size = 3;
  double* save(double* state) const noexcept;
  const double* restore(const double* state) noexcept;

 private:
  double least_rate_;
  struct Seen {
    double rate;   ///< mean square of its change per second
    double value;  ///< from which the next change is seen
    double age;    ///< of that value [s]
  } seen_;
};

/// What a filter of a state x (n) knows of inputs that are not measured, which walk (InputWalk). The filter's
/// prediction and its updates are those of the joint Gaussian of x and these inputs u, whose means, covariance V and
/// covariance C with x are kept here. Of an input that is measured nothing of that is left: its noise is white.
///
/// Allocates in its constructor only.
class RHEC_EXPORT InputGuess {
 public:
  /// `states`: n.
  InputGuess(std::span<const Variable> inputs, Eigen::Index states);

  void forget() noexcept;
  /// An interval [s] begins at a state with this covariance, with inputs as measured (n_u, NaN where missing).
  void begin(const double* measured, double duration, const Eigen::Ref<const Eigen::MatrixXd>& of_state) noexcept;
  /// From now on an input walks by this variance per second at least, until it is measured.
  void walk_at_least(int input, double rate) noexcept { walks_[static_cast<std::size_t>(input)].walk_at_least(rate); }
  bool is_any_missing() const noexcept { return is_any_missing_; }
  bool is_missing(int input) const noexcept { return is_missing_[static_cast<std::size_t>(input)] != 0; }
  /// Moments on the interval, before anything is measured behind its start. Those of measured inputs are 0.
  double mean(int input) const noexcept { return mean_[input]; }
  const Eigen::MatrixXd& covariance() const noexcept { return covariance_; }  ///< V
  const Eigen::MatrixXd& with_state() const noexcept { return with_state_; }  ///< C, n x n_u

  /// At the interval's end: moments of a missing input given what was measured on the way, one after the other; then
  /// those of the state.
  void set(int input, double mean) noexcept { mean_[input] = mean; }
  void set_covariance(int input, int other, double value) noexcept { covariance_(input, other) = value; }
  void set_with_state(Eigen::Index state, int input, double value) noexcept { with_state_(state, input) = value; }
  void predicted(const Eigen::Ref<const Eigen::VectorXd>& mean,
                 const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept;
  /// The state's moments after an update. With d and D by how much its mean and covariance P have changed, the inputs
  /// move by C' P^-1 d, V by C' P^-1 D P^-1 C, and C by D P^-1 C.
  void updated(const Eigen::Ref<const Eigen::VectorXd>& mean,
               const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept;

  /// All that lasts from an interval to the next: `state_size` numbers.
  std::size_t state_size() const noexcept {
    return static_cast<std::size_t>(mean_.size() + covariance_.size() + with_state_.size()) +
           InputWalk::state_size * walks_.size();
  }
  void save(double* state) const noexcept;
  void restore(const double* state) noexcept;
  /// Whether there is anything known of an input that is not measured.
  bool knows_missing() const noexcept { return covariance_.diagonal().maxCoeff() > 0.0; }
  /// Whether an update of the state would tell of it.
  bool is_predicted() const noexcept { return is_predicted_; }
  /// After `restore` of what was saved behind `predicted`, with the moments that it was given.
  void resume(const Eigen::Ref<const Eigen::VectorXd>& mean,
              const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept;

 private:
  void drop(Eigen::Index input) noexcept;
  void limit(const Eigen::Ref<const Eigen::MatrixXd>& of_state) noexcept;

  std::vector<InputWalk> walks_;
  std::vector<std::uint8_t> is_missing_;
  bool is_any_missing_ = false, is_predicted_ = false;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd covariance_, with_state_;
  Eigen::VectorXd state_mean_, moved_;
  Eigen::MatrixXd state_covariance_, change_, solved_, image_, explained_, left_;
  Eigen::LDLT<Eigen::MatrixXd> factors_, factors_of_inputs_;
};

}  // namespace rhec
