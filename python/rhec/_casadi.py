"""Models and problems as CasADi has them, to solve the same with its solvers."""
from __future__ import annotations

import dataclasses
import math
from typing import Any

from . import _graphs
from ._arguments import checked
from ._errors import Error, Names, module_of
from ._problems import Problem
from ._types import Array

_FUNCTIONS = ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "tanh", "atan2")


@checked
@dataclasses.dataclass
class CasadiModel:
    """rates: Function (x, u, p) -> dx/dt; outputs: Function (x, u, p) -> y; their columns are the vehicle's variables."""

    rates: Any
    outputs: Any


@checked
@dataclasses.dataclass
class CasadiProblem:
    """A problem by multiple shooting.

    nlp: {"x", "f", "g"} for casadi.nlpsol; bounds: {"lbx", "ubx", "lbg", "ubg"}; start: the problem's guess, or zeros
    """

    nlp: dict[str, Any]
    bounds: dict[str, Any]
    start: Any
    _values: Any

    def solve(self, solver: str = "ipopt", **options: Any) -> dict[str, Any]:
        """Solves it with one of CasADi's solvers. Returns the values of `unpack`, with objective and stats beside."""
        import casadi

        made = casadi.nlpsol("rhec", solver, self.nlp, options)
        result = made(x0=self.start, **self.bounds)
        return Names({**self.unpack(result["x"]), "objective": float(result["f"]), "stats": made.stats()})

    def unpack(self, x: Any) -> dict[str, Array]:
        """states (N + 1, n_x), inputs (N, n_u) and parameters (N, n_p) of a point."""
        import numpy

        return Names({name: numpy.array(value) for name, value in zip(("states", "inputs", "parameters"), self._values(x))})

    def objective(self, x: Any) -> float:
        """The objective of a point."""
        import casadi

        return float(casadi.Function("objective", [self.nlp["x"]], [self.nlp["f"]])(x))


@checked
def to_casadi(thing: Any) -> Any:
    """A Vehicle or a Model as a CasadiModel, a Problem as a CasadiProblem. Needs CasADi (pip install casadi)."""
    vehicle = None if isinstance(thing, Problem) else _graphs.vehicle_of(thing, "to_casadi")
    module_of("casadi", "to_casadi")
    if vehicle is None:
        return _Transcription(thing).made()
    return _model(vehicle)


def _model(vehicle):
    import casadi

    x, u, p = (casadi.SX.sym(name, len(variables)) for name, variables in
               (("x", vehicle.states), ("u", vehicle.inputs), ("p", vehicle.parameters)))
    library = {name: getattr(casadi, name) for name in _FUNCTIONS}
    rates, outputs = _graphs.evaluate(vehicle, library, *(casadi.vertsplit(each) if each.numel() else [] for each in (x, u, p)))
    return CasadiModel(casadi.Function("rates", [x, u, p], [casadi.vertcat(*rates)]),
                       casadi.Function("outputs", [x, u, p], [casadi.vertcat(*outputs)]))


class _Variables:
    """Decisions in their order, with bounds and a start."""

    def __init__(self, casadi):
        self._casadi, self.terms, self.lower, self.upper, self.start = casadi, [], [], [], []

    def add(self, name, lower, upper, start):
        term = self._casadi.SX.sym(name)
        self.terms.append(term)
        self.lower.append(lower)
        self.upper.append(upper)
        self.start.append(0.0 if start is None else start)
        return term


