#pragma once

// A hand-written real-time iteration of bicycle_slip: sizes known at compile time, derivatives written out, no
// inequalities. That makes it a lower bound on the time: no more general solver of these problems is expected to be
// faster. The linear algebra does not exploit zero entries. Nothing of rhec or Eigen is included here, since these
// files are compiled for the instruction set of this machine.
namespace rhec::bench::floor {

/// Values of a stage: x_pos, y_pos, beta, delta, kappa, mu, u1, u2.
struct alignas(64) Row {
  double at[8];
};
inline constexpr int rows = 16 + 8;  ///< 16 nodes, padded for reads of a full register

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

/// Control with the exact Hessian of the Lagrangian. kappa and mu are given, so they are not states.
struct Control {
  Vehicle vehicle;
  Row point[rows];
  Row costates[rows];
  Row reference[rows];
  Row stage_weights, terminal_weights;
  Row initial_state;
};

/// The stage QP and its solution.
struct Workspace {
  Row dynamics[rows][8];  ///< [A B], a row for each state
  Row defect[rows];
  Row hessian[rows][8];  ///< [Q S'; S R]
  Row gradient[rows];
  Row cost_to_go[rows][8], cost_to_go_gradient[rows];
  Row policy[rows][8], policy_offset[rows];  ///< columns of [A + B K; K]
  Row step[rows];                            ///< of states and inputs
  Row costates[rows];                        ///< after the step
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
