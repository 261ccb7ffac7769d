// The interpreter of tapes, compiled once for every instruction set. RHEC_TAPE_SET is its name; for the wide ones
// RHEC_PACK_NAMESPACE is defined, too.
#include <cmath>

#if defined(RHEC_PACK_NAMESPACE)
#include "rhec/core/packs/pack.hpp"
#endif

#include "rhec/core/base/unrolled.hpp"
#include "rhec/core/formula/tape.hpp"

#define RHEC_JOINED(a, b) a##b
#define RHEC_JOIN(a, b) RHEC_JOINED(a, b)
#define RHEC_TEXT_OF(a) #a
#define RHEC_TEXT(a) RHEC_TEXT_OF(a)

namespace rhec {
namespace {

#if defined(RHEC_PACK_NAMESPACE)
using Lane = WidestPack;
constexpr int width = Lane::width;
RHEC_INLINE inline Lane load(const double* from) { return Lane::load(from); }
RHEC_INLINE inline void store(Lane value, double* to) { value.store(to); }
#else
using Lane = double;
constexpr int width = 1;
RHEC_INLINE inline Lane load(const double* from) { return *from; }
RHEC_INLINE inline void store(Lane value, double* to) { *to = value; }
inline std::pair<double, double> sincos(double angle) { return {std::sin(angle), std::cos(angle)}; }
#endif

RHEC_INLINE inline Lane to_power(Lane base, std::uint32_t exponent) {
  Lane result(1.0);
  for (; exponent > 0; exponent >>= 1, base = base * base)
    if (exponent & 1) result = result * base;
  return result;
}

/// Where the operands of an instruction are read.
struct Memory {
  double* registers;
  const double* uniforms;
};
/// A register of `packs` packs, pack by pack.
template <int packs>
struct Register {
  const double* at;
  RHEC_INLINE Register(const Memory& memory, std::uint32_t number)
      : at(memory.registers + static_cast<std::size_t>(number) * (packs * width)) {}
  RHEC_INLINE Lane operator[](int pack) const { return load(at + pack * width); }
};
struct Uniform {
  Lane value;
  RHEC_INLINE Uniform(const Memory& memory, std::uint32_t number) : value(memory.uniforms[number]) {}
  RHEC_INLINE Lane operator[](int) const { return value; }
};

/// One run of instructions: out = function(a, b, c), of which the function reads what it needs.
template <int packs, class A, class B, class C, class Function>
RHEC_INLINE inline void for_run(const TapeOperands* first, std::uint32_t length, const Memory& memory,
                                Function function) {
  for (const TapeOperands* at = first; at != first + length; ++at) {
    const A a(memory, at->a);
    const B b(memory, at->b);
    const C c(memory, at->c);
    double* out = memory.registers + static_cast<std::size_t>(at->out) * (packs * width);
    Lane results[packs];
    for (int pack = 0; pack < packs; ++pack) results[pack] = function(a[pack], b[pack], c[pack]);
    for (int pack = 0; pack < packs; ++pack) store(results[pack], out + pack * width);
  }
}
struct Unused {
  RHEC_INLINE Unused(const Memory&, std::uint32_t) {}
  RHEC_INLINE Unused operator[](int) const { return *this; }
};

/// The same for functions of much code, which stands here once.
template <int packs, class Function>
RHEC_INLINE inline void for_run_of_calls(const TapeOperands* first, std::uint32_t length, const Memory& memory,
                                         Function function) {
  for (const TapeOperands* at = first; at != first + length; ++at) {
    const Register<packs> a(memory, at->a), b(memory, at->b);
    double* out = memory.registers + static_cast<std::size_t>(at->out) * (packs * width);
#pragma GCC unroll 1
    for (int pack = 0; pack < packs; ++pack) store(function(a[pack], b[pack]), out + pack * width);
  }
}

template <int packs>
void run_packs(std::span<const TapeRun> runs, const TapeOperands* operands, const Memory& memory) {
  using std::sqrt, std::exp, std::log, std::sin, std::cos, std::tan, std::tanh, std::asin, std::acos, std::atan,
      std::atan2;
  using R = Register<packs>;
  using U = Uniform;
  using N = Unused;
  for (const TapeRun& run : runs) {
    const TapeOperands* const first = operands;
    const std::uint32_t length = run.length;
    operands += length;
#define RHEC_RUN(A, B, C, FORMULA)                                                     \
  for_run<packs, A, B, C>(first, length, memory,                                       \
                          [](auto a, [[maybe_unused]] auto b, [[maybe_unused]] auto c) \
                              RHEC_INLINE { return Lane(FORMULA); });                  \
  break
#define RHEC_RUN_CALLS(FORMULA)                                                                                        \
  for_run_of_calls<packs>(first, length, memory, [](Lane a, [[maybe_unused]] Lane b) RHEC_INLINE { return FORMULA; }); \
  break
    switch (run.code) {
      case TapeCode::fill:
        RHEC_RUN(U, N, N, a);
      case TapeCode::add_rr:
        RHEC_RUN(R, R, N, a + b);
      case TapeCode::add_ru:
        RHEC_RUN(R, U, N, a + b);
      case TapeCode::subtract_rr:
        RHEC_RUN(R, R, N, a - b);
      case TapeCode::subtract_ur:
        RHEC_RUN(U, R, N, a - b);
      case TapeCode::multiply_rr:
        RHEC_RUN(R, R, N, a * b);
      case TapeCode::multiply_ru:
        RHEC_RUN(R, U, N, a * b);
      case TapeCode::negate:
        RHEC_RUN(R, N, N, -a);
      case TapeCode::reciprocal:
        RHEC_RUN(R, N, N, Lane(1.0) / a);
      case TapeCode::square_root:
        RHEC_RUN(R, N, N, sqrt(a));
      case TapeCode::multiply_add_rrr:
        RHEC_RUN(R, R, R, a * b + c);
      case TapeCode::multiply_add_rur:
        RHEC_RUN(R, U, R, a * b + c);
      case TapeCode::multiply_add_rru:
        RHEC_RUN(R, R, U, a * b + c);
      case TapeCode::multiply_add_ruu:
        RHEC_RUN(R, U, U, a * b + c);
      case TapeCode::multiply_subtract_rrr:
        RHEC_RUN(R, R, R, a * b - c);
      case TapeCode::multiply_subtract_rur:
        RHEC_RUN(R, U, R, a * b - c);
      case TapeCode::subtract_product_rrr:
        RHEC_RUN(R, R, R, c - a * b);
      case TapeCode::subtract_product_rru:
        RHEC_RUN(R, R, U, c - a * b);
      case TapeCode::exponential:
        RHEC_RUN_CALLS(exp(a));
      case TapeCode::logarithm:
        RHEC_RUN_CALLS(log(a));
      case TapeCode::sine:
        RHEC_RUN_CALLS(sin(a));
      case TapeCode::cosine:
        RHEC_RUN_CALLS(cos(a));
      case TapeCode::tangent:
        RHEC_RUN_CALLS(tan(a));
      case TapeCode::arc_sine:
        RHEC_RUN_CALLS(asin(a));
      case TapeCode::arc_cosine:
        RHEC_RUN_CALLS(acos(a));
      case TapeCode::arc_tangent:
        RHEC_RUN_CALLS(atan(a));
      case TapeCode::arc_tangent_2:
        RHEC_RUN_CALLS(atan2(a, b));
      case TapeCode::hyperbolic_tangent:
        RHEC_RUN_CALLS(tanh(a));
      case TapeCode::power:
        for (const TapeOperands* at = first; at != first + length; ++at) {
          const R a(memory, at->a);
          double* out = memory.registers + static_cast<std::size_t>(at->out) * (packs * width);
          for (int pack = 0; pack < packs; ++pack) store(to_power(a[pack], at->b), out + pack * width);
        }
        break;
      case TapeCode::sine_cosine:
        for (const TapeOperands* at = first; at != first + length; ++at) {
          const R a(memory, at->a);
          double* sines = memory.registers + static_cast<std::size_t>(at->out) * (packs * width);
          double* cosines = memory.registers + static_cast<std::size_t>(at->b) * (packs * width);
#pragma GCC unroll 1
          for (int pack = 0; pack < packs; ++pack) {
            const auto [sine, cosine] = sincos(a[pack]);
            store(sine, sines + pack * width);
            store(cosine, cosines + pack * width);
          }
        }
        break;
      case TapeCode::count:
        break;
    }
#undef RHEC_RUN
#undef RHEC_RUN_CALLS
  }
}

void run(std::span<const TapeRun> runs, const TapeOperands* operands, const double* uniforms, double* registers,
         int lanes) {
  const Memory memory{registers, uniforms};
  if (lanes == 8) return run_packs<8 / width>(runs, operands, memory);
  if (lanes == 16) return run_packs<16 / width>(runs, operands, memory);
  run_packs<32 / width>(runs, operands, memory);
}

void load_rows(const double* rows, std::ptrdiff_t step, int count, int columns, double* registers, int lanes) {
  for (int first = 0; first < lanes; first += width) {
    const auto row = [&](int i) { return rows + (first + i < count ? first + i : count - 1) * step; };
#if defined(RHEC_PACK_NAMESPACE)
    for (int column = 0; column < columns; column += width) {
      Lane block[width];
      for (int i = 0; i < width; ++i) block[i] = load(row(i) + column);
      transpose(block);
      double* out = registers + static_cast<std::ptrdiff_t>(column) * lanes + first;
      for (int i = 0; i < width && column + i < columns; ++i) store(block[i], out + i * lanes);
    }
#else
    for (int column = 0; column < columns; ++column)
      registers[static_cast<std::ptrdiff_t>(column) * lanes + first] = row(0)[column];
#endif
  }
}

void store_eight(const int* sources, const double* uniforms, const double* registers, int lanes, double* rows,
                 std::ptrdiff_t step, int count) {
  for (int first = 0; first < count; first += width) {
    const auto value = [&](int source) {
      return source >= 0 ? load(registers + static_cast<std::ptrdiff_t>(source) * lanes + first)
                         : Lane(uniforms[~source]);
    };
    double* const row = rows + first * step;
#if defined(RHEC_PACK_NAMESPACE)
    for (int column = 0; column < 8; column += width) {
      Lane block[width];
      for (int i = 0; i < width; ++i) block[i] = value(sources[column + i]);
      transpose(block);
      for (int i = 0; i < width && first + i < count; ++i) store(block[i], row + i * step + column);
    }
#else
    for (int column = 0; column < 8; ++column) row[column] = value(sources[column]);
#endif
  }
}

}  // namespace

extern const TapeKernels RHEC_JOIN(tape_kernels_, RHEC_TAPE_SET);
constinit const TapeKernels RHEC_JOIN(tape_kernels_, RHEC_TAPE_SET) = {RHEC_TEXT(RHEC_TAPE_SET), &run, &load_rows,
                                                                       &store_eight};

}  // namespace rhec
