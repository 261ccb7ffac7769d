#include "rhec/core/model/step_graph.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "chain_rule.hpp"

namespace rhec {
namespace {

template <class... Lists>
std::vector<int> joined(const Lists&... lists) {
  std::vector<int> all;
  (all.insert(all.end(), lists.begin(), lists.end()), ...);
  return all;
}

/// Builds a step from f at each of its stages: f_k = f(a_k), with the arguments a_k = [x_k; p_k; u].
class StepBuilder {
 public:
  StepBuilder(const VehicleGraph& vehicle, bool ramp)
      : graph_(*vehicle.graph),
        vehicle_(vehicle),
        ramp_(ramp),
        arguments_(joined(vehicle.states, vehicle.parameters, vehicle.inputs)) {
    step_.z = arguments_;
    if (ramp) {
      for (std::size_t j = 0; j < vehicle.parameters.size(); ++j) step_.z.push_back(graph_.input("p_end"));
      step_.fraction = graph_.input("fraction");
      step_.share = graph_.input("share");
    }
    step_.h = graph_.input("h");
    for (std::size_t j = 0; j < vehicle.states.size(); ++j) step_.weights.push_back(graph_.input("weight"));
  }

  StepGraph make(StepCurvature curvature) {
    take();
    if (curvature == StepCurvature::no_derivatives) return std::move(step_);
    step_.jacobian = jacobian(graph_, step_.next, step_.z);
    if (curvature == StepCurvature::no_hessian) return std::move(step_);
    if (curvature != StepCurvature::stages)
      step_.hessian = weighted_hessian(graph_, step_.next, step_.weights, step_.z);
    if (curvature != StepCurvature::whole) {
      NodeMatrix staged = by_stages();
      // Together with the Jacobian, which is always computed with it.
      const auto operations = [&](const NodeMatrix& hessian) {
        return graph_.count_operations(joined(step_.next, step_.jacobian.nodes, hessian.nodes));
      };
      if (curvature == StepCurvature::stages || operations(staged) < operations(step_.hessian))
        step_.hessian = std::move(staged);
    }
    return std::move(step_);
  }

 private:
  int nx() const { return static_cast<int>(vehicle_.states.size()); }
  int np() const { return static_cast<int>(vehicle_.parameters.size()); }
  int nz() const { return static_cast<int>(step_.z.size()); }
  int scaled(double factor, int node) { return graph_.multiply(graph_.constant(factor), node); }

  void take() {
    std::vector<int> rates;
    for (int k = 0; k < 4; ++k) {
      std::vector<int> at = arguments_;
      for (int j = 0; j < nx() && k > 0; ++j)
        at[j] = graph_.add(at[j], graph_.multiply(scaled(ClassicalMethod::reach[k], step_.h), rates[j]));
      for (int j = 0; j < np() && ramp_; ++j) {
        const int moved = graph_.add(step_.fraction, scaled(ClassicalMethod::reach[k], step_.share));
        const int range = graph_.subtract(step_.z[arguments_.size() + j], at[nx() + j]);
        at[nx() + j] = graph_.add(at[nx() + j], graph_.multiply(range, moved));
      }
      rates = graph_.substitute(vehicle_.rates, arguments_, at);
      stages_.push_back({at, rates});
    }
    for (int j = 0; j < nx(); ++j) {
      const int outer = graph_.add(stages_[0].rates[j], stages_[3].rates[j]),
                inner = graph_.add(stages_[1].rates[j], stages_[2].rates[j]);
      const int mean = graph_.add(scaled(ClassicalMethod::share[0], outer), scaled(ClassicalMethod::share[1], inner));
      step_.next.push_back(graph_.add(step_.z[j], graph_.multiply(step_.h, mean)));
    }
  }

