#pragma once

#include <array>
#include <span>
#include <vector>

#include "rhec/core/formula/tape.hpp"

namespace rhec {

/// An instruction between nodes, before it has registers. Operands are nodes, or numbers of uniforms.
struct Instruction {
  TapeCode code = TapeCode::fill;
  int out = -1, second_out = -1;         ///< nodes that it computes
  std::array<int, 3> reads{-1, -1, -1};  ///< nodes in registers
  std::array<int, 3> uniforms{-1, -1, -1};
  int exponent = 0;
};

/// A number that is the same for all rows: a node that depends on constants and options alone, or its negative.
struct UniformNode {
  int node = -1;  ///< -1: zero
  bool is_negated = false;

  friend bool operator==(const UniformNode&, const UniformNode&) = default;
};

/// What is to be done for some results, in the order of the nodes: an instruction for each that is needed, with
/// products fused with sums, sine and cosine of an angle as one, and all that is uniform set apart. Tapes and compiled
/// kernels are made of the same instructions, so that both give the same bits.
struct Instructions {
  std::vector<Instruction> steps;
  std::vector<UniformNode> uniforms{UniformNode{}};  ///< the first one is zero
  std::vector<int> uniform_of;                       ///< by node: its uniform; -1 if it has none

  bool is_uniform(int node) const { return uniform_of[static_cast<std::size_t>(node)] >= 0; }
  int uniform(int node) const { return uniform_of[static_cast<std::size_t>(node)]; }

  /// `options` are inputs that are uniform. Throws Error if any input but these and `inputs` is needed.
  static Instructions select(const Graph& graph, std::span<const int> inputs, std::span<const int> results,
                             std::span<const int> options);
};

}  // namespace rhec
