#include "active_set.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/QR>

namespace rhec::nlopt {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;
using Eigen::Index;

constexpr int most_rounds = 60;
// Rounds in which many bounds enter and leave at once. After these they change one at a time, which cycles less easily.
constexpr int hasty_rounds = 12;
constexpr double rank_tolerance = 1e-10;

/// minimise |A z - b| subject to z >= 0.
Vector nonnegative_least_squares(const Matrix& A, const Vector& b) {
  const Index count = A.cols();
  Vector z = Vector::Zero(count);
  std::vector<Index> passive;
  std::vector<char> is_passive(static_cast<std::size_t>(count), 0);
  const double tolerance = 1e-14 * (1.0 + (A.transpose() * b).cwiseAbs().maxCoeff());
  const Matrix right = b;  // takes the compiler two seconds less than a vector
  Matrix chosen;
  for (Index round = 0; round < 3 * count + 10; ++round) {
    const Vector descent = A.transpose() * (b - A * z);
    Index entering = -1;
    for (Index k = 0; k < count; ++k)
      if (!is_passive[static_cast<std::size_t>(k)] && descent[k] > tolerance &&
          (entering < 0 || descent[k] > descent[entering]))
        entering = k;
    if (entering < 0) break;
    passive.push_back(entering);
    is_passive[static_cast<std::size_t>(entering)] = 1;
    while (!passive.empty()) {
      chosen.resize(A.rows(), static_cast<Index>(passive.size()));
      for (std::size_t k = 0; k < passive.size(); ++k) chosen.col(static_cast<Index>(k)) = A.col(passive[k]);
      const Vector wanted = chosen.colPivHouseholderQr().solve(right);
      double length = 1.0;
      for (std::size_t k = 0; k < passive.size(); ++k) {
        const double now = z[passive[k]], then = wanted[static_cast<Index>(k)];
        if (then <= 0.0) length = std::min(length, now / (now - then));
      }
      if (!(length >= 0.0)) length = 0.0;
      for (std::size_t k = 0; k < passive.size(); ++k)
        z[passive[k]] += length * (wanted[static_cast<Index>(k)] - z[passive[k]]);
      if (length == 1.0) break;
      const auto leaves = [&](Index k) {
        if (z[k] > 1e-15 * (1.0 + z.cwiseAbs().maxCoeff())) return false;
        z[k] = 0.0;
        is_passive[static_cast<std::size_t>(k)] = 0;
        return true;
      };
      const auto end = std::remove_if(passive.begin(), passive.end(), leaves);
      if (end == passive.end()) break;
      passive.erase(end, passive.end());
    }
    // The entering variable left at once: only rounding is left.
    if (!is_passive[static_cast<std::size_t>(entering)]) break;
  }
  return z;
}

}  // namespace

Vector recover_multipliers(const CondensedQp& qp, const Vector& scale, double distance) {
  const Index n = qp.variables();
  Vector multipliers = Vector::Zero(qp.bounds());
  struct Candidate {
    Index bound;
    double sign;
  };
  std::vector<Candidate> candidates;
  bool any_row = false;
  for (Index k = 0; k < qp.bounds(); ++k) {
    if (-qp.lower[k] <= distance) candidates.push_back({k, -1.0});
    if (qp.upper[k] <= distance) candidates.push_back({k, 1.0});
    any_row = any_row || (k >= n && !candidates.empty() && candidates.back().bound == k);
  }
  if (candidates.empty()) return multipliers;
  if (!any_row) {
    for (const Candidate& c : candidates)
      if (c.sign * qp.gradient[c.bound] < 0.0) multipliers[c.bound] = -qp.gradient[c.bound];
    return multipliers;
  }
  Matrix normals = Matrix::Zero(n, static_cast<Index>(candidates.size()));
  Vector lengths(normals.cols());
  for (Index k = 0; k < normals.cols(); ++k) {
    const Candidate& c = candidates[static_cast<std::size_t>(k)];
    if (c.bound < n) {
      normals(c.bound, k) = c.sign / scale[c.bound];
    } else {
      normals.col(k) = c.sign * qp.jacobian.row(c.bound - n).transpose().cwiseQuotient(scale);
    }
    lengths[k] = std::max(normals.col(k).norm(), 1e-300);
    normals.col(k) /= lengths[k];
  }
  const Vector found = nonnegative_least_squares(normals, -qp.gradient.cwiseQuotient(scale));
  for (Index k = 0; k < normals.cols(); ++k) {
    const Candidate& c = candidates[static_cast<std::size_t>(k)];
    multipliers[c.bound] += c.sign * found[k] / lengths[k];
  }
  return multipliers;
}