  /// The Hessian of w'F by adjoint second-order sensitivities. The step is
  ///
  ///     a_k = [x_k; p_k; u],  x_1 = x,  x_k = x + h c_k f(a_{k-1}),  F = x + h sum_k b_k f(a_k),
  ///
  /// with c = (0, 1/2, 1/2, 1) and b = (1/6, 1/3, 1/3, 1/6) for `reach` and `share`. The derivative mu_k of w'F by
  /// f(a_k) follows backwards, since f(a_k) enters F and, by x_{k+1}, f(a_{k+1}):
  ///
  ///     mu_4 = h b_4 w,      mu_k = h b_k w + h c_{k+1} f_x(a_{k+1})' mu_{k+1}
  ///
  /// All other lines are linear, so that the curvature is that of f alone: with S_k = d a_k / dz,
  ///
  ///     d2(w'F)/dz2 = sum_k S_k' (sum_r mu_k,r d2f_r(a_k)) S_k
  ///
  /// (Griewank and Walther, Evaluating Derivatives, 2008, section 5.1; the adjoint scheme is that of Hager, Runge-Kutta
  /// methods in optimal control and the transformed adjoint system, Numerische Mathematik 87, 2000).
  NodeMatrix by_stages() {
    const std::vector<int>& rates = vehicle_.rates;
    std::vector<int> mu;
    mu.reserve(static_cast<std::size_t>(nx()));
    for (int r = 0; r < nx(); ++r) mu.push_back(graph_.input("mu"));
    const NodeMatrix slope = jacobian(graph_, rates, arguments_);
    const NodeMatrix bend = weighted_hessian(graph_, rates, mu, arguments_);
    const int zero = graph_.constant(0.0), n = nz(), na = static_cast<int>(arguments_.size());

    std::vector<int> adjoint;  // mu_k
    NodeMatrix hessian{n, n, std::vector<int>(static_cast<std::size_t>(n) * n, zero)};
    for (int k = 3; k >= 0; --k) {
      std::vector<int> now;
      std::vector<int> pulled(nx(), zero);
      if (k < 3) {
        const std::vector<int> slopes = graph_.substitute(slope.nodes, arguments_, stages_[k + 1].arguments);
        for (int c = 0; c < nx(); ++c)
          for (int r = 0; r < nx(); ++r)
            pulled[c] = graph_.add(pulled[c], graph_.multiply(slopes[r * na + c], adjoint[r]));
      }
      for (int c = 0; c < nx(); ++c) {
        int node = graph_.multiply(scaled(ClassicalMethod::share[k], step_.h), step_.weights[c]);
        if (k < 3) node = graph_.add(node, graph_.multiply(scaled(ClassicalMethod::reach[k + 1], step_.h), pulled[c]));
        now.push_back(node);
      }
      adjoint = now;
      const std::vector<int> curvature =
          graph_.substitute(bend.nodes, joined(arguments_, mu), joined(stages_[k].arguments, adjoint));
      const NodeMatrix S = jacobian(graph_, stages_[k].arguments, step_.z, Accumulation::forward);
      add_product(curvature, S, hessian);
    }
    for (int i = 0; i < n; ++i)
      for (int j = i + 1; j < n; ++j) hessian.at(i, j) = hessian.at(j, i);
    return hessian;
  }

  /// The lower triangle of S' C S.
  void add_product(const std::vector<int>& C, const NodeMatrix& S, NodeMatrix& into) {
    const int na = S.rows, n = S.columns;
    for (int b = 0; b < na; ++b) {
      for (int j = 0; j < n; ++j) {
        int product = graph_.constant(0.0);
        for (int a = 0; a < na; ++a) product = graph_.add(product, graph_.multiply(C[b * na + a], S.at(a, j)));
        if (graph_.is_constant(product, 0.0)) continue;
        for (int i = j; i < n; ++i) into.at(i, j) = graph_.add(into.at(i, j), graph_.multiply(S.at(b, i), product));
      }
    }
  }

  struct Stage {
    std::vector<int> arguments, rates;
  };
  Graph& graph_;
  const VehicleGraph& vehicle_;
  bool ramp_;
  std::vector<int> arguments_;
  std::vector<Stage> stages_;
  StepGraph step_;
};

}  // namespace

std::vector<int> StepGraph::arguments() const {
  std::vector<int> all = joined(z, std::vector<int>{h});
  if (fraction >= 0) all = joined(all, std::vector<int>{fraction, share});
  return joined(all, weights);
}

StepGraph StepGraph::make(const VehicleGraph& vehicle, bool ramp, StepCurvature curvature) {
  return StepBuilder(vehicle, ramp).make(curvature);
}

}  // namespace rhec
