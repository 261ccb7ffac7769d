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

/// R of a QR decomposition, on and above the diagonal.
Eigen::MatrixXd triangle_of(const Eigen::MatrixXd& matrix) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(matrix).matrixQR();
}

}  // namespace

void Drives::add_parameters(const Drive& drive, int interval, int first, Eigen::Ref<Matrix> by_unknowns) const {
  const Matrix& jacobian = drive.jacobians[interval];
  const bool with_end = jacobian.cols() > nx_ + nu_ + np_;
  for (int j = 0; j < np_; ++j) {
    const int now = first + blocks_.unknown[j][interval];
    const auto at_start = jacobian.col(nx_ + nu_ + j);
    // On a ramp the interval starts with the previous block's value.
    by_unknowns.col(blocks_.ramp[j][interval] ? now - 1 : now) += at_start;
    if (with_end) by_unknowns.col(now) += jacobian.col(nx_ + nu_ + np_ + j);
  }
}

std::vector<std::string> Drives::names_of_errors() const {
  std::vector<std::string> names;
  for (const int j : checked_.options.biased) names.push_back(about_.outputs[j].name + "_bias");
  for (const int j : checked_.options.scaled) names.push_back(about_.outputs[j].name + "_scale");
  return names;
}

std::string Drives::name_of_unknown(int unknown, int errors) const {
  if (unknown < nx_) return about_.states[unknown].name;
  if (unknown < nx_ + errors) return names_of_errors()[unknown - nx_];
  const int block = unknown - nx_ - errors, parameter = blocks_.parameter_of[block];
  const int first = blocks_.unknown[parameter].front(), last = blocks_.unknown[parameter].back();
  const std::string& name = about_.parameters[parameter].name;
  return first == last ? name : fmt::format("{}[{}]", name, block - first);
}