bool solve_active_set(const CondensedQp& qp, const Matrix& hessian, Vector& step, Vector& multipliers) {
  const Index n = qp.variables(), count = qp.bounds();
  std::vector<int> side(static_cast<std::size_t>(count));
  const auto side_of = [&](Index k) -> int& { return side[static_cast<std::size_t>(k)]; };
  for (Index k = 0; k < count; ++k) side_of(k) = multipliers[k] > 0.0 ? 1 : multipliers[k] < 0.0 ? -1 : 0;
  for (Index k = 0; k < count; ++k)
    if (qp.lower[k] == qp.upper[k] && side_of(k) == 0) side_of(k) = 1;
  const auto target = [&](Index k) { return side_of(k) > 0 ? qp.upper[k] : qp.lower[k]; };

  std::vector<Index> free_ones, held_rows;
  Vector d(n), found(count);
  for (int round = 0; round < most_rounds; ++round) {
    free_ones.clear();
    held_rows.clear();
    d.setZero();
    for (Index k = 0; k < n; ++k) {
      if (side_of(k) == 0) {
        free_ones.push_back(k);
      } else {
        d[k] = target(k);
      }
    }
    for (Index k = n; k < count; ++k)
      if (side_of(k) != 0) held_rows.push_back(k);
    const auto f = static_cast<Index>(free_ones.size()), r = static_cast<Index>(held_rows.size());

    // The active rows, restricted to the free variables: R' y = right-hand side, in the basis [Y Z] of a QR
    // decomposition.
    Matrix normals(f, r);
    Vector wanted(r);
    for (Index k = 0; k < r; ++k) {
      const Index row = held_rows[static_cast<std::size_t>(k)] - n;
      for (Index j = 0; j < f; ++j) normals(j, k) = qp.jacobian(row, free_ones[static_cast<std::size_t>(j)]);
      wanted[k] = target(row + n) - qp.jacobian.row(row).dot(d);
    }
    Index rank = 0;
    Matrix basis = Matrix::Identity(f, f);
    Eigen::ColPivHouseholderQR<Matrix> decomposition;
    Vector in_range;
    if (r > 0 && f > 0) {
      decomposition.setThreshold(rank_tolerance);
      decomposition.compute(normals);
      rank = decomposition.rank();
      basis = decomposition.householderQ();
      const Vector permuted = decomposition.colsPermutation().transpose() * wanted;
      in_range = decomposition.matrixR()
                     .topLeftCorner(rank, rank)
                     .triangularView<Eigen::Upper>()
                     .transpose()
                     .solve(permuted.head(rank));
    }
    const auto take = [&](const Vector& full) {
      Vector part(f);
      for (Index k = 0; k < f; ++k) part[k] = full[free_ones[static_cast<std::size_t>(k)]];
      return part;
    };
    const auto put = [&](const Vector& part) {
      for (Index k = 0; k < f; ++k) d[free_ones[static_cast<std::size_t>(k)]] = part[k];
    };
    if (rank > 0) put(basis.leftCols(rank) * in_range);
    if (f > rank) {
      Matrix free_hessian(f, f);
      for (Index j = 0; j < f; ++j)
        for (Index k = 0; k < f; ++k)
          free_hessian(k, j) = hessian(free_ones[static_cast<std::size_t>(k)], free_ones[static_cast<std::size_t>(j)]);
      const auto Z = basis.rightCols(f - rank);
      const Matrix curved = free_hessian * Z, reduced = Z.transpose() * curved;
      const Eigen::LLT<Matrix> factor(reduced);
      if (factor.info() != Eigen::Success) return false;
      const Vector slope = Z.transpose() * take(qp.gradient + hessian * d);
      const Vector along = -factor.solve(slope);
      Vector part = Z * along;
      if (rank > 0) part += basis.leftCols(rank) * in_range;
      put(part);
    }
    Vector left = qp.gradient + hessian * d;
    found.setZero();
    if (rank > 0) {
      const Vector projected = -(basis.leftCols(rank).transpose() * take(left));
      Vector permuted = Vector::Zero(r);
      permuted.head(rank) =
          decomposition.matrixR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>().solve(projected);
      const Vector rows = decomposition.colsPermutation() * permuted;
      for (Index k = 0; k < r; ++k) {
        const Index row = held_rows[static_cast<std::size_t>(k)];
        found[row] = rows[k];
        left += rows[k] * qp.jacobian.row(row - n).transpose();
      }
    }
    for (Index k = 0; k < n; ++k)
      if (side_of(k) != 0) found[k] = -left[k];

    // Bounds with a multiplier of the wrong sign leave, violated bounds enter.
    const Vector rows = qp.jacobian * d;
    const double largest = found.size() > 0 ? found.cwiseAbs().maxCoeff() : 0.0;
    int changes = 0;
    Index worst = -1;
    double worst_measure = 0.0;
    int worst_side = 0;
    const auto change = [&](Index k, int to, double measure) {
      ++changes;
      if (round < hasty_rounds) {
        side_of(k) = to;
      } else if (measure > worst_measure) {
        worst = k;
        worst_measure = measure;
        worst_side = to;
      }
    };
    for (Index k = 0; k < count; ++k) {
      const double value = k < n ? d[k] : rows[k - n];
      const double slack = 1e-12 * (1.0 + std::abs(value));
      if (side_of(k) != 0 && qp.lower[k] != qp.upper[k] && found[k] * side_of(k) < -1e-13 * (1.0 + largest)) {
        change(k, 0, std::abs(found[k]) / (1.0 + largest));
      } else if (value > qp.upper[k] + slack) {
        if (side_of(k) == 1) return false;  // active and yet violated: the active rows contradict each other
        change(k, 1, value - qp.upper[k]);
      } else if (value < qp.lower[k] - slack) {
        if (side_of(k) == -1) return false;
        change(k, -1, qp.lower[k] - value);
      }
    }
    if (changes == 0) {
      if (!d.allFinite() || !found.allFinite()) return false;
      step = d;
      multipliers = found;
      return true;
    }
    if (worst >= 0) side_of(worst) = worst_side;
  }
  return false;
}

}  // namespace rhec::nlopt
