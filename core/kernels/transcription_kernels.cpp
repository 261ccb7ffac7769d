// Compiled once per instruction set RHEC_SET; its table is transcription_kernels_<RHEC_SET>.
#include "rhec/core/kernels/transcription_kernels.hpp"

#include "rhec/core/kernels/lanes.hpp"

namespace rhec {
namespace kernels {
namespace {

void write_bounds(const double* lower, const double* upper, const double* point, double* step_lower, double* step_upper,
                  long count) {
  for (long k = 0; k < count; k += lane_count) {
    const Lanes at = load(point + k), below = load(lower + k) - at, above = load(upper + k) - at;
    store(below, step_lower + k);
    store(above, step_upper + k);
  }
}

void adopt(const GuessView& from, double* values, double* multipliers) {
  constexpr double largest = 1.7976931348623157e308;
  for (int v = 0; v < from.stride; v += lane_count) {
    const auto before = [v](int column) -> LaneMask { return lane_numbers < static_cast<long long>(column - v); };
    const LaneMask is_used = before(from.used), is_state = before(from.states),
                   is_vehicle = before(from.vehicle_states);
    for (int i = 0; i < from.rows; ++i) {
      const long at = static_cast<long>(i) * from.stride + v;
      const Lanes value = load(from.values + at), lower = load(from.lower + at), upper = load(from.upper + at);
      const Lanes clipped = smaller(larger(value, lower), upper), multiplier = load(from.multipliers + at);
      const Lanes limit = absolute(multiplier > 0.0 ? upper : lower);
      const Lanes kept = limit <= largest ? multiplier : Lanes{};
      const Lanes of_used = is_used ? kept : Lanes{};
      store(is_used ? (is_state ? value : clipped) : Lanes{}, values + at);
      store(is_state ? (is_vehicle ? kept : Lanes{}) : of_used, multipliers + at);
    }
  }
}

/// Whether the first `columns` entries of two rows are equal.
inline bool are_equal(const double* a, const double* b, int columns) {
  Lanes differs{};
  for (int k = 0; k < columns; k += lane_count)
    differs += first_of(load(a + k) == load(b + k) ? Lanes{} : all(1.0), 0, columns - k);
  return sum_of(differs) == 0.0;
}

void match(const double* a, const double* b, double* kept, int count, int stride, int columns, unsigned char* marks) {
  for (int i = 0; i < count; ++i, a += stride, b += stride, kept += stride) {
    marks[i] = are_equal(a, b, stride) ? 2 : are_equal(a, b, columns) ? 1 : 0;
    for (int k = 0; k < stride; k += lane_count) store(load(a + k), kept + k);
  }
}

void add_products(const double* J, const double* weights, const double* pulls, int count, int columns, int stride,
                  double* H, double* h) {
  const long width = padded(columns);
  for (int k = 0; k < width; k += lane_count) {
    if (h) {
      Lanes gradient = load(h + k);
      for (int j = 0; j < count; ++j) gradient += load(J + j * width + k) * pulls[j];
      store(gradient, h + k);
    }
    for (int c = 0; H && c < columns; ++c) {
      double* column = H + static_cast<long>(c) * stride + k;
      Lanes sum = load(column);
      for (int j = 0; j < count; ++j) sum += load(J + j * width + k) * (weights[j] * J[j * width + c]);
      store(sum, column);
    }
  }
}

void add_sums(const SumsView& sums, int columns, int stride, double* H, double* h) {
  constexpr int most_points = 9;
  const int points = sums.points;
  for (int k = 0; k < padded(columns); k += lane_count) {
    Lanes G[most_points];
    for (int p = 0; p < points; ++p) G[p] = load(sums.G + p * sums.G_step + k);
    if (h) {
      Lanes gradient = load(h + k);
      for (int p = 0; p < points; ++p) gradient += G[p] * sums.v[p];
      store(gradient, h + k);
    }
    if (!H) continue;
    Lanes product[most_points];  // W G
    for (int p = 0; p < points; ++p) {
      product[p] = G[0] * sums.W[p * sums.W_step];
      for (int q = 1; q < points; ++q) product[p] += G[q] * sums.W[p * sums.W_step + q];
    }
    for (int c = 0; c < columns; ++c) {
      double* const column = H + static_cast<long>(c) * stride + k;
      Lanes sum = load(column);
      for (int p = 0; p < points; ++p) sum += product[p] * sums.G[p * sums.G_step + c];
      store(sum, column);
    }
  }
}

void multiply_rows(const double* C, long c_step, const double* J, long j_step, const ProductSizes& sizes, int width,
                   double* to) {
  for (int j = 0; j < sizes.rows; ++j, C += c_step, to += width)
    for (int k = 0; k < width; k += lane_count) {
      Lanes sum{};
      for (int r = 0; r < sizes.inner; ++r) sum += load(J + r * j_step + k) * C[r];
      store(first_of(sum, k / lane_count, sizes.columns), to + k);
    }
}

/// Differences on circles: `error` minus the nearest multiple of the period.
inline Lanes on_circle(const Lanes& error, const Lanes& period, const Lanes& inverse_period) {
  constexpr double to_integer = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
  return error - ((error * inverse_period + to_integer) - to_integer) * period;
}

/// For rows of a known stride, or any (0).
template <int known_stride>
double write_tracking(const CostView& view, const TrackingView& tracked, int first, int last) {
  const long stride = known_stride > 0 ? known_stride : view.stride, wide = view.states + view.controls;
  double total = 0.0;  // summed stage by stage, so that the result does not depend on how the range is split
  for (int i = first; i <= last; ++i) {
    Lanes of_stage{};
    const bool is_last = i == view.intervals;
    const double* weights = is_last ? tracked.terminal_weights : tracked.stage_weights;
    const int columns = view.states + (is_last ? 0 : view.control_counts[i]);
    for (int k = 0; view.h && k < stride; k += lane_count) {
      const long at = i * stride + k;
      const Lanes weight = first_of(load(weights + k), 0, columns - k);
      Lanes error = load(tracked.values + at) - load(tracked.references + at);
      error = weight > 0.0 ? on_circle(error, load(tracked.periods + k), load(tracked.inverse_periods + k)) : Lanes{};
      const Lanes pull = weight * error;
      store(2.0 * pull, view.h + at);
      of_stage += pull * error;
    }
    total += sum_of(of_stage);
    if (!view.H) continue;
    double* H = view.H + i * wide * stride;
    if (is_last || !view.adds_to_curvature)
      for (int c = 0; c < columns; ++c)
        for (int k = 0; k < stride; k += lane_count) store(Lanes{}, H + c * stride + k);
    for (int k = 0; k < columns; ++k)
      if (weights[k] != 0.0) H[k * stride + k] += 2.0 * weights[k];
  }
  return total;
}

double write_tracking(const CostView& view, const TrackingView& tracked, int first, int last) {
  if (view.stride == 8) return write_tracking<8>(view, tracked, first, last);
  if (view.stride == 16) return write_tracking<16>(view, tracked, first, last);
  return write_tracking<0>(view, tracked, first, last);
}

/// For rows of a known stride, or any (0).
template <int known_stride>
void complete_dynamics(const DynamicsView& view) {
  const long stride = known_stride > 0 ? known_stride : view.stride;
  const int state_parts = known_stride == lane_count ? 1 : (view.states + lane_count - 1) / lane_count;
  for (int i = view.first; i <= view.last; ++i) {
    double *AB = view.AB + i * view.states * stride, *b = view.b + i * stride;
    const double *z = view.values + i * stride, *next = z + stride;
    const int* control_of = view.control_of + i * view.lifted;
    for (int v = 0; v < state_parts; ++v) {
      const LaneMask is_vehicle = lane_numbers < static_cast<long long>(view.vehicle_states - v * lane_count);
      const Lanes reached = is_vehicle ? load(b + v * lane_count) : load(z + v * lane_count);
      store(first_of(reached - load(next + v * lane_count), v, view.states), b + v * lane_count);
    }
    if (view.has_lifted_rows && !view.any_start) continue;
    for (int c = 0; c < view.lifted; ++c) {
      const int row = view.vehicle_states + c, control = control_of[c];
      if (!view.has_lifted_rows) {
        double* AB_row = AB + row * stride;
        for (int k = 0; k < stride; k += lane_count) store(Lanes{}, AB_row + k);
        AB_row[control >= 0 ? view.states + control : row] = 1.0;
      }
      if (control >= 0) b[row] = z[view.states + control] - next[row];
    }
  }
}

void complete_dynamics(const DynamicsView& view) {
  return view.stride == 8 ? complete_dynamics<8>(view) : complete_dynamics<0>(view);
}

void clear_costs(const CostView& view, int first, int last) {
  const long stride = view.stride, wide = view.states + view.controls;
  for (int i = first; i <= last; ++i) {
    const int used = view.states + (i < view.intervals ? view.control_counts[i] : 0);
    for (int k = 0; view.h && k < view.stride; k += lane_count) store(Lanes{}, view.h + i * stride + k);
    if (!view.H) continue;
    double* H = view.H + i * wide * stride;
    for (int c = 0; c < used; ++c)
      for (int k = 0; k < stride; k += lane_count) store(Lanes{}, H + c * stride + k);
  }
}

/// Rows of eight entries, which are enough for most vehicles and their sensors, with a number of outputs that may be
/// known (otherwise 0); or rows of any length.
template <int known_outputs>
struct OneEight {
  static constexpr bool is_known = true;
  static int of(int /*size*/) { return 8; }
  static int count(int outputs) { return known_outputs > 0 ? known_outputs : outputs; }
  static int read(int outputs) { return (count(outputs) + lane_count - 1) / lane_count * lane_count; }
};
struct AnyEights {
  static constexpr bool is_known = false;
  static int of(int size) { return padded(size); }
  static int count(int outputs) { return outputs; }
  static int read(int outputs) { return padded(outputs); }
};

/// The measurements at one node of the range; `seen` are the measured outputs. Returns the sum of squares.
template <bool matrices, bool vectors, class Width>
RHEC_ALWAYS_INLINE inline Lanes write_node(const MeasurementView& measured, long node, const double* seen,
                                           const double* output_weights, const double* predicted, const double* J,
                                           int stride, int used, bool is_clean, double* H, double* h) {
  const int count = Width::count(measured.output_count), outputs = Width::of(count),
            states = Width::of(measured.vehicle_states);
  double *weights = measured.room, *pulls = measured.pulls ? measured.pulls + node * outputs : weights + outputs;
  Lanes total{};
  for (int k = 0; k < Width::read(count); k += lane_count) {
    const Lanes y = load(seen + k), weight = y == y ? 2.0 * load(output_weights + k) : Lanes{};
    if (matrices) store(weight, weights + k);
    if (!vectors) continue;
    Lanes error = load(predicted + k) - y;
    error = y == y ? on_circle(error, load(measured.periods + k), load(measured.inverse_periods + k)) : Lanes{};
    const Lanes pull = weight * error;
    store(pull, pulls + k);
    total += pull * error;
  }
  if (vectors) {
    for (int k = 0; k < states; k += lane_count) {
      Lanes sum{};
      for (int j = 0; j < count; ++j) sum += load(J + j * states + k) * pulls[j];
      store(sum, h + k);
    }
    for (int k = states; k < stride; k += lane_count) store(Lanes{}, h + k);
  }
  if (!matrices) return total;
  if (measured.pulls) {
    add_products(J, weights, nullptr, count, measured.vehicle_states, stride, H, nullptr);
    return total;
  }
  // Rows times their weights; single entries of J are then loaded from memory at no extra cost.
  constexpr int most_known = Width::is_known ? 8 : 1;
  Lanes weighted[most_known][8 / lane_count];
  if (Width::is_known)
    for (int j = 0; j < count; ++j)
      for (int k = 0; k < 8; k += lane_count) weighted[j][k / lane_count] = load(J + j * 8 + k) * weights[j];
  const auto product = [&](int j, int k, int c) RHEC_ALWAYS_INLINE {
    if constexpr (Width::is_known)
      return weighted[j][k / lane_count] * J[j * 8 + c];
    else
      return load(J + j * states + k) * (weights[j] * J[j * states + c]);
  };
  const auto clear = [&](double* row, int from) RHEC_ALWAYS_INLINE {
    if (stride == 8) {
      for (int k = 0; k < 8; k += lane_count)
        if (k >= from) store(Lanes{}, row + k);
    } else {
      for (int k = from; k < stride; k += lane_count) store(Lanes{}, row + k);
    }
  };
  for (int c = 0; c < measured.vehicle_states; ++c) {
    double* row = H + static_cast<long>(c) * stride;
    for (int k = 0; k < states; k += lane_count) {
      Lanes sum{};
      for (int j = 0; j < count; ++j) sum += product(j, k, c);
      store(sum, row + k);
    }
    if (!is_clean) clear(row, states);
  }
  for (int c = measured.vehicle_states; c < used && !is_clean; ++c) clear(H + static_cast<long>(c) * stride, 0);
  return total;
}

template <bool matrices, bool vectors, class Width>
double write_nodes(const CostView& view, const MeasurementView& measured, int first, int last) {
  const long stride = view.stride, wide = view.states + view.controls;
  const int count = Width::count(measured.output_count);
  const long outputs = Width::of(count), J_size = static_cast<long>(count) * Width::of(measured.vehicle_states);
  const double *y = measured.outputs + first * outputs, *predicted = measured.predicted, *J = measured.jacobians;
  const double *output_weights = measured.output_weights, *z = measured.values + first * stride,
               *inputs = measured.inputs + first * stride;
  const int first_input = view.states, end_of_inputs = view.states + measured.input_count;
  double *H = view.H + first * wide * stride, *h = view.h + first * stride;
  Lanes total{};
  for (int i = first; i <= last; ++i) {
    const bool has_inputs = i < view.intervals;
    const int used = view.states + (has_inputs ? view.control_counts[i] : 0);
    const bool is_clean = measured.is_clean && measured.is_clean[i] != 0;
    total += write_node<matrices, vectors, Width>(measured, i - first, y, output_weights, predicted, J, view.stride,
                                                  used, is_clean, H, h);
    if (vectors && has_inputs) {
      for (int k = first_input / lane_count * lane_count; k < end_of_inputs; k += lane_count) {
        const Lanes seen = load(inputs + k), weight = seen == seen ? 2.0 * load(measured.input_weights + k) : Lanes{};
        const Lanes error = seen == seen ? load(z + k) - seen : Lanes{}, pull = weight * error;
        store(load(h + k) + pull, h + k);
        total += pull * error;
      }
    }
    for (int k = first_input; matrices && has_inputs && k < end_of_inputs; ++k) {
      const double curvature = inputs[k] == inputs[k] ? 2.0 * measured.input_weights[k] : 0.0;
      H[k * stride + k] = measured.pulls ? H[k * stride + k] + curvature : curvature;
    }
    y += outputs;
    output_weights += measured.output_weights_step;
    predicted += outputs;
    J += J_size;
    z += stride;
    inputs += stride;
    H += wide * stride;
    h += stride;
  }
  return 0.5 * sum_of(total);
}

template <bool matrices, bool vectors>
double write_measurements(const CostView& view, const MeasurementView& measured, int first, int last) {
  if (measured.output_count <= 8 && measured.vehicle_states <= 8) {
    switch (measured.output_count) {
      case 2:  // position
        return write_nodes<matrices, vectors, OneEight<2>>(view, measured, first, last);
      case 3:  // position and heading or speed
        return write_nodes<matrices, vectors, OneEight<3>>(view, measured, first, last);
      case 4:
        return write_nodes<matrices, vectors, OneEight<4>>(view, measured, first, last);
      default:
        return write_nodes<matrices, vectors, OneEight<0>>(view, measured, first, last);
    }
  }
  return write_nodes<matrices, vectors, AnyEights>(view, measured, first, last);
}

double write_measurements(const CostView& view, const MeasurementView& measured, int first, int last) {
  if (!view.H) return write_measurements<false, true>(view, measured, first, last);
  if (!view.h) return write_measurements<true, false>(view, measured, first, last);
  return write_measurements<true, true>(view, measured, first, last);
}

}  // namespace
}  // namespace kernels

#define RHEC_JOIN(a, b) a##b
#define RHEC_TABLE(name, set) RHEC_JOIN(name, set)
extern const TranscriptionKernels RHEC_TABLE(transcription_kernels_, RHEC_SET);
constinit const TranscriptionKernels RHEC_TABLE(transcription_kernels_, RHEC_SET) = {
    &kernels::write_bounds,   &kernels::match,
    &kernels::adopt,          &kernels::add_products,
    &kernels::add_sums,       &kernels::multiply_rows,
    &kernels::write_tracking, &kernels::complete_dynamics,
    &kernels::clear_costs,    &kernels::write_measurements};

}  // namespace rhec