std::vector<std::string> Drives::combinations(Matrix null_space, int errors) const {
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
      const std::string name = name_of_unknown(order[k], errors);
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

Drives::Root Drives::root(const Drive& drive, bool with_errors) const {
  const std::vector<int>&biased = checked_.options.biased, &scaled = checked_.options.scaled;
  const int biases = with_errors ? static_cast<int>(biased.size()) : 0,
            errors = biases + (with_errors ? static_cast<int>(scaled.size()) : 0);
  const int blocks = static_cast<int>(blocks_.parameter_of.size()), first_block = nx_ + errors,
            unknowns = first_block + blocks, steps = nu_ * intervals_, rows = ny_ * (intervals_ + 1);
  Root found;
  found.errors = errors;
  found.unusable = drive.unusable;
  found.matrix = Matrix::Zero(unknowns, unknowns);
  found.scales = Vector::Ones(unknowns);
  if (!drive.unusable.empty()) return found;

  // Unknowns in scales, inputs in standard deviations, rows in standard deviations: [inputs, unknowns] of the outputs,
  // and below it the identity of the measured inputs. The last corner of its triangular factor is the square root of
  // the information after eliminating the inputs (the Schur complement), computed without forming a product.
  const auto noise = [](double sigma, double scale) {
    return std::clamp(sigma, least_sigma * scale, scale / least_sigma);
  };
  Vector& scales = found.scales;
  for (int j = 0; j < nx_; ++j) scales[j] = about_.states[j].scale;
  for (int e = 0; e < errors; ++e) scales[nx_ + e] = e < biases ? about_.outputs[biased[e]].scale : 1.0;
  for (int b = 0; b < blocks; ++b) scales[first_block + b] = about_.parameters[blocks_.parameter_of[b]].scale;
  Matrix by_unknowns = Matrix::Zero(nx_, unknowns), by_inputs = Matrix::Zero(nx_, steps);
  by_unknowns.leftCols(nx_).setIdentity();
  Matrix stacked = Matrix::Zero(rows + steps, steps + unknowns);
  stacked.block(rows, 0, steps, steps).setIdentity();
  const auto input_sigma = [&](int j) { return noise(checked_.input_sigmas[j], about_.inputs[j].scale); };
  const auto is_of_motion = [&](int r) {
    return std::find(motion_.which().begin(), motion_.which().end(), r) != motion_.which().end();
  };
  for (int k = 0; k <= intervals_; ++k) {
    const Matrix& seen = drive.output_jacobians[k];
    Matrix outputs_by_unknowns = seen * by_unknowns, outputs_by_inputs = seen * by_inputs;
    for (int m = 0; m < motion_.count() && k > 0; ++m) {
      const int r = motion_.which()[m], interval = k - 1;
      const auto slopes = drive.motion_jacobians[interval].row(m);
      outputs_by_unknowns.row(r) = slopes.head(nx_) * by_unknowns;
      outputs_by_inputs.row(r) = slopes.head(nx_) * by_inputs;
      for (int j = 0; j < np_; ++j)
        outputs_by_unknowns(r, first_block + blocks_.unknown[j][interval]) += slopes[nx_ + nu_ + j];
      for (int j = 0; j < nu_; ++j) outputs_by_inputs(r, interval * nu_ + j) += slopes[nx_ + j] * input_sigma(j);
    }
    for (int e = 0; e < errors; ++e) {
      const int r = e < biases ? biased[e] : scaled[e - biases];
      outputs_by_unknowns(r, nx_ + e) = e < biases ? 1.0 : drive.outputs(r, k);
    }
    for (int r = 0; r < ny_; ++r) {
      if (k == 0 && is_of_motion(r)) continue;
      const double weight = 1.0 / noise(checked_.output_sigmas[r], about_.outputs[r].scale);
      stacked.row(k * ny_ + r).head(steps) = weight * outputs_by_inputs.row(r);
      stacked.row(k * ny_ + r).tail(unknowns) = weight * outputs_by_unknowns.row(r).cwiseProduct(scales.transpose());
    }
    if (k == intervals_) break;
    const auto by_state = drive.jacobians[k].leftCols(nx_);
    by_unknowns = (by_state * by_unknowns).eval();
    by_inputs = (by_state * by_inputs).eval();
    add_parameters(drive, k, first_block, by_unknowns);
    for (int j = 0; j < nu_; ++j) by_inputs.col(k * nu_ + j) += input_sigma(j) * drive.jacobians[k].col(nx_ + j);
  }
  if (!stacked.allFinite()) {
    found.unusable = "its sensitivities are not finite";
    return found;
  }
  const Matrix factor = triangle_of(stacked);
  const Eigen::Index height = std::min<Eigen::Index>(unknowns, factor.rows() - steps);
  found.matrix.topRows(height) = factor.block(steps, steps, height, unknowns).template triangularView<Eigen::Upper>();

  if (!found.matrix.allFinite()) found.unusable = "its sensitivities are not finite";
  return found;
}

Eigen::MatrixXd Drives::about_errors(const Root& root) const {
  if (!root.unusable.empty() || root.errors == 0) return Matrix::Zero(0, root.errors);
  const Eigen::Index unknowns = root.matrix.cols(), own = unknowns - root.errors, blocks = own - nx_;
  Matrix reordered(unknowns, unknowns);
  reordered << root.matrix.leftCols(nx_), root.matrix.rightCols(blocks), root.matrix.middleCols(nx_, root.errors);
  const Matrix triangle = triangle_of(reordered).triangularView<Eigen::Upper>();
  // What is left of the errors' columns beside all that the drive's own unknowns can explain: below their triangle, and
  // where that has no rank.
  const Eigen::JacobiSVD<Matrix, Eigen::NoQRPreconditioner> svd(triangle.topLeftCorner(own, own), Eigen::ComputeFullU);
  const Vector& values = svd.singularValues();
  Eigen::Index rank = 0;
  while (rank < own && values[rank] > rank_threshold * values[0]) ++rank;
  Matrix left(unknowns - rank, root.errors);
  left << svd.matrixU().rightCols(own - rank).transpose() * triangle.topRightCorner(own, root.errors),
      triangle.bottomRightCorner(root.errors, root.errors);
  return left;
}

DriveInformation Drives::information(const Drive& drive, const Root& root, const Eigen::MatrixXd& elsewhere) const {
  const int errors = root.errors, first_block = nx_ + errors, unknowns = static_cast<int>(root.scales.size()),
            blocks = unknowns - first_block;
  const Vector& scales = root.scales;
  DriveInformation found;
  found.name = drive.name;
  found.meaning = drive.meaning;
  found.unusable = root.unusable;
  found.unknowns = unknowns;
  found.parameter_sigma.assign(np_, infinity);
  found.state_determined.assign(nx_, false);
  found.error_sigma.assign(errors, infinity);
  if (!found.unusable.empty()) return found;
  Matrix all = Matrix::Zero(unknowns + elsewhere.rows(), unknowns);
  all.topRows(unknowns) = root.matrix;
  if (elsewhere.rows() > 0) all.bottomRows(elsewhere.rows()).middleCols(nx_, errors) = elsewhere;
  // The singular values and right directions of a matrix are those of its triangle.
  const Matrix triangle = triangle_of(all).topRows(unknowns).triangularView<Eigen::Upper>();

  const Eigen::JacobiSVD<Matrix, Eigen::NoQRPreconditioner> svd(triangle, Eigen::ComputeFullV);
  const Vector& values = svd.singularValues();
  // Squares of sensitivities that are finite need not be.
  if (!values.allFinite() || !svd.matrixV().allFinite()) {
    found.unusable = "its sensitivities are not finite";
    return found;
  }
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
    best = std::min(best, sigma(first_block + b));
  }
  for (int e = 0; e < errors; ++e) found.error_sigma[e] = sigma(nx_ + e);
  found.undetermined = combinations(directions.rightCols(unknowns - found.rank), errors);
  if (found.rank > 0) found.weakest = combinations(directions.col(found.rank - 1), errors).front();
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
    // Singular values of the transpose, which has no fewer rows than columns, are those of its triangle.
    const Matrix triangle = triangle_of(jacobian.transpose()).topRows(nx_).triangularView<Eigen::Upper>();
    const Vector values = Eigen::JacobiSVD<Matrix, Eigen::NoQRPreconditioner>(triangle).singularValues();
    largest = std::max(largest, values[0] / values[values.size() - 1]);
  }
  return largest;
}

}  // namespace rhec::sim
