#pragma once

// A real-time iteration of bicycle_slip by hand: sizes known at compile time, derivatives written out, no inequalities.
// What it leaves out makes it a floor: nothing that solves these problems and can do more is expected to be faster. The
// linear algebra does not know which entries are zero. Nothing of rhec or Eigen is included here, since these files are
// compiled for the very machine.
namespace rhec::bench::floor {

/// Of a stage: x_pos, y_pos, beta, delta, kappa, mu, u1, u2.
struct alignas(64) Row {
  double at[8];
};
inline constexpr int rows = 16 + 8;  ///< room for 16 nodes, and for whoever reads a register's width further

struct Vehicle {
  double wheelbase, gps_offset, step;
};

/// Estimation with one value of kappa and mu for the window (full-horizon blocking).
struct Estimation {
  Vehicle vehicle;
  Row point[rows];
  Row measured[rows];  ///< x_gps, y_gps, delta, u1, u2
  Row output_weights, input_weights;
  Row arrival_mean, arrival_information[6];
};

/// Control with the exact Hessian of the Lagrangian. kappa and mu are given, and so no states.
struct Control {
  Vehicle vehicle;
  Row point[rows];
  Row costates[rows];
  Row reference[rows];
  Row stage_weights, terminal_weights;
  Row initial_state;
};

/// The quadratic program of the stages, and its solution.
struct Workspace {
  Row dynamics[rows][8];  ///< [A B], a row for each state
  Row defect[rows];
  Row hessian[rows][8];  ///< [Q S'; S R]
  Row gradient[rows];
  Row cost_to_go[rows][8], cost_to_go_gradient[rows];
  Row policy[rows][8], policy_offset[rows];  ///< columns of [A + B K; K]
  Row step[rows];                            ///< of states and inputs
  Row costates[rows];                        ///< of the step's end
};

void prepare_constants(const Estimation& problem, Workspace& work);
void prepare_constants(const Control& problem, Workspace& work);

template <int N>
void linearise(const Estimation& problem, Workspace& work);
template <int N>
void linearise(const Control& problem, Workspace& work);
template <int N>
void solve(const Estimation& problem, Workspace& work);  ///< free initial state
template <int N>
void solve(const Control& problem, Workspace& work);

}  // namespace rhec::bench::floor
