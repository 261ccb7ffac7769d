// The interpreter of tapes, compiled once for every instruction set. RHEC_TAPE_SET is its name; for the wide ones
// RHEC_PACK_NAMESPACE is defined, too.
#include <algorithm>
#include <cstddef>

#include "rhec/core/formula/lane.hpp"
#include "rhec/core/formula/tape.hpp"

#define RHEC_JOINED(a, b) a##b
#define RHEC_JOIN(a, b) RHEC_JOINED(a, b)
#define RHEC_TEXT_OF(a) #a
#define RHEC_TEXT(a) RHEC_TEXT_OF(a)

namespace rhec {
namespace {

constexpr int width = lane_width;

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
  RHEC_INLINE Lane operator[](int pack) const { return load_lane(at + pack * width); }
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
    for (int pack = 0; pack < packs; ++pack) store_lane(results[pack], out + pack * width);
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
    for (int pack = 0; pack < packs; ++pack) store_lane(function(a[pack], b[pack]), out + pack * width);
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
        RHEC_RUN(R, N, N, reciprocal(a));
      case TapeCode::square_root:
        RHEC_RUN(R, N, N, sqrt(a));
      case TapeCode::multiply_add_rrr:
        RHEC_RUN(R, R, R, multiply_add(a, b, c));
      case TapeCode::multiply_add_rur:
        RHEC_RUN(R, U, R, multiply_add(a, b, c));
      case TapeCode::multiply_add_rru:
        RHEC_RUN(R, R, U, multiply_add(a, b, c));
      case TapeCode::multiply_add_ruu:
        RHEC_RUN(R, U, U, multiply_add(a, b, c));
      case TapeCode::multiply_subtract_rrr:
        RHEC_RUN(R, R, R, multiply_subtract(a, b, c));
      case TapeCode::multiply_subtract_rur:
        RHEC_RUN(R, U, R, multiply_subtract(a, b, c));
      case TapeCode::subtract_product_rrr:
        RHEC_RUN(R, R, R, subtract_product(c, a, b));
      case TapeCode::subtract_product_rru:
        RHEC_RUN(R, R, U, subtract_product(c, a, b));
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
          for (int pack = 0; pack < packs; ++pack) store_lane(to_power(a[pack], at->b), out + pack * width);
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
            store_lane(sine, sines + pack * width);
            store_lane(cosine, cosines + pack * width);
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

#if defined(RHEC_PACK_NAMESPACE)
/// `width` rows, some of which may be the same one, as packs: one for each of at most `width` columns.
template <class Row>
RHEC_INLINE inline void load_block(const Row& row, int columns, double* out, int lanes) {
  Lane block[width];
  for_indices<width>([&](auto i) RHEC_INLINE { block[i] = load_lane(row(i)); });
  transpose(block);
  if (columns >= width) {
    for_indices<width>([&](auto i) RHEC_INLINE { store_lane(block[i], out + i * lanes); });
    return;
  }
  for (int i = 0; i < columns; ++i) store_lane(block[i], out + i * lanes);
}
#endif

void load_rows(const double* rows, std::ptrdiff_t step, int count, int columns, double* registers, int lanes,
               int filled) {
  if (count == 1) {
    for (int column = 0; column < columns; ++column)
      for (int first = 0; first < filled; first += width)
        store_lane(Lane(rows[column]), registers + column * lanes + first);
    return;
  }
  for (int first = 0; first < filled; first += width) {
#if defined(RHEC_PACK_NAMESPACE)
    for (int column = 0; column < columns; column += width) {
      double* const out = registers + static_cast<std::ptrdiff_t>(column) * lanes + first;
      if (first + width <= count) {
        const double* const at = rows + first * step + column;
        load_block([&](int i) RHEC_INLINE { return at + i * step; }, columns - column, out, lanes);
      } else {
        load_block([&](int i) RHEC_INLINE { return rows + std::min(first + i, count - 1) * step + column; },
                   columns - column, out, lanes);
      }
    }
#else
    const double* const row = rows + std::min(first, count - 1) * step;
    for (int column = 0; column < columns; ++column)
      registers[static_cast<std::ptrdiff_t>(column) * lanes + first] = row[column];
#endif
  }
}

#if defined(RHEC_PACK_NAMESPACE)
/// Eight doubles from anywhere.
RHEC_INLINE inline void gather_eight(const double* from, const std::int32_t* offsets, double* to) {
#if defined(__AVX512F__)
  _mm512_storeu_pd(to, _mm512_i32gather_pd(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(offsets)), from, 8));
#elif defined(__AVX2__)
  for_indices<2>([&](auto half) RHEC_INLINE {
    const __m128i four = _mm_loadu_si128(reinterpret_cast<const __m128i*>(offsets + 4 * half));
    _mm256_storeu_pd(to + 4 * half, _mm256_i32gather_pd(from, four, 8));
  });
#else
  for_indices<8>([&](auto i) RHEC_INLINE { to[i] = from[offsets[i]]; });
#endif
}
#endif

#if defined(RHEC_PACK_NAMESPACE)
/// Where eight rows begin: multiples of the distance that an address takes as they are.
struct EightRows {
  std::ptrdiff_t one, three, five, seven;
  explicit EightRows(std::ptrdiff_t step) : one(step), three(3 * step), five(5 * step), seven(7 * step) {}
  template <int i>
  RHEC_INLINE double* row(double* to) const {
    static_assert(i >= 0 && i < 8);
    if constexpr (i == 3 || i == 6) return to + (i / 3) * three;
    if constexpr (i == 5) return to + five;
    if constexpr (i == 7) return to + seven;
    return to + i * one;
  }
};

/// One group of eight columns of eight stages, or of the first `count`.
template <int lanes, bool full>
RHEC_INLINE inline void store_group(const StoredEight& group, const double* registers, double* to,
                                    const EightRows& rows, [[maybe_unused]] int count) {
  const bool is_half = group.kind == StoredEight::Kind::first_4;
  for_indices<8 / width>([&](auto part) RHEC_INLINE {
    constexpr int column = part * width;
    const auto store = [&](const Lane* block, auto first) RHEC_INLINE {
      for_indices<width>([&](auto i) RHEC_INLINE {
        if (full || first + i < count) store_lane(block[i], rows.template row<first + i>(to) + column);
      });
    };
    // One column after the other: its register, and the stages in it.
    const auto from = [&](auto i)
                          RHEC_INLINE { return registers + std::ptrdiff_t{group.sources[column + i]} * (lanes / 8); };
    Lane block[width];
    if (is_half && column + width > 4) {  // zero from column 4 on
      for_indices<8 / width>([&](auto packs) RHEC_INLINE {
        for_indices<width>([&](auto i) RHEC_INLINE {
          if constexpr (column + i < 4)
            block[i] = load_lane(from(i) + packs * width);
          else
            block[i] = Lane(0.0);
        });
#if defined(__AVX512F__)
        transpose_half(block);
#endif
        store(block, std::integral_constant<int, packs * width>());
      });
      return;
    }
    for_indices<8 / width>([&](auto packs) RHEC_INLINE {
      for_indices<width>([&](auto i) RHEC_INLINE { block[i] = load_lane(from(i) + packs * width); });
      transpose(block);
      store(block, std::integral_constant<int, packs * width>());
    });
  });
}
#endif

template <int lanes>
void store_rows_of(const StoredEight* groups, int rows, int eights, const double* registers, const RowPlaces& places,
                   int count) {
#if defined(RHEC_PACK_NAMESPACE)
  const EightRows eight_rows(places.step);
#endif
  for (int r = 0; r < rows; ++r) {
    for (int e = 0; e < eights; ++e, ++groups) {
      double* to = places.to + r * places.row_step + 8 * e;
      if (groups->kind == StoredEight::Kind::constant) {
        Lane values[8 / width];
        for (int k = 0; k < 8 / width; ++k) values[k] = load_lane(groups->values.data() + k * width);
        for (int i = 0; i < count; ++i, to += places.step)
          for (int k = 0; k < 8 / width; ++k) store_lane(values[k], to + k * width);
        continue;
      }
#if defined(RHEC_PACK_NAMESPACE)
      if constexpr (lanes == 8) {
        if (count == 1) {  // a single stage needs no transposition
          gather_eight(registers, groups->sources.data(), to);
          continue;
        }
      }
      int first = 0;
      for (; first + 8 <= count; first += 8, to += 8 * places.step)
        store_group<lanes, true>(*groups, registers + first, to, eight_rows, 8);
      if (first < count) store_group<lanes, false>(*groups, registers + first, to, eight_rows, count - first);
#else
      for (int i = 0; i < count; ++i, to += places.step)
        for (int k = 0; k < 8; ++k) to[k] = registers[std::ptrdiff_t{groups->sources[k]} * (lanes / 8) + i];
#endif
    }
  }
}

void store_rows(const StoredEight* groups, int rows, int eights, const double* registers, int lanes,
                const RowPlaces& places, int count) {
  if (lanes == 8) return store_rows_of<8>(groups, rows, eights, registers, places, count);
  if (lanes == 16) return store_rows_of<16>(groups, rows, eights, registers, places, count);
  store_rows_of<32>(groups, rows, eights, registers, places, count);
}

void add_products(std::span<const SparseProduct> products, double* registers) {
  constexpr int packs = 8 / width;
  const auto at = [&](std::uint32_t number) RHEC_INLINE { return registers + static_cast<std::size_t>(number) * 8; };
  for (const SparseProduct& product : products) {
    double* to = at(product.to);
    if (product.factor == SparseProduct::none) {
      std::fill_n(to, static_cast<std::size_t>(product.count) * 8, 0.0);
      continue;
    }
    Lane factor[packs];
    for (int k = 0; k < packs; ++k) factor[k] = load_lane(at(product.factor) + k * width);
    const double* from = at(product.from);
    for (std::uint32_t n = 0; n < product.count; ++n, from += 8, to += 8)
      for (int k = 0; k < packs; ++k)
        store_lane(multiply_add(factor[k], load_lane(from + k * width), load_lane(to + k * width)), to + k * width);
  }
}

}  // namespace

extern const TapeKernels RHEC_JOIN(tape_kernels_, RHEC_TAPE_SET);
constinit const TapeKernels RHEC_JOIN(tape_kernels_, RHEC_TAPE_SET) = {RHEC_TEXT(RHEC_TAPE_SET), &run, &load_rows,
                                                                       &store_rows, &add_products};

}  // namespace rhec
