// Compiled once for every instruction set RHEC_SET; its table is program_kernels_<RHEC_SET>.
#include "program_kernels.hpp"

#include "lanes.hpp"

namespace rhec {
namespace kernels {
namespace {

/// The parts of a row that a stage uses.
inline int parts_of(const ProgramView& view, int stage) {
  const int controls = stage < view.intervals ? view.control_counts[stage] : 0;
  return (view.states + controls + lane_count - 1) / lane_count;
}

KktParts kkt(const ProgramView& view) {
  const long stride = view.stride;
  const int state_parts = (view.states + lane_count - 1) / lane_count;
  Lanes stationarity{}, defect{}, violation{}, complementarity{}, term{},
      rest{};  // rest stays 0 as long as all is finite
  for (int i = 0; i <= view.intervals; ++i) {
    const double* row_F = view.F + i * view.states * stride;
    const double* next_costate = view.costates + (i + 1) * stride;
    const int next_states = i < view.intervals ? view.state_counts[i + 1] : 0, parts = parts_of(view, i);
    const int used = view.states + (i < view.intervals ? view.control_counts[i] : 0);
    for (int v = 0; v < parts; ++v) {
      const long at = i * stride + v * lane_count;
      const Lanes gradient = load(view.h + at), bound = first_of(load(view.bounds + at), v, used);
      Lanes sum = gradient + bound;
      for (int l = 0; l < next_states; ++l) sum += load(row_F + l * stride + v * lane_count) * next_costate[l];
      if (v < state_parts) {
        const Lanes costate = first_of(load(view.costates + at), v, view.states);
        sum -= costate;
        term = larger(term, absolute(costate));
        if (i == 0 && !view.initial_state_is_given) stationarity = larger(stationarity, absolute(costate));
      }
      stationarity = larger(stationarity, absolute(sum));
      rest += sum - sum;
      term = larger(term, larger(absolute(gradient), absolute(bound)));
      const Lanes lower = load(view.lower + at), upper = load(view.upper + at);
      violation = larger(violation, larger(lower, -upper));
      // A multiplier at a bound that does not exist is as wrong as it is large.
      const Lanes gap = bound > 0.0 ? absolute(upper) : absolute(lower);
      const Lanes pull = absolute(bound);
      complementarity = larger(complementarity, pull > 0.0 ? pull * smaller(all(1.0), gap) : Lanes{});
    }
    if (i == view.intervals) break;
    for (int v = 0; v < state_parts; ++v) {
      const Lanes b = load(view.b + i * stride + v * lane_count);
      defect = larger(defect, absolute(b));
      rest += b - b;
    }
  }
  double not_finite = 0.0;
  for (int k = 0; k < lane_count; ++k) not_finite += rest[k];
  return {largest_of(stationarity) + not_finite, largest_of(defect), largest_of(violation), largest_of(complementarity),
          largest_of(term)};
}

StepParts check_step(const ProgramView& view, double tolerance) {
  const long stride = view.stride;
  const int state_parts = (view.states + lane_count - 1) / lane_count;
  Lanes excess = all(-1.0), costates{}, rest{};  // rest stays 0 as long as all is finite
  for (int i = 0; i <= view.intervals; ++i) {
    const int parts = parts_of(view, i);
    for (int v = 0; v < parts; ++v) {
      const long at = i * stride + v * lane_count;
      const Lanes z = load(view.values + at), lower = load(view.lower + at), upper = load(view.upper + at);
      rest += z - z;
      Lanes below = lower - z - tolerance * (1.0 + absolute(lower));
      Lanes above = z - upper - tolerance * (1.0 + absolute(upper));
      if (i == 0 && view.initial_state_is_given) {
        const LaneMask controls = lane_numbers >= static_cast<long long>(view.states - v * lane_count);
        below = controls ? below : all(-1.0);
        above = controls ? above : all(-1.0);
      }
      excess = larger(excess, larger(below, above));
    }
    for (int v = 0; v < state_parts; ++v) {
      const Lanes costate = first_of(load(view.costates + i * stride + v * lane_count), v, view.states);
      costates = larger(costates, absolute(costate));
      rest += costate - costate;
    }
  }
  double sum = 0.0;
  for (int k = 0; k < lane_count; ++k) sum += rest[k];
  return {sum == 0.0, largest_of(excess) > 0.0, largest_of(costates)};
}

bool mark_bounds(const ProgramView& view, double tolerance, unsigned char* marks) {
  const long stride = view.stride;
  Lanes crossed{};
  for (int i = 0; i <= view.intervals; ++i) {
    const int parts = parts_of(view, i);
    Lanes marked{};
    for (int v = 0; v < parts; ++v) {
      const long at = i * stride + v * lane_count;
      const Lanes lower = load(view.lower + at), upper = load(view.upper + at), size = 1.0 + absolute(lower);
      const Lanes one = all(1.0), none{};
      Lanes is_crossed = lower - upper <= tolerance * size ? none : one;
      Lanes is_marked = load(view.bounds + at) != 0.0 ? one : none;
      is_marked = upper - lower <= smaller(1e-14 * size, all(1e300)) ? one : is_marked;
      if (i == 0 && view.initial_state_is_given) {
        const LaneMask controls = lane_numbers >= static_cast<long long>(view.states - v * lane_count);
        is_crossed = controls ? is_crossed : none;
        is_marked = controls ? is_marked : none;
      }
      crossed += is_crossed;
      marked += is_marked;
    }
    double sum = 0.0;
    for (int k = 0; k < lane_count; ++k) sum += marked[k];
    marks[i] = sum != 0.0;
  }
  return largest_of(crossed) > 0.0;
}

void subtract(const double* a, const double* b, double* out, long count) {
  for (long k = 0; k < count; k += lane_count) store(load(a + k) - load(b + k), out + k);
}

void add(const double* from, const double* step, double* to, long count) {
  for (long k = 0; k < count; k += lane_count) store(load(from + k) + load(step + k), to + k);
}

void add_squares(const double* J, const double* weights, const double* residuals, int count, int columns, double* H,
                 double* h, int stride) {
  const int parts = (columns + lane_count - 1) / lane_count;
  const long width = padded(columns);
  for (int v = 0; v < parts; ++v) {
    Lanes gradient = load(h + v * lane_count);
    for (int j = 0; j < count; ++j)
      gradient += load(J + j * width + v * lane_count) * (2.0 * weights[j] * residuals[j]);
    store(gradient, h + v * lane_count);
    if (!H) continue;
    for (int c = 0; c < columns; ++c) {
      double* column = H + static_cast<long>(c) * stride + v * lane_count;
      Lanes sum = load(column);
      for (int j = 0; j < count; ++j) {
        const double* row = J + j * width;
        sum += load(row + v * lane_count) * (2.0 * weights[j] * row[c]);
      }
      store(sum, column);
    }
  }
}

double add_tracking(const double* z, const double* reference, const double* weights, const double* turn, double* H,
                    double* h, int columns, int stride) {
  constexpr double to_integer = 6755399441055744.0;  // 1.5 * 2^52: what is added to it is rounded to an integer
  double total = 0.0;
  for (int first = 0; first < columns; first += lane_count) {
    const Lanes circle = load(turn + first), weight = load(weights + first);
    Lanes error = load(z + first) - load(reference + first);
    const Lanes turns = circle > 0.0 ? error / circle : Lanes{};
    error -= ((turns + to_integer) - to_integer) * circle;
    error = weight > 0.0 ? error : Lanes{};  // a reference that nobody set may be anything
    const Lanes pull = weight * error;
    store(load(h + first) + 2.0 * pull, h + first);
    const Lanes cost = pull * error;
    for (int k = 0; k < lane_count; ++k) total += cost[k];
    if (!H) continue;
    for (int k = 0; k < lane_count && first + k < columns; ++k)
      H[static_cast<long>(first + k) * stride + first + k] += 2.0 * weights[first + k];
  }
  return total;
}

void complete_dynamics(const DynamicsView& view) {
  const long stride = view.stride;
  const int parts = view.stride / lane_count, state_parts = (view.states + lane_count - 1) / lane_count;
  for (int i = view.first; i <= view.last; ++i) {
    double *F = view.F + i * view.states * stride, *b = view.b + i * stride;
    const double *z = view.values + i * stride, *next = z + stride;
    const int* control_of = view.control_of + i * view.channels;
    for (int r = 0; r < view.vehicle_states; ++r)
      for (int k = view.written; k < view.stride; k += lane_count) store(Lanes{}, F + r * stride + k);
    for (int v = 0; v < state_parts; ++v) {
      const LaneMask is_vehicle = lane_numbers < static_cast<long long>(view.vehicle_states - v * lane_count);
      const Lanes reached = is_vehicle ? load(b + v * lane_count) : load(z + v * lane_count);
      store(first_of(reached - load(next + v * lane_count), v, view.states), b + v * lane_count);
    }
    for (int c = 0; c < view.channels; ++c) {
      const int row = view.vehicle_states + c, control = control_of[c];
      const int column = control >= 0 ? view.states + control : row;
      for (int v = 0; v < parts; ++v) {
        const LaneMask is_column = lane_numbers == static_cast<long long>(column - v * lane_count);
        store(is_column ? all(1.0) : Lanes{}, F + row * stride + v * lane_count);
      }
      if (control >= 0) b[row] = z[column] - next[row];
    }
  }
}

void clear_costs(const CostView& view, int first, int last, bool matrices) {
  const long stride = view.stride, wide = view.states + view.controls;
  for (int i = first; i <= last; ++i) {
    const int used = view.states + (i < view.intervals ? view.control_counts[i] : 0);
    for (int k = 0; k < view.stride; k += lane_count) store(Lanes{}, view.h + i * stride + k);
    if (!matrices) continue;
    const int length = padded(used);
    for (int c = 0; c < used; ++c)
      for (int k = 0; k < length; k += lane_count) store(Lanes{}, view.H + (i * wide + c) * stride + k);
  }
}

double add_measurements(const CostView& view, const MeasurementView& measured, int first, int last, bool matrices) {
  constexpr double to_integer = 6755399441055744.0, turn = 6.283185307179586;
  const long stride = view.stride, wide = view.states + view.controls, width = padded(measured.vehicle_states);
  double *weights = measured.room, *pulls = weights + measured.output_count;
  double total = 0.0;
  for (int i = first; i <= last; ++i) {
    double *H = view.H + i * wide * stride, *h = view.h + i * stride;
    const double* y = measured.outputs + static_cast<long>(i) * measured.output_count;
    const double* predicted = measured.predicted + static_cast<long>(i - first) * measured.output_count;
    const double* J = measured.jacobians + static_cast<long>(i - first) * measured.output_count * width;
    for (int j = 0; j < measured.output_count; ++j) {
      const bool is_missing = y[j] != y[j];
      double error = is_missing ? 0.0 : predicted[j] - y[j];
      if (measured.is_angle[j] != 0) error -= ((error / turn + to_integer) - to_integer) * turn;
      weights[j] = is_missing ? 0.0 : 2.0 * measured.output_weights[j];
      pulls[j] = weights[j] * error;
      total += 0.5 * pulls[j] * error;
    }
    for (int k = 0; k < width; k += lane_count) {
      Lanes gradient = load(h + k);
      for (int j = 0; j < measured.output_count; ++j) gradient += load(J + j * width + k) * pulls[j];
      store(gradient, h + k);
      for (int c = 0; matrices && c < measured.vehicle_states; ++c) {
        Lanes column = load(H + c * stride + k);
        for (int j = 0; j < measured.output_count; ++j)
          column += load(J + j * width + k) * (weights[j] * J[j * width + c]);
        store(column, H + c * stride + k);
      }
    }
    if (i == view.intervals) break;
    const double* u = measured.values + i * stride + view.states;
    const double* u_measured = measured.inputs + static_cast<long>(i) * measured.input_count;
    for (int j = 0; j < measured.input_count; ++j) {
      if (u_measured[j] != u_measured[j]) continue;
      const double error = u[j] - u_measured[j], weight = measured.input_weights[j];
      const int at = view.states + j;
      total += weight * error * error;
      h[at] += 2.0 * weight * error;
      if (matrices) H[at * stride + at] += 2.0 * weight;
    }
  }
  return total;
}

}  // namespace
}  // namespace kernels

#define RHEC_JOIN(a, b) a##b
#define RHEC_TABLE(name, set) RHEC_JOIN(name, set)
extern const ProgramKernels RHEC_TABLE(program_kernels_, RHEC_SET);
constinit const ProgramKernels RHEC_TABLE(program_kernels_, RHEC_SET) = {
    &kernels::kkt,         &kernels::check_step,      &kernels::mark_bounds,  &kernels::subtract,
    &kernels::add,         &kernels::add_squares,     &kernels::add_tracking, &kernels::complete_dynamics,
    &kernels::clear_costs, &kernels::add_measurements};

}  // namespace rhec
