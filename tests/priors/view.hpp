#pragma once

// The processes, through their plugins.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include <Eigen/Core>

#include "rhec/core/model/model.hpp"
#include "rhec/core/prior/prior.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec::testing {

using ::testing::HasSubstr;

/// A slip parameter.
inline Variable slip() {
  Variable variable;
  variable.name = "kappa";
  variable.unit = "1";
  variable.lower = 0.0;
  variable.upper = 1.0;
  return variable;
}

inline const Host& host() {
  static const Host instance;
  return instance;
}

inline std::shared_ptr<Prior> make(const std::string& name, const std::string& options = "{}",
                                   const Variable& parameter = slip()) {
  auto made = host().make_prior(name, parse_yaml(options, "test"));
  made->set_up(parameter);
  return made;
}

/// F and Q of an advance.
struct Advance {
  Eigen::MatrixXd F, Q;
  Advance(const Prior& prior, double d) : F(Eigen::MatrixXd::Zero(prior.state_count(), prior.state_count())), Q(F) {
    prior.advance(d, F.data(), Q.data());
  }
};

struct Start {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  explicit Start(const Prior& prior)
      : mean(Eigen::VectorXd::Zero(prior.state_count())),
        covariance(Eigen::MatrixXd::Zero(prior.state_count(), prior.state_count())) {
    prior.start(mean.data(), covariance.data());
  }
};

/// Covariance of the parameter at two places, d apart, for a process that starts at the first.
inline double covariance_over(const Prior& prior, double d) {
  return (Advance(prior, d).F * Start(prior).covariance)(0, 0);
}

}  // namespace rhec::testing
