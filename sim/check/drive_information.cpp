// Information in the measurements along a drive about its unknowns: the initial state and each block of parameters.
#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "rhec/core/base/infinity.hpp"

#include "drives.hpp"

namespace rhec::sim {
namespace {

constexpr double least_sigma = 1e-9;        // of noise, in scales, so that one measurement does not dominate all others
constexpr double largest_null_part = 1e-6;  // of a unit vector, in the undetermined subspace

}  // namespace

void Drives::add_parameters(const Drive& drive, int interval, Eigen::Ref<Matrix> by_unknowns) const {
  const Matrix& jacobian = drive.jacobians[interval];
  const bool with_end = jacobian.cols() > nx_ + nu_ + np_;
  for (int j = 0; j < np_; ++j) {
    const int now = nx_ + blocks_.unknown[j][interval];
    const auto at_start = jacobian.col(nx_ + nu_ + j);
    // On a ramp the interval starts with the previous block's value.
    by_unknowns.col(blocks_.ramp[j][interval] ? now - 1 : now) += at_start;
    if (with_end) by_unknowns.col(now) += jacobian.col(nx_ + nu_ + np_ + j);
  }
}

std::string Drives::name_of_unknown(int unknown) const {
  if (unknown < nx_) return about_.states[unknown].name;
  const int block = unknown - nx_, parameter = blocks_.parameter_of[block];
  const int first = blocks_.unknown[parameter].front(), last = blocks_.unknown[parameter].back();
  const std::string& name = about_.parameters[parameter].name;
  return first == last ? name : fmt::format("{}[{}]", name, block - first);
}

std::vector<std::string> Drives::combinations(Matrix null_space) const {
  std::vector<std::pair<int, std::string>> texts;  // with the first unknown as sort key
  for (Eigen::Index c = 0; c < null_space.cols(); ++c) {
    Eigen::Index pivot = 0;
    Matrix rest = null_space.rightCols(null_space.cols() - c).cwiseAbs();
    Eigen::Index column = 0;
    rest.maxCoeff(&pivot, &column);
    null_space.col(c).swap(null_space.col(c + column));
    null_space.col(c) /= null_space(pivot, c);
    for (Eigen::Index other = 0; other < null_space.cols(); ++other)
      if (other != c) null_space.col(other) -= null_space(pivot, other) * null_space.col(c);
  }
  for (Eigen::Index c = 0; c < null_space.cols(); ++c) {
    const Vector v = null_space.col(c).normalized();
    std::vector<int> order;
    for (int i = 0; i < v.size(); ++i)
      if (std::abs(v[i]) > 0.07 * v.cwiseAbs().maxCoeff()) order.push_back(i);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return std::abs(v[a]) > std::abs(v[b]) + 1e-9; });
    std::string text;
    for (std::size_t k = 0; k < order.size(); ++k) {
      if (k == 4) {
        text += " ...";
        break;
      }
      const double sign = v[order[0]] < 0.0 ? -1.0 : 1.0, weight = sign * v[order[k]];
      const std::string name = name_of_unknown(order[k]);
      if (order.size() == 1)
        text = name;
      else
        text += fmt::format("{}{:.2g} {}", k == 0 ? "" : weight < 0.0 ? " - " : " + ", std::abs(weight), name);
    }
    texts.emplace_back(*std::min_element(order.begin(), order.end()), std::move(text));
  }
  std::sort(texts.begin(), texts.end());
  std::vector<std::string> sorted;
  sorted.reserve(texts.size());
  for (auto& [first, text] : texts) sorted.push_back(std::move(text));
  return sorted;
}

