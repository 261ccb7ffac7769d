#pragma once

#include <cmath>
#include <vector>

#include "rhec/core/model/graph_model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

/// A car whose time is scaled: with tau = t / T in [0, 1],
///
///     dx/dtau     = T v cos(psi)             ddelta/dtau = T omega
///     dy/dtau     = T v sin(psi)             dv/dtau     = T a
///     dpsi/dtau   = T v tan(delta) / L
///
/// with state [x, y, psi, delta, v], input [a, omega] and parameter [T]. (x, y) is the centre of the rear axle. Its
/// outputs are the squared distances of the rear axle's centre and of the front axle's from an obstacle.
template <class Scalar>
struct Car {
  static constexpr int state_count = 5, input_count = 2, parameter_count = 1, output_count = 2;

  Scalar wheelbase{2.7};                    ///< L [m]
  Scalar obstacle_x{0.0}, obstacle_y{0.0};  ///< its centre [m]

  template <class Visitor>
  void options(Visitor&& option) {
    option("wheelbase", wheelbase, "distance of the axles [m]");
    option("obstacle_x", obstacle_x, "centre of the obstacle [m]");
    option("obstacle_y", obstacle_y, "centre of the obstacle [m]");
  }

  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin, std::tan;
    const Scalar &psi = x[2], &delta = x[3], &T = p[0];
    const Scalar way = T * x[4];
    dxdt[0] = way * cos(psi);
    dxdt[1] = way * sin(psi);
    dxdt[2] = way * tan(delta) / wheelbase;
    dxdt[3] = T * u[1];
    dxdt[4] = T * u[0];
  }

  void outputs(const Scalar* x, Scalar* y) const {
    using std::cos, std::sin;
    const Scalar east = x[0] - obstacle_x, north = x[1] - obstacle_y;
    y[0] = east * east + north * north;
    const Scalar front_east = east + wheelbase * cos(x[2]), front_north = north + wheelbase * sin(x[2]);
    y[1] = front_east * front_east + front_north * front_north;
  }
};

/// The formula with its derivatives, first and second, evaluated without a compiler.
inline rhec::GraphModel make_car(const Car<double>& car) {
  rhec::ModelDescription about;
  about.name = "car";
  about.states = {{.name = "x", .unit = "m", .meaning = "rear axle centre, x"},
                  {.name = "y", .unit = "m", .meaning = "rear axle centre, y"},
                  {.name = "psi", .unit = "rad", .meaning = "heading", .is_angle = true},
                  {.name = "delta", .unit = "rad", .meaning = "steering angle"},
                  {.name = "v", .unit = "m/s", .meaning = "speed"}};
  about.inputs = {{.name = "a", .unit = "m/s^2", .meaning = "acceleration"},
                  {.name = "omega", .unit = "rad/s", .meaning = "steering rate"}};
  about.parameters = {{.name = "T", .unit = "s", .meaning = "time of the manoeuvre"}};
  about.outputs = {{.name = "rear", .unit = "m^2", .meaning = "squared distance of the rear axle from the obstacle"},
                   {.name = "front", .unit = "m^2", .meaning = "squared distance of the front axle"}};
  return {rhec::trace<Car>(car), about};
}
