#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/graph.hpp"
#include "rhec/core/formula/straight_code.hpp"

namespace rhec {

/// What an instruction of a tape computes. The letters are its operands: r a register, u a uniform.
enum class TapeCode : std::uint32_t {
  fill,  ///< u
  add_rr,
  add_ru,
  subtract_rr,
  subtract_ur,
  multiply_rr,
  multiply_ru,
  negate,
  reciprocal,
  power,  ///< r to the integer b
  square_root,
  exponential,
  logarithm,
  sine,
  cosine,
  sine_cosine,  ///< to `out` and to register b
  tangent,
  arc_sine,
  arc_cosine,
  arc_tangent,
  arc_tangent_2,
  hyperbolic_tangent,
  multiply_add_rrr,  ///< a b + c
  multiply_add_rur,
  multiply_add_rru,
  multiply_add_ruu,
  multiply_subtract_rrr,  ///< a b - c
  multiply_subtract_rur,
  subtract_product_rrr,  ///< c - a b
  subtract_product_rru,
  count
};

/// Result and operands of an instruction: numbers of registers or of uniforms.
struct TapeOperands {
  std::uint32_t out = 0, a = 0, b = 0, c = 0;
};

/// Instructions of one kind that follow each other: the interpreter decides once for all of them.
struct TapeRun {
  TapeCode code;
  std::uint32_t length;
};

/// Eight columns of rows that are written together.
struct StoredEight {
  enum class Kind : std::int32_t {
    all,      ///< each from its register
    first_4,  ///< the others are zero
    constant  ///< `values`, whatever the row
  };
  Kind kind = Kind::constant;
  std::array<std::int32_t, 8> sources{};  ///< where their registers begin, if these have eight lanes
  std::array<double, 8> values{};
};
/// A matrix of results as rows, padded to multiples of eight.
struct StoredRows {
  int rows = 0, eights = 0;  ///< of each row
  std::vector<StoredEight> all;

  const StoredEight* row(int which) const { return all.data() + static_cast<std::ptrdiff_t>(which) * eights; }
};
/// Where rows are written: row r of stage i begins at `to` + i `step` + r `row_step`.
struct RowPlaces {
  double* to;
  std::ptrdiff_t step, row_step;
};

/// A part of a product of sparse matrices whose entries are registers: to[k] += factor * from[k] for `count` registers
/// that follow each other. Without a factor, they are set to zero.
struct SparseProduct {
  std::uint32_t factor = 0, from = 0, to = 0, count = 0;
  static constexpr std::uint32_t none = ~std::uint32_t{0};
};

/// How a tape is run on one instruction set. A register is an array of `lanes` doubles, one for each row (stage) that
/// is evaluated; lanes is 8, 16 or 32. Registers are aligned to 64 bytes. Rows beyond `count` repeat the last one.
struct TapeKernels {
  const char* name;
  void (*run)(std::span<const TapeRun> runs, const TapeOperands* operands, const double* uniforms, double* registers,
              int lanes);
  /// Columns 0, 1, ... of rows that are padded to multiples of eight become registers 0, 1, ...,
  /// in the first `filled` lanes at least.
  void (*load_rows)(const double* rows, std::ptrdiff_t step, int count, int columns, double* registers, int lanes,
                    int filled);
  /// Registers become `rows` rows of `eights` groups each, for the first `count` stages.
  void (*store_rows)(const StoredEight* groups, int rows, int eights, const double* registers, int lanes,
                     const RowPlaces& places, int count);
  /// Sparse products one after the other, on registers of eight lanes.
  void (*add_products)(std::span<const SparseProduct> products, double* registers);
};

/// Those that this machine can run, slowest first.
RHEC_EXPORT std::span<const TapeKernels* const> runnable_tape_kernels() noexcept;
/// The number of lanes for the next of `count` rows: few are left empty.
constexpr int lanes_for(int count) { return count <= 8 ? 8 : count <= 24 ? 16 : 32; }

/// A graph as a linear program: operations in an order in which many of a kind follow each other, products fused with
/// sums, and registers given anew once a value is no longer needed. What depends on constants and on known inputs alone
/// is computed once, when the tape is made: a uniform. Its instructions are interpreted, or a function that was
/// compiled of the same (StraightWriter), which gives the same bits.
class RHEC_EXPORT Tape {
 public:
  /// An input whose value is known.
  struct Known {
    int node;
    double value;
  };

