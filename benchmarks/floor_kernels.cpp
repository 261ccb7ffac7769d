#include "floor_kernels.hpp"

#include <cstring>

#include "floor_passage.hpp"
#include "floor_riccati.hpp"

namespace rhec::bench::floor {
namespace {

inline void write_dynamics(const Lanes (&rows_of)[3][8], Workspace& work, int first) {
  for (int r = 0; r < 3; ++r) store_rows(rows_of[r], &work.dynamics[first][r], 8);
}

/// Subtracts the next node's states, which leaves the defects.
template <int N>
inline void subtract_next(const Row* point, Workspace& work) {
  const Eight states = {1, 1, 1, 1, 1, 1, 0, 0};
  for (int i = 0; i < N; ++i) store(work.defect[i], load(work.defect[i]) - states * load(point[i + 1]));
}

void clear(Workspace& work, double h) {
  std::memset(static_cast<void*>(&work), 0, sizeof(work));
  for (auto& stage : work.dynamics) {
    for (int r = 3; r < 6; ++r) stage[r].at[r] = 1.0;
    stage[3].at[7] = h;
  }
}

}  // namespace

void prepare_constants(const Estimation& problem, Workspace& work) {
  clear(work, problem.vehicle.step);
  for (auto& stage : work.hessian) {
    stage[0].at[0] = problem.output_weights.at[0];
    stage[1].at[1] = problem.output_weights.at[1];
    stage[3].at[3] = problem.output_weights.at[2];
    stage[6].at[6] = problem.input_weights.at[0];
    stage[7].at[7] = problem.input_weights.at[1];
  }
}

void prepare_constants(const Control& problem, Workspace& work) {
  clear(work, problem.vehicle.step);
  for (auto& stage : work.hessian)
    for (int r = 0; r < 2; ++r) stage[r].at[r] = problem.stage_weights.at[r];
}

template <int N>
[[gnu::flatten]] void linearise(const Estimation& problem, Workspace& work) {
  const double d = problem.vehicle.gps_offset;
  const double wx = problem.output_weights.at[0], wy = problem.output_weights.at[1], wd = problem.output_weights.at[2];
  for (int first = 0; first <= N; first += width) {
    Lanes z[8], y[8], rows_of[3][8], next[8];
    load_columns(problem.point + first, z);
    load_columns(problem.measured + first, y);
    const Passage passage(z, problem.vehicle);
    passage.jacobian(rows_of, true);
    write_dynamics(rows_of, work, first);
    passage.end(next);
    store_rows(next, work.defect + first, 1);

    const Lanes s = d * passage.sine[0], c = d * passage.cosine[0];
    const Lanes ex = wx * (z[0] - c - y[0]), ey = wy * (z[1] - s - y[1]);
    const Lanes of_x = wx * s, of_y = -wy * c, zero(0.0);
    alignas(64) double x_beta[width], y_beta[width];
    of_x.store_aligned(x_beta);
    of_y.store_aligned(y_beta);
    for (int lane = 0; lane < width; ++lane) {
      work.hessian[first + lane][0].at[2] = x_beta[lane];
      work.hessian[first + lane][1].at[2] = y_beta[lane];
    }
    const Lanes beta_row[8] = {of_x, of_y, of_x * s - of_y * c, zero, zero, zero, zero, zero};
    store_rows(beta_row, &work.hessian[first][2], 8);
    const Lanes gradient[8] = {ex,
                               ey,
                               s * ex - c * ey,
                               wd * (z[3] - y[2]),
                               zero,
                               zero,
                               problem.input_weights.at[0] * (z[6] - y[3]),
                               problem.input_weights.at[1] * (z[7] - y[4])};
    store_rows(gradient, work.gradient + first, 1);
  }
  subtract_next<N>(problem.point, work);
  // The arrival cost.
  const Eight error = load(problem.point[0]) - load(problem.arrival_mean);
  Eight gradient = load(work.gradient[0]);
  Row* first = work.hessian[0];
  const double x_beta = first[0].at[2], y_beta = first[1].at[2];
  const Eight beta_row = load(first[2]);
  for (int r = 0; r < 6; ++r) {
    const Eight information = load(problem.arrival_information[r]);
    gradient += error[r] * information;
    store(first[r], r == 2 ? information + beta_row : information);
  }
  first[0].at[0] += wx;
  first[0].at[2] += x_beta;
  first[1].at[1] += wy;
  first[1].at[2] += y_beta;
  first[3].at[3] += wd;
  store(work.gradient[0], gradient);
}

template <int N>
[[gnu::flatten]] void linearise(const Control& problem, Workspace& work) {
  const Eight w = load(problem.stage_weights);
  for (int first = 0; first < N; first += width) {
    Lanes z[8], costate[8], rows_of[3][8], next[8];
    load_columns(problem.point + first, z);
    load_columns(problem.costates + first + 1, costate);
    const Passage passage(z, problem.vehicle);
    passage.jacobian(rows_of, false);
    write_dynamics(rows_of, work, first);
    passage.end(next);
    store_rows(next, work.defect + first, 1);
    const auto [bb, bd, bu, bw, dd, du, dw, uu, uw, ww] = passage.curvature(costate);
    const Lanes zero(0.0);
    const double* weights = problem.stage_weights.at;
    const Lanes beta[8] = {zero, zero, bb + weights[2], bd, zero, zero, bu, bw};
    const Lanes delta[8] = {zero, zero, bd, dd + weights[3], zero, zero, du, dw};
    const Lanes speed[8] = {zero, zero, bu, du, zero, zero, uu + weights[6], uw};
    const Lanes rate[8] = {zero, zero, bw, dw, zero, zero, uw, ww + weights[7]};
    store_rows(beta, &work.hessian[first][2], 8);
    store_rows(delta, &work.hessian[first][3], 8);
    store_rows(speed, &work.hessian[first][6], 8);
    store_rows(rate, &work.hessian[first][7], 8);
  }
  for (int i = 0; i < N; ++i) store(work.gradient[i], w * (load(problem.point[i]) - load(problem.reference[i])));
  const Eight terminal = load(problem.terminal_weights);
  store(work.gradient[N], terminal * (load(problem.point[N]) - load(problem.reference[N])));
  for (int r = 0; r < 4; ++r) {
    work.hessian[N][r] = Row{};
    work.hessian[N][r].at[r] = problem.terminal_weights.at[r];
  }
  subtract_next<N>(problem.point, work);
}

template <int N>
[[gnu::flatten]] void solve(const Estimation&, Workspace& work) {
  backward<N, 6>(work);
  forward<N, 6>(work, free_initial_step(work));
}

template <int N>
[[gnu::flatten]] void solve(const Control& problem, Workspace& work) {
  backward<N, 4>(work);
  const Eight only_states = {1, 1, 1, 1, 0, 0, 0, 0};
  forward<N, 4>(work, (load(problem.initial_state) - load(problem.point[0])) * only_states);
}

template void linearise<14>(const Estimation&, Workspace&);
template void linearise<15>(const Estimation&, Workspace&);
template void linearise<15>(const Control&, Workspace&);
template void solve<14>(const Estimation&, Workspace&);
template void solve<15>(const Estimation&, Workspace&);
template void solve<15>(const Control&, Workspace&);

}  // namespace rhec::bench::floor
