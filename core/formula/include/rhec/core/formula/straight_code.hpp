#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/graph.hpp"

namespace rhec {

/// A function of straight code, as its author knows it: registers and uniforms are those of a Tape, with the inputs
/// first. A register holds eight rows (stages).
struct StraightFunction {
  const char* name = nullptr;
  int registers = 0, instructions = 0;
  std::span<const int> results = {};  ///< a register or (~source) a uniform, as in Tape

  static constexpr int rows = 8;
};

/// Computes the first `count` rows, at most eight, and those of the last pack that are left.
using StraightRun = void (*)(double* registers, const double* uniforms, int count);

/// The functions compiled for one instruction set; null where one was too long.
struct StraightSet {
  const char* name = nullptr;
  const StraightRun* runs = nullptr;
};

/// All functions of one formula, by number, and what they have in common.
struct StraightCode {
  std::uint64_t fingerprint = 0;  ///< of the formula that they were written from
  int option_count = 0, uniform_count = 0;
  std::span<const StraightFunction> functions = {};  ///< without a name: too long to be compiled
  std::span<const StraightSet> sets = {};            ///< slowest first
  void (*set_uniforms)(const double* options, double* uniforms) = nullptr;

  std::vector<double> uniforms(std::span<const double> options) const {
    std::vector<double> values(static_cast<std::size_t>(uniform_count));
    set_uniforms(options.data(), values.data());
    return values;
  }
};

/// Writes functions of a graph as C++: straight code over packs, in pieces of at most `piece` instructions. The same
/// calls give the same text. Constants are written as hexadecimal numbers, so that none of them is rounded.
class RHEC_EXPORT StraightWriter {
 public:
  static constexpr int piece = 2000;

  /// Of `graph`, in which `options` are inputs with values known when a model is made. A function of more than `most`
  /// instructions is left out.
  StraightWriter(const Graph& graph, std::vector<int> options, int most);
  /// The next function: `inputs` become registers 0, 1, ...
  void add(std::string name, std::span<const int> inputs, std::span<const int> results);
  /// Leaves the next function out.
  void skip() { functions_.emplace_back(); }

  /// What is compiled once for each instruction set, with RHEC_STRAIGHT_SET defined as its name. It defines
  /// `extern const rhec::StraightSet <prefix>_straight_<set>`.
  std::string kernels(const std::string& prefix, const std::string& about) const;
  /// What is compiled once. It defines `const rhec::StraightCode& rhec::<prefix>_kernels()`, which lists those of
  /// `sets` that the machine can run.
  std::string table(const std::string& prefix, const std::string& about, std::uint64_t fingerprint,
                    std::span<const std::string> sets) const;

 private:
  struct Function {
    std::string name, text;
    int registers = 0, instructions = 0;
    std::vector<int> results;
  };
  int uniform(int node, bool is_negated);
  std::string uniform_text(int uniform) const;

  const Graph& graph_;
  std::vector<int> options_;
  int most_;
  std::vector<Function> functions_;
  std::vector<std::pair<int, bool>> uniforms_{{-1, false}};  ///< nodes, and whether their negative is meant
  std::map<std::pair<int, bool>, int> uniform_numbers_;
};

}  // namespace rhec