class _Transcription:
    """One problem (docs/problem_format.md) as an NLP: every state at a node and every value of an input or a parameter
    is a variable, and each interval a constraint."""

    def __init__(self, problem):
        import casadi

        self._casadi, self._problem, self._keys, self._names = casadi, problem, problem.to_dict(), problem.names
        keys, horizon = self._keys, self._keys["horizon"]
        refused = [key for key in ("between", "blocked_noise", "terms") if keys.get(key)]
        refused += [f"transition of {name}" for name, kind in keys.get("transition", {}).items() if kind != "step"]
        if horizon["integrator"] != "rk4":
            refused.append(f"horizon.integrator {horizon['integrator']}")
        if refused:
            raise Error(f"{problem.id}: to_casadi: no problem with {', '.join(refused)} yet; expected one of "
                        "docs/problem_format.md without")
        self._vehicle = problem.vehicle
        self._model = _model(self._vehicle)
        self._n = horizon["intervals"]
        dt = horizon["dt"]
        self._durations = dt if isinstance(dt, list) else [dt] * self._n
        self._substeps = horizon["substeps"]
        self._variables = _Variables(casadi)
        self._guess = keys.get("guess")

    def made(self):
        casadi = self._casadi
        is_control = self._keys["problem"] == "rhc"
        states = self._make_states(is_control)
        inputs = self._make_inputs(is_control)
        parameters = self._make_parameters(is_control)
        defects = [self._next(states[i], inputs[i], parameters[i], i) - states[i + 1] for i in range(self._n)]
        objective = (self._control_cost if is_control else self._estimation_cost)(states, inputs, parameters)
        x, g = casadi.vertcat(*self._variables.terms), casadi.vertcat(*defects)
        if g.numel() == 0:
            g = casadi.SX(0, 1)
        values = casadi.Function("values", [x], [self._table(rows, len(self._names[kind])) for kind, rows in
                                                  (("states", states), ("inputs", inputs), ("parameters", parameters))])
        return CasadiProblem({"x": x, "f": objective, "g": g},
                             {"lbx": self._variables.lower, "ubx": self._variables.upper, "lbg": 0.0, "ubg": 0.0},
                             casadi.DM(self._variables.start), values)

    def _table(self, rows, width):
        casadi = self._casadi
        return casadi.vertcat(*(row.T for row in rows)) if rows and width else casadi.SX(len(rows), width)

    def _bounds(self, name, interval=None):
        def side(value, otherwise):
            if isinstance(value, list):
                value = value[interval]
            return otherwise if value is None else value

        lower, upper = self._keys["bounds"].get(name, (None, None))
        return side(lower, -math.inf), side(upper, math.inf)

    def _guessed(self, rows, i, j):
        return self._guess[rows][i][j] if self._guess else None

    def _make_states(self, is_control):
        casadi, rows = self._casadi, []
        for i in range(self._n + 1):
            if i == 0 and is_control:
                given = self._keys["initial_state"]
                for name, value in zip(self._names["states"], given):
                    lower, upper = self._bounds(name)
                    if not lower <= value <= upper:
                        raise Error(f"{self._problem.id}: to_casadi: the initial state has {name} = {value}, beyond its bounds, which "
                                    "are then relaxed within reach; expected one within them")
                rows.append(casadi.DM(given))
                continue
            rows.append(casadi.vertcat(*(self._variables.add(f"{name}_{i}", *self._bounds(name), self._guessed("states", i, j))
                                         for j, name in enumerate(self._names["states"]))))
        return [casadi.SX(row) for row in rows]

    def _blocks(self, names, first_guess):
        """Values by interval of variables, each of which begins anew where `block_starts` says."""
        starts = self._keys.get("block_starts", {})
        columns = []
        for j, name in enumerate(names):
            begins = starts.get(name, range(self._n))
            column = []
            for i in range(self._n):
                if i == 0 or i in begins:
                    within = [k for k in range(i, self._n) if not any(i < b <= k for b in begins)]
                    limits = [self._bounds(name, k) for k in within]
                    start = first_guess(i, j, name)
                    column.append(self._variables.add(f"{name}_{i}", max(b[0] for b in limits), min(b[1] for b in limits), start))
                else:
                    column.append(column[-1])
            columns.append(column)
        return [self._casadi.SX(self._casadi.vertcat(*(column[i] for column in columns))) for i in range(self._n)]

    def _make_inputs(self, is_control):
        names = self._names["inputs"]
        free = [name for name in names if not is_control or name not in self._keys.get("block_starts", {})]
        if is_control:
            return self._blocks(names, lambda i, j, name: self._guessed("controls", i, free.index(name)) if name in free else None)
        rows = []
        for i in range(self._n):
            rows.append(self._casadi.vertcat(*(self._variables.add(f"{name}_{i}", *self._bounds(name, i), self._guessed("controls", i, j))
                                               for j, name in enumerate(names))))
        return [self._casadi.SX(row) for row in rows]

    def _make_parameters(self, is_control):
        if is_control:
            return [self._casadi.SX(self._casadi.DM(self._keys["parameters"]))] * self._n
        nx = len(self._names["states"])
        return self._blocks(self._names["parameters"], lambda i, j, _: self._guessed("states", i + 1, nx + j))

    # The dynamics: the vehicle by Runge-Kutta, noise of states, and processes of parameters.

    def _next(self, state, inputs, parameters, i):
        casadi, keys = self._casadi, self._keys
        nx, nu, dt = len(self._vehicle.states), len(self._vehicle.inputs), self._durations[i]
        vehicle, u, held = state[:nx], inputs[:nu], []
        for k, name in enumerate(keys.get("rates", [])):  # states behind the vehicle's, which change at the rates in their place
            j = [each.name for each in self._vehicle.inputs].index(name)
            u[j] = state[nx + k] + dt * inputs[j]
            held.append(u[j])
        noisy = keys.get("state_noise", [])
        xi, w = inputs[nu:nu + len(noisy)], inputs[nu + len(noisy):]
        begin, end, processes = parameters, parameters, []
        if keys.get("processes"):
            begin, end, processes = self._processes(state[nx:], w, keys["data"][i])
        after = self._integrate(vehicle, u, begin, end, dt)
        names = [each.name for each in self._vehicle.states]
        for k, name in enumerate(noisy):
            after[names.index(name)] += math.sqrt(dt) * xi[k]
        return casadi.vertcat(after, *held, *processes)

    def _processes(self, z, w, data):
        casadi, at, first, begin, end, processes = self._casadi, 0, 0, [], [], []
        for parameter in self._vehicle.parameters:
            n = self._keys["processes"][parameter.name]
            runs = data[at]
            f, g = (casadi.reshape(casadi.DM(data[at + 1 + part * n * n:at + 1 + (part + 1) * n * n]), n, n) for part in (0, 1))
            after = f @ z[first:first + n] + g @ w[first:first + n]
            begin.append(z[first])
            end.append(after[0] if runs else z[first])
            processes.append(after)
            at, first = at + 1 + 2 * n * n, first + n
        return casadi.vertcat(*begin), casadi.vertcat(*end), processes

    def _integrate(self, x, u, begin, end, dt):
        rates, count = self._model.rates, self._substeps
        h = dt / count
        for k in range(count):
            at = [begin + (end - begin) * share for share in (k / count, (k + 0.5) / count, (k + 1) / count)]
            k1 = rates(x, u, at[0])
            k2 = rates(x + h / 2 * k1, u, at[1])
            k3 = rates(x + h / 2 * k2, u, at[1])
            k4 = rates(x + h * k3, u, at[2])
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return x

    # Objectives.

    def _control_cost(self, states, inputs, _):
        keys, cost = self._keys, 0
        angles = {each.name for each in [*self._vehicle.states, *self._vehicle.inputs] if each.is_angle}
        stage, terminal, reference = keys["weights"]["stage"], keys["weights"]["terminal"], keys["reference"]
        for j, name in enumerate(self._names["states"]):
            for i in range(self._n + 1):
                weight = (stage if i < self._n else terminal).get(name, 0.0)
                cost += weight * self._difference(states[i][j], reference[name][i], name in angles)**2
        for j, name in enumerate(self._names["inputs"]):
            for i in range(self._n):
                cost += stage.get(name, 0.0) * (inputs[i][j] - reference[name][i])**2
        return cost

    def _difference(self, value, of, is_angle):
        """On the circle for angles."""
        casadi, off = self._casadi, value - of
        return casadi.atan2(casadi.sin(off), casadi.cos(off)) if is_angle else off

    def _estimation_cost(self, states, inputs, parameters):
        casadi, keys = self._casadi, self._keys
        arrival = keys["arrival"]
        mean = casadi.DM(arrival["state"] + arrival["parameters"])
        first = casadi.vertcat(states[0], parameters[0] if self._n and not keys.get("processes") else casadi.SX(0, 1))
        if first.numel() != mean.numel():
            raise Error(f"{self._problem.id}: to_casadi: a window without intervals has no parameters yet; expected an interval")
        off = first - mean
        cost = casadi.bilin(casadi.DM(arrival["information"]), off, off)
        cost += self._output_cost(states)
        weights = keys["weights"]["inputs"]
        for i in range(self._n):
            for j, measured in enumerate(keys["inputs"][i]):
                if measured is not None:
                    cost += weights[j] * (inputs[i][j] - measured)**2
        return cost + self._block_cost(parameters)

    def _output_cost(self, states):
        casadi, keys = self._casadi, self._keys
        outputs, weights = self._vehicle.outputs, keys["weights"]["outputs"]
        none = [casadi.SX.nan(len(variables), 1) for variables in (self._vehicle.inputs, self._vehicle.parameters)]
        groups = [(group["outputs"], group["delta"]) for group in keys.get("robust", [])]
        grouped = {name for names, _ in groups for name in names}
        groups += [([each.name], None) for each in outputs if each.name not in grouped]
        names, cost = [each.name for each in outputs], 0
        for i, state in enumerate(states):
            seen = self._model.outputs(state[:len(self._vehicle.states)], *none)
            for members, delta in groups:
                s = 0
                for name in members:
                    j = names.index(name)
                    measured = keys["outputs"][i][j]
                    if measured is None:
                        continue
                    s += weights[j] * self._difference(seen[j], measured, outputs[j].is_angle)**2
                cost += s if delta is None else 2 * delta**2 * (casadi.sqrt(1 + s / delta**2) - 1)
        return cost

    def _block_cost(self, parameters):
        cost, starts = 0, self._keys.get("block_starts", {})
        for j, name in enumerate(self._names["parameters"]):
            variances = self._keys.get("neighbour_variance", {}).get(name, [])
            weights = self._keys.get("block_weights", {}).get(name, [])
            for k, i in enumerate(starts.get(name, [])):
                value = parameters[i][j]
                if k < len(variances) and variances[k] is not None:
                    cost += (value - parameters[i - 1][j])**2 / variances[k]
                if k < len(weights):
                    cost += weights[k] * value**2
        return cost