DriveInformation Drives::information(const Drive& drive) const {
  const int blocks = static_cast<int>(blocks_.parameter_of.size()), unknowns = nx_ + blocks, steps = nu_ * intervals_,
            rows = ny_ * (intervals_ + 1);
  DriveInformation found;
  found.name = drive.name;
  found.meaning = drive.meaning;
  found.unusable = drive.unusable;
  found.unknowns = unknowns;
  found.parameter_sigma.assign(np_, infinity);
  found.state_determined.assign(nx_, false);
  if (!drive.unusable.empty()) return found;

  // Unknowns in scales, inputs in standard deviations, rows in standard deviations: [inputs, unknowns] of the outputs,
  // and below it the identity of the measured inputs. The last corner of its triangular factor is the square root of
  // the information after eliminating the inputs (the Schur complement), computed without forming a product.
  const auto noise = [](double sigma, double scale) {
    return std::clamp(sigma, least_sigma * scale, scale / least_sigma);
  };
  Vector scales(unknowns);
  for (int j = 0; j < nx_; ++j) scales[j] = about_.states[j].scale;
  for (int b = 0; b < blocks; ++b) scales[nx_ + b] = about_.parameters[blocks_.parameter_of[b]].scale;
  Matrix by_unknowns = Matrix::Zero(nx_, unknowns), by_inputs = Matrix::Zero(nx_, steps);
  by_unknowns.leftCols(nx_).setIdentity();
  Matrix stacked = Matrix::Zero(rows + steps, steps + unknowns);
  stacked.block(rows, 0, steps, steps).setIdentity();
  for (int k = 0; k <= intervals_; ++k) {
    const Matrix& seen = drive.output_jacobians[k];
    for (int r = 0; r < ny_; ++r) {
      const double weight = 1.0 / noise(checked_.output_sigmas[r], about_.outputs[r].scale);
      stacked.row(k * ny_ + r).head(steps) = weight * seen.row(r) * by_inputs;
      stacked.row(k * ny_ + r).tail(unknowns) = weight * (seen.row(r) * by_unknowns).cwiseProduct(scales.transpose());
    }
    if (k == intervals_) break;
    const auto by_state = drive.jacobians[k].leftCols(nx_);
    by_unknowns = (by_state * by_unknowns).eval();
    by_inputs = (by_state * by_inputs).eval();
    add_parameters(drive, k, by_unknowns);
    for (int j = 0; j < nu_; ++j)
      by_inputs.col(k * nu_ + j) +=
          noise(checked_.input_sigmas[j], about_.inputs[j].scale) * drive.jacobians[k].col(nx_ + j);
  }
  if (!stacked.allFinite()) {
    found.unusable = "its sensitivities are not finite";
    return found;
  }
  Matrix root = Matrix::Zero(unknowns, unknowns);
  const Matrix factor = Eigen::HouseholderQR<Matrix>(stacked).matrixQR();
  const Eigen::Index height = std::min<Eigen::Index>(unknowns, factor.rows() - steps);
  root.topRows(height) = factor.block(steps, steps, height, unknowns).template triangularView<Eigen::Upper>();

  const Eigen::JacobiSVD<Matrix> svd(root, Eigen::ComputeFullV);
  const Vector& values = svd.singularValues();
  while (found.rank < unknowns && values[found.rank] > rank_threshold * values[0]) ++found.rank;
  if (found.rank > 0) found.condition = values[0] / values[found.rank - 1];
  const Matrix& directions = svd.matrixV();
  const auto sigma = [&](int unknown) {
    if (directions.row(unknown).tail(unknowns - found.rank).norm() > largest_null_part) return infinity;
    const Vector parts = directions.row(unknown).head(found.rank).transpose().cwiseQuotient(values.head(found.rank));
    return scales[unknown] * parts.norm();
  };
  for (int j = 0; j < nx_; ++j) found.state_determined[j] = std::isfinite(sigma(j));
  for (int b = 0; b < blocks; ++b) {
    double& best = found.parameter_sigma[blocks_.parameter_of[b]];
    best = std::min(best, sigma(nx_ + b));
  }
  found.undetermined = combinations(directions.rightCols(unknowns - found.rank));
  if (found.rank > 0) found.weakest = combinations(directions.col(found.rank - 1)).front();
  return found;
}

double Drives::condition_of_jacobians(const Drive& drive) const {
  double largest = 0.0;
  for (Matrix jacobian : drive.jacobians) {
    for (int r = 0; r < nx_; ++r) jacobian.row(r) /= about_.states[r].scale;
    for (int c = 0; c < jacobian.cols(); ++c) {
      const Variable& v = c < nx_         ? about_.states[c]
                          : c < nx_ + nu_ ? about_.inputs[c - nx_]
                                          : about_.parameters[(c - nx_ - nu_) % np_];
      jacobian.col(c) *= v.scale;
    }
    const Vector values = Eigen::JacobiSVD<Matrix>(jacobian).singularValues();
    largest = std::max(largest, values[0] / values[values.size() - 1]);
  }
  return largest;
}

}  // namespace rhec::sim
