#pragma once

#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec::sim {

/// A tank that runs empty through a hole, whose outflow has no slope where it is empty, and a wheel driven by it:
///
///     level' = -hole sqrt(level)      wheel' = u / wheel + k      y = [log(level), wheel]
struct TankGraph {
  VehicleGraph vehicle;
  ModelDescription about;

  TankGraph() {
    Graph& graph = *vehicle.graph;
    const Expression hole = Expression::input(graph, "hole"), level = Expression::input(graph, "x0"),
                     wheel = Expression::input(graph, "x1"), u = Expression::input(graph, "u0"),
                     k = Expression::input(graph, "p0");
    vehicle.options = {{hole.node_in(graph), 0.25}};
    vehicle.states = {level.node_in(graph), wheel.node_in(graph)};
    vehicle.inputs = {u.node_in(graph)};
    vehicle.parameters = {k.node_in(graph)};
    const Expression outflow = named(sqrt(level), "outflow");
    vehicle.rates = {(-hole * outflow).node_in(graph), (u / wheel + k).node_in(graph)};
    vehicle.outputs = {log(level).node_in(graph), wheel.node_in(graph)};
    about.name = "tank";
    about.states = {{.name = "level", .unit = "m", .meaning = "of the water", .lower = 0.0},
                    {.name = "wheel", .unit = "rad/s", .meaning = "its rate", .lower = 2.0}};
    about.inputs = {{.name = "u", .unit = "1", .meaning = "drive"}};
    about.parameters = {{.name = "k", .unit = "1", .meaning = "friction", .upper = 0.5}};
    about.outputs = {{.name = "seen", .unit = "1", .meaning = "level"},
                     {.name = "wheel", .unit = "1", .meaning = "rate"}};
  }
};

}  // namespace rhec::sim
