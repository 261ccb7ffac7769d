#include "rhec/sim/telemetry/track_writer.hpp"

#include <cmath>

#include "rhec/sim/telemetry/robot_messages.hpp"

namespace rhec::sim {
namespace {

Eigen::Matrix3d pose_covariance(const Eigen::MatrixXd& covariance, const Roles& roles) {
  Eigen::Matrix3d result = Eigen::Matrix3d::Zero();
  const int places[] = {roles.position_x, roles.position_y, roles.heading};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (places[i] >= 0 && places[j] >= 0) result(i, j) = covariance(places[i], places[j]);
  return result;
}

std::vector<Eigen::Vector3d> plan_of(const Controller& controller, const Roles& roles) {
  std::vector<Eigen::Vector3d> plan;
  const Iterate& iterate = controller.plan();
  for (int i = 0; i <= controller.problem().intervals(); ++i) {
    const double* state = iterate.state(i);
    plan.emplace_back(state[roles.position_x], state[roles.position_y],
                      roles.heading >= 0 ? state[roles.heading] : 0.0);
  }
  return plan;
}

}  // namespace

TrackSample track_sample(const DriveEstimate& estimate, const Robot& robot, logs::Stamp start) {
  const ModelDescription& about = robot.estimated_description();
  const Eigen::Index nx = std::ssize(about.states);
  TrackSample result;
  result.stamp = start + stamp_at(estimate.time);
  result.state = estimate.values.head(nx);
  result.parameters = estimate.values.tail(estimate.values.size() - nx);
  result.health = estimate.health;
  result.findings = estimate.findings;
  if (!estimate.sigmas.allFinite()) return result;
  result.sigmas = estimate.sigmas;
  result.pose_covariance = pose_covariance(estimate.sigmas.cwiseAbs2().asDiagonal(), about.roles);
  return result;
}

TrackSample track_sample(const LoopSample& sample, const Robot& robot, logs::Stamp start) {
  const ModelDescription& about = robot.estimated_description();
  const Estimate& estimate = *sample.estimate;
  const Eigen::Index nx = std::ssize(about.states), np = estimate.parameters.size();
  TrackSample result;
  result.stamp = start + stamp_at(sample.time);
  result.state = estimate.state.head(nx);
  result.parameters = estimate.parameters;
  if (estimate.covariance.size() > 0) {
    const Eigen::VectorXd sigmas = estimate.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
    result.sigmas.resize(nx + np);
    result.sigmas << sigmas.head(nx), sigmas.tail(np);
    result.pose_covariance = pose_covariance(estimate.covariance, about.roles);
  }
  result.health = estimate.health.level;
  if (result.health != HealthLevel::ok && sample.estimator->watch())
    result.findings = sample.estimator->watch()->in_words(estimate.health);
  if (sample.command) result.inputs = sample.command->inputs;
  if (sample.controller && about.roles.position_x >= 0 && about.roles.position_y >= 0) {
    result.plan = plan_of(*sample.controller, about.roles);
    result.plan_step = robot.step();
  }
  return result;
}

}  // namespace rhec::sim
