#pragma once

#include "rhec/core/estimation/health.hpp"

// Of innovations and their covariances S, of one sensor each.
namespace rhec {

/// nu' S^-1 nu.
double squared_size(const Innovation::OfSensor<1>& value,
                    const Innovation::OfSensor<Eigen::Dynamic>& covariance) noexcept;

/// L^-1 nu with S = L L': of the covariance 1 where nu has the covariance S; not finite if S is not positive definite.
Innovation::OfSensor<1> normalised(const Innovation::OfSensor<1>& value,
                                   const Innovation::OfSensor<Eigen::Dynamic>& covariance) noexcept;

/// log det S; not a number if S is not positive definite.
double log_determinant(const Innovation::OfSensor<Eigen::Dynamic>& covariance) noexcept;

}  // namespace rhec
