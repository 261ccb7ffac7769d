#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rhec/core/base/aligned.hpp"

namespace rhec {

/// Outputs of a model and their Jacobians at the nodes of a moving horizon, and which stages of H hold nothing but what
/// measurements write. Rows are those of Model::observe_rows.
class OutputCache {
 public:
  /// `outputs` and `jacobians` are the entries that a node takes of each.
  OutputCache(int nodes, std::ptrdiff_t outputs, std::ptrdiff_t jacobians);

  double* outputs_of(int node) noexcept { return outputs_.data() + (first_ + node) * output_size_; }
  double* jacobians_of(int node) noexcept { return jacobians_.data() + (first_ + node) * jacobian_size_; }

  /// The next stretch of nodes from `node` to `last` whose outputs are not known, which are marked as known: its first
  /// node (last + 1: there is none) and, behind its last one, `end`.
  int mark_unknown(int node, int last, int& end) noexcept;
  /// 1 for each stage where all of H is zero but for what measurements write to.
  std::uint8_t* is_clean() noexcept { return is_clean_.data(); }

  void forget() noexcept;
  /// What is known of the first `nodes` nodes is now `steps` nodes earlier; of those with `is_same(i)` false no
  /// outputs.
  template <class IsSame>
  void move(int steps, int nodes, const IsSame& is_same) noexcept {
    const int kept = move_marks(steps, nodes);
    for (int i = 0; i < kept; ++i)
      if (!is_same(i)) is_known_[i] = 0;
    if (steps > 0) move_rows(steps, kept);
  }

 private:
  int move_marks(int steps, int nodes) noexcept;
  void move_rows(int steps, int kept) noexcept;

  std::ptrdiff_t output_size_, jacobian_size_;
  int first_ = 0;  ///< place of node 0: what moves towards the front is seldom copied
  AlignedDoubles outputs_, jacobians_;
  std::vector<std::uint8_t> is_known_, is_clean_;
};

}  // namespace rhec
