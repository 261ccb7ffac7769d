#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "numbers.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"

namespace rhec {

/// What a Kalman filter with walking parameters has calculated last, for one that is asked for the same, to the bit:
/// the judge of measurements goes on from each estimate just as a filter that estimates does.
class FilterMemo {
 public:
  struct Setup {
    KalmanFilter::Noise noise;
    std::vector<double> walk;  ///< n_p, standard deviation of a parameter per square root of a step
    int substeps = 1;
    bool operator==(const Setup&) const = default;
  };
  FilterMemo(Setup setup, Eigen::Index n)
      : prediction(n, setup.noise.input_variances.size()),
        update(n, setup.noise.output_variances.size()),
        setup_(std::move(setup)) {}
  const Setup& setup() const noexcept { return setup_; }

  /// From moments, an input or outputs, and a duration (0 of an update) to moments.
  class Step {
   public:
    Step(Eigen::Index n, std::size_t given) : before_(n), after_(n), given_(given, 0.0) {}

    void begin(std::span<const double> given, double duration, const KalmanFilter& filter) noexcept {
      std::ranges::copy(given, given_.begin());
      duration_ = duration;
      before_.keep(filter);
    }
    void end(const KalmanFilter& filter) noexcept { after_.keep(filter); }
    /// Takes the step with a filter. False, and nothing else, if this is not what was calculated.
    bool take(std::span<const double> given, double duration, KalmanFilter& filter) const noexcept {
      if (duration != duration_ || !are_same(given, given_) || !are_same(numbers(filter.mean), numbers(before_.mean)) ||
          !are_same(numbers(filter.covariance), numbers(before_.covariance)))
        return false;
      copy_numbers(after_.mean, filter.mean);
      copy_numbers(after_.covariance, filter.covariance);
      return true;
    }

   private:
    struct Moments {
      explicit Moments(Eigen::Index n) : mean(Eigen::VectorXd::Zero(n)), covariance(Eigen::MatrixXd::Zero(n, n)) {}
      void keep(const KalmanFilter& filter) noexcept {
        copy_numbers(filter.mean, mean);
        copy_numbers(filter.covariance, covariance);
      }
      Eigen::VectorXd mean;
      Eigen::MatrixXd covariance;
    };
    template <class Matrix>
    static std::span<const double> numbers(const Matrix& matrix) noexcept {
      return {matrix.data(), static_cast<std::size_t>(matrix.size())};
    }
    static bool are_same(std::span<const double> a, std::span<const double> b) noexcept {
      return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
    }

    Moments before_, after_;
    std::vector<double> given_;
    double duration_ = -1.0;  ///< of no step yet
  };
  Step prediction, update;

 private:
  Setup setup_;
};

}  // namespace rhec
