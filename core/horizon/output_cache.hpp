#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rhec/core/base/aligned.hpp"

namespace rhec {

/// Cache of a model's outputs and their Jacobians at the nodes of a moving horizon. It also marks the stages whose H
/// holds only what measurements write. Rows are those of Model::observe_rows.
class OutputCache {
 public:
  /// `outputs` and `jacobians` are the numbers of entries per node.
  OutputCache(int nodes, std::ptrdiff_t outputs, std::ptrdiff_t jacobians);

  double* outputs_of(int node) noexcept { return outputs_.data() + (first_ + node) * output_size_; }
  double* jacobians_of(int node) noexcept { return jacobians_.data() + (first_ + node) * jacobian_size_; }

  /// Finds the next range of nodes from `node` to `last` without outputs and marks it as known. Returns its first node
  /// (last + 1: there is none); `end` is the node after its last one.
  int mark_unknown(int node, int last, int& end) noexcept;
  /// 1 for each stage whose H is zero except for the entries that measurements write.
  std::uint8_t* is_clean() noexcept { return is_clean_.data(); }

  void forget() noexcept;
  /// Moves the data of the first `nodes` nodes to `steps` nodes earlier; outputs of nodes with `is_same(i)` false are
  /// dropped.
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
  int first_ = 0;  ///< slot of node 0, so that moving rarely copies
  AlignedDoubles outputs_, jacobians_;
  std::vector<std::uint8_t> is_known_, is_clean_;
};

}  // namespace rhec