  Tape() = default;
  /// `inputs` become registers 0, 1, ...; throws Error if another input is needed.
  Tape(const Graph& graph, std::span<const int> inputs, std::span<const int> results,
       std::span<const Known> known = {});

  /// A program whose instructions are compiled: its registers have eight lanes. `compiled` is that of an instruction
  /// set.
  Tape(const StraightFunction& function, StraightRun compiled, std::vector<double> uniforms)
      : compiled_(compiled),
        uniforms_(std::move(uniforms)),
        results_(function.results.begin(), function.results.end()),
        register_count_(function.registers),
        instruction_count_(function.instructions) {}
  bool is_compiled() const noexcept { return compiled_ != nullptr; }
  /// How many lanes must be loaded for `count` rows: the interpreter computes all.
  int filled(int lanes, int count) const noexcept { return is_compiled() ? count : lanes; }
  /// The number of lanes for the next of `count` rows.
  int lanes(int count) const noexcept { return is_compiled() ? StraightFunction::rows : lanes_for(count); }

  /// Where the results are: a register or (~source) a uniform.
  const std::vector<int>& results() const noexcept { return results_; }
  const std::vector<double>& uniforms() const noexcept { return uniforms_; }
  /// The source of zeros.
  static constexpr int zero = ~0;
  int register_count() const noexcept { return register_count_; }
  int instruction_count() const noexcept { return instruction_count_; }
  int run_count() const noexcept { return static_cast<int>(runs_.size()); }
  /// Number of doubles of scratch for its registers.
  std::size_t scratch(int lanes) const noexcept { return static_cast<std::size_t>(register_count_) * lanes; }

  /// Results first, first + 1, ... as rows of `columns` entries. Uniforms among them get registers.
  StoredRows rows(int first, int rows, int columns);
  /// A register of zeros, once `rows` was called.
  std::int32_t stored_zero() const noexcept { return fills_.front().at * 8; }
  /// A result of which `rows` was made, as a source of StoredEight.
  std::int32_t stored(std::size_t which) const noexcept { return stored_[which] * 8; }

  /// Computes the results of the first `count` rows; those of others are not to be used.
  void run(const TapeKernels& kernels, double* registers, int lanes, int count) const noexcept {
    if (compiled_)
      compiled_(registers, uniforms_.data(), count);
    else
      kernels.run(runs_, operands_.data(), uniforms_.data(), registers, lanes);
    for (const Fill& fill : fills_)
      std::fill_n(registers + static_cast<std::ptrdiff_t>(fill.at) * lanes, lanes, fill.value);
  }
  /// Value of a result in one lane.
  double result(std::size_t which, const double* registers, int lanes, int lane) const noexcept {
    const std::ptrdiff_t source = results_[which];
    return source >= 0 ? registers[source * lanes + lane] : uniforms_[static_cast<std::size_t>(~source)];
  }

 private:
  /// A register that is the same for all rows.
  struct Fill {
    int at;
    double value;
  };
  int filled_register(double value);

  StraightRun compiled_ = nullptr;
  std::vector<TapeRun> runs_;
  std::vector<TapeOperands> operands_;
  std::vector<double> uniforms_{0.0};
  std::vector<int> results_;
  std::vector<int> stored_;  ///< by result: its register, also where it is uniform; -1: none
  std::vector<Fill> fills_;
  int register_count_ = 0, instruction_count_ = 0;
};

}  // namespace rhec
