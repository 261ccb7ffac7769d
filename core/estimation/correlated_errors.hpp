#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "innovation_whiteness.hpp"
#include "walking_filter.hpp"

namespace rhec {

/// By how much larger the covariance of an estimate is than a filter believes, since innovations are correlated.
///
/// Of a position it is told apart along and across the way that the vehicle heads (of the states' directions, whatever
/// the outputs' units and axes are): who knows its speed well, and where it heads, follows a receiver along its way and
/// takes the mean of many fixes across it, where errors that last count most. Each receiver counts by what is learnt
/// from it of late: the variance of a mean of independent sensors with the weights w_i, which add up to one, is
/// sum w_i f_i times what is stated. Of other sensors the largest factor counts, and for all variables: receivers may
/// be too slow or too rough to show what comes of their errors.
///
/// With s_j^2 the factors of the position along and across, and of all else, P becomes D P D,
/// D = R diag(s_along, s_across) R' for the position, s_across for the heading, which is learnt across, s_else I for
/// all else.
class CorrelatedErrors {
 public:
  explicit CorrelatedErrors(const Model& model);
  /// Begins anew, with these sensors; none: nothing is watched.
  void reset(std::span<const Sensor> sensors);
  /// The next innovation of a sensor that was used, after `expect` of the filter that it is of.
  void take(const WalkingFilter& filter, std::size_t index, const Sensor& sensor,
            const Innovation& innovation) noexcept;
  /// By output; null: not watched.
  std::span<const InnovationWhiteness* const> by_output() const noexcept { return by_output_; }
  /// The next estimate, whose covariance of `size` variables has the volume log sqrt(det P). Where it knows less than
  /// usual, as after a jump, that is what is missing; and of this it is right.
  void note(double volume, Eigen::Index size) noexcept;

  bool are_any() const noexcept { return largest() > 1.0; }
  /// Makes a covariance of [x; p], whose state is `state`, as large as it is to be.
  void scale(const Eigen::VectorXd& state, Eigen::MatrixXd& covariance) const noexcept;
  /// Of the variance of any variable.
  double largest() const noexcept;
  /// By how much log sqrt(det P) of `size` variables becomes larger.
  double in_volume(Eigen::Index size) const noexcept;
  /// Geometric mean of the factors of `size` variables.
  double mean(Eigen::Index size) const noexcept;

 private:
  struct Factors {
    double all_else = 1.0, along = 1.0, across = 1.0;  ///< `across`: of the heading as well
  };
  struct Directions {
    InnovationWhiteness along, across;
    double information = 0.0;  ///< sum of 1 / S of late
  };
  Factors found() const noexcept;
  bool has_directions() const noexcept { return x_ >= 0 && y_ >= 0 && heading_ >= 0; }

  int x_, y_, heading_;
  std::vector<InnovationWhiteness> sensors_;
  std::vector<Directions> directions_;  ///< by sensor
  std::vector<const InnovationWhiteness*> by_output_;
  Factors factors_;
  double typical_volume_ = 0.0, volumes_ = 0.0;  ///< mean log sqrt(det P) over so many estimates
};

}  // namespace rhec
