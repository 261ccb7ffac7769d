"""Random problems of control, drawn from seeds: what `independent-problems` asks.

    minimise    sum of weighted squared differences from references, slacks of soft rows, and for some a robust cost
    subject to  x_{i+1} = F_i(x_i, u_i), bounds, and rows lower <= g(x_i, u_i) <= upper

The dynamics z' = A z + B w + C sin(z) + (D z) w + (Q p) z of z = x / x_scale and w = u / u_scale are written as a text of
equations for rhec; `rates`, `Row.value` and `Cost.value` say the same in arithmetic, for numbers of Python and for any type
that has it. The order in which numbers are drawn is part of what a seed means: append to it, and never change it.

Bounds and hard rows are put about a trajectory, which thus meets them all: every problem is feasible but those of the kind
`infeasible`, where the same row has to be above one number and below a smaller one.
"""
import dataclasses
import math

import numpy

KINDS = ("plain", "soft", "hard", "infeasible", "redundant", "dependent", "moving", "unstable", "units", "long", "one", "two",
         "nocontrols", "norows", "mixed", "equality")
ALWAYS_HARD = ("hard", "infeasible", "redundant", "dependent", "equality")
HARD_OR_SOFT = ("units", "moving", "mixed", "nocontrols", "norows", "long", "one", "two", "unstable")
FIRST_SEED = 990000
LOWEST, HIGHEST = -math.inf, math.inf


def number(value):
    return f"({float(value)!r})"


def json_number(value):
    return float(value) if math.isfinite(value) else None


@dataclasses.dataclass
class Row:
    """unit (x_weights' z + u_weights' w + square z_0^2)"""
    unit: float
    x_weights: numpy.ndarray
    u_weights: numpy.ndarray
    square: float

    @property
    def has_inputs(self):
        return bool(numpy.any(self.u_weights))

    def value(self, z, w):
        total = sum(weight * part for weight, part in zip(self.x_weights, z))
        if self.has_inputs:
            total = total + sum(weight * part for weight, part in zip(self.u_weights, w))
        return self.unit * (total + self.square * z[0] ** 2)

    def text(self, z, w):
        parts = [f"{number(weight)}*{part}" for weight, part in zip(self.x_weights, z)]
        if self.has_inputs:
            parts += [f"{number(weight)}*{part}" for weight, part in zip(self.u_weights, w)]
        if self.square:
            parts.append(f"{number(self.square)}*{z[0]}^2")
        return f"{number(self.unit)}*({' + '.join(parts)})"


@dataclasses.dataclass
class DependentRow:
    """2 first - 3 second"""
    first: Row
    second: Row

    @property
    def unit(self):
        return max(self.first.unit, self.second.unit)

    @property
    def has_inputs(self):
        return self.first.has_inputs or self.second.has_inputs

    def value(self, z, w):
        return 2 * self.first.value(z, w) - 3 * self.second.value(z, w)

    def text(self, z, w):
        return f"2*({self.first.text(z, w)}) - 3*({self.second.text(z, w)})"


@dataclasses.dataclass
class Cost:
    """weight r^2 of r = z_0 - w_0 / 2 on each interval, or with delta above 0 its pseudo-Huber loss"""
    weight: float
    delta: float

    def value(self, z, w, sqrt):
        r = z[0] - 0.5 * w[0]
        if not self.delta:
            return self.weight * r * r
        return self.weight * 2 * self.delta**2 * (sqrt(1 + r * r / self.delta**2) - 1)

    def as_json(self, z, w):
        return {"term": f"{z[0]} - 0.5*{w[0]}", "weight": self.weight} | ({"delta": self.delta} if self.delta else {})


class Problem:
    """The problem of a seed; `record` is its line for `rhec solve`."""

    def __init__(self, seed):
        self.seed, self.kind = seed, KINDS[seed % len(KINDS)]
        random = numpy.random.default_rng(FIRST_SEED + seed)
        self._draw_dynamics(random)
        self._draw_trajectory(random)
        self._draw_objective(random)
        self._draw_bounds(random)
        self._draw_rows(random)
        self.cost = None
        if random.random() < 0.3:
            self.cost = Cost(float(10 ** random.uniform(-1, 1)), float(random.choice([0, 0.5])))

    @property
    def id(self):
        return f"{self.kind}/{self.seed}"

    @property
    def is_infeasible(self):
        return self.kind == "infeasible"

    def _draw_dynamics(self, random):
        intervals = int(random.choice([2, 5, 10, 20]))
        self.intervals = {"one": 1, "two": 2, "long": 60}.get(self.kind, intervals)
        nx, nu = self.states, self.inputs = int(random.integers(1, 5)), int(random.integers(1, 4))
        self.usual_dt = float(random.choice([0.05, 0.1, 0.2]))
        self.substeps = int(random.choice([1, 1, 2]))
        self.A, self.B = random.normal(size=(nx, nx)) * 0.5, random.normal(size=(nx, nu))
        if self.kind == "unstable":
            self.A = self.A + numpy.diag(random.uniform(1, 3, nx))
        self.C = random.normal(size=(nx, nx)) * 0.3 * (random.random((nx, nx)) < 0.4)
        self.D = random.normal(size=(nx, nx, nu)) * 0.2 * (random.random((nx, nx, nu)) < 0.2)
        has_units = self.kind == "units"
        self.x_scale = 10.0 ** random.uniform(-4, 4, nx) if has_units else numpy.ones(nx)
        self.u_scale = 10.0 ** random.uniform(-4, 4, nu) if has_units else numpy.ones(nu)
        parameters = int(random.integers(0, 3))
        self.parameters = random.normal(size=parameters)
        self.tells_scales = random.random() < 0.5
        self.Q = random.normal(size=(nx, parameters)) * 0.3
        self.has_own_dts = random.random() < 0.3
        N = self.intervals
        self.dt = random.uniform(0.5, 1.5, N) * self.usual_dt if self.has_own_dts else numpy.full(N, self.usual_dt)

    def _draw_trajectory(self, random):
        """One that meets bounds and hard rows, with values of inputs held where these are blocked."""
        N, nx, nu = self.intervals, self.states, self.inputs
        initial = random.normal(size=nx) * self.x_scale
        inputs = random.normal(size=(N, nu)) * 0.5 * self.u_scale
        self.starts = {}
        if self.kind == "nocontrols":
            for k in range(nu):
                self.starts[k] = sorted({0, int(random.integers(0, N, 1)[0])})
        elif random.random() < 0.3:
            k = int(random.integers(nu))
            self.starts[k] = sorted({0} | {int(i) for i in random.integers(0, N, 2)})
        self.inputs_met = self.held(inputs)
        self.states_met = self.simulated(initial, self.inputs_met)

    def _draw_objective(self, random):
        nx, nu = self.states, self.inputs
        spread = random.normal(size=self.states_met.shape) * self.x_scale
        self.x_reference = self.states_met + spread * random.choice([0.1, 1, 3])
        self.u_reference = self.inputs_met + random.normal(size=self.inputs_met.shape) * self.u_scale
        self.x_weights = 10 ** random.uniform(-1, 1, nx) / self.x_scale**2
        self.u_weights = 10 ** random.uniform(-2, 1, nu) / self.u_scale**2
        self.last_weights = 10 ** random.uniform(-1, 1.5, nx) / self.x_scale**2

    def _draw_bounds(self, random):
        nx, nu = self.states, self.inputs
        self.x_lower, self.x_upper = numpy.full(nx, LOWEST), numpy.full(nx, HIGHEST)
        self.u_lower, self.u_upper = numpy.full(nu, LOWEST), numpy.full(nu, HIGHEST)
        for lower, upper, met, scale, share in ((self.u_lower, self.u_upper, self.inputs_met, self.u_scale, 0.5),
                                                (self.x_lower, self.x_upper, self.states_met, self.x_scale, 0.25)):
            for k, values in enumerate(met.T):
                if random.random() >= share:
                    continue
                lower[k] = values.min() - 0.3 * scale[k] * random.random()
                upper[k] = values.max() + 0.3 * scale[k] * random.random()
                if met is self.states_met and random.random() < 0.5:
                    upper[k] = HIGHEST

    def _draw_row(self, random):
        unit = 10.0 ** random.uniform(-4, 4) if self.kind == "units" else 1.0
        x_weights = random.normal(size=self.states)
        u_weights = random.normal(size=self.inputs) * (random.random() < 0.6)
        square = random.normal() * (random.random() < 0.5)
        return Row(unit, x_weights, u_weights, square)

    def _draw_rows(self, random):
        N = self.intervals
        rows = self.rows = [self._draw_row(random) for _ in range(0 if self.kind == "plain" else int(random.integers(1, 4)))]
        if self.kind == "redundant":
            rows.append(rows[0])
        if self.kind == "dependent":
            rows.append(DependentRow(rows[0], rows[-1]))
        self.is_hard = self.kind in ALWAYS_HARD or (self.kind in HARD_OR_SOFT and random.random() < 0.5)
        self.linear = float(random.choice([0, 1, 10, 100]))
        self.quadratic = float(random.choice([1, 10])) if self.linear == 0 or random.random() < 0.6 else 0.0
        # How far sides are from the trajectory; soft ones may ask for what it does not meet.
        margin = random.choice([0.0, 0.0, 0.2, 2.0, 0.1 if self.is_hard else -1])
        self.lower, self.upper = numpy.full((N + 1, len(rows)), LOWEST), numpy.full((N + 1, len(rows)), HIGHEST)
        for q, row in enumerate(rows):
            for i in range(N + 1):
                if not (row.has_inputs and i == N):
                    self._draw_sides(random, q, i, margin)
        if self.kind == "redundant":
            self.lower[:, -1], self.upper[:, -1] = self.lower[:, 0], self.upper[:, 0]
        cross = self.lower > self.upper
        middle = 0.5 * (self.lower[cross] + self.upper[cross])
        self.lower[cross] = self.upper[cross] = middle
        if self.is_infeasible:
            self._draw_contradiction(random)

    def _draw_sides(self, random, q, i, margin):
        row, N = self.rows[q], self.intervals
        value = self._value_met(row, i)
        margin = margin * row.unit * (1 + math.sin(i) if self.kind == "moving" else 1.0) * random.random()
        side = random.random()
        if self.kind == "mixed" and random.random() < 0.3:
            return
        if self.kind == "norows" and i % 3:
            return
        if self.kind == "equality" and q == 0:
            if i == N // 2:
                self.lower[i, q] = self.upper[i, q] = value
        elif side < 0.5:
            self.lower[i, q] = value - margin
        elif side < 0.9:
            self.upper[i, q] = value + margin
        else:
            self.lower[i, q], self.upper[i, q] = value - margin - 0.5 * row.unit, value + margin + 0.5 * row.unit

    def _draw_contradiction(self, random):
        row, N = self.rows[0], self.intervals
        self.rows.append(row)
        self.lower = numpy.c_[self.lower, numpy.full(N + 1, LOWEST)]
        self.upper = numpy.c_[self.upper, numpy.full(N + 1, HIGHEST)]
        i = int(random.integers(1, N))
        value = self._value_met(row, i)
        self.lower[i, 0], self.upper[i, 0] = value, HIGHEST
        self.upper[i, -1] = value - row.unit * float(random.choice([0.01, 0.3, 3]))

    def _value_met(self, row, i):
        return float(row.value(self.states_met[i] / self.x_scale, self.inputs_met[min(i, self.intervals - 1)] / self.u_scale))

    def is_free(self, k, i):
        """Whether input k has a value of its own on interval i."""
        return k not in self.starts or i in self.starts[k]

    def held(self, inputs):
        """With the first value of each block in the whole of it."""
        values = inputs.copy()
        for k in self.starts:
            for i in range(1, self.intervals):
                if not self.is_free(k, i):
                    values[i, k] = values[i - 1, k]
        return values

    def rates(self, x, u, sin):
        z, w = [a / b for a, b in zip(x, self.x_scale)], [a / b for a, b in zip(u, self.u_scale)]
        rates = []
        for i in range(self.states):
            rate = sum(a * b for a, b in zip(self.A[i], z)) + sum(a * b for a, b in zip(self.B[i], w))
            for j in range(self.states):
                if self.C[i, j]:
                    rate = rate + self.C[i, j] * sin(z[j])
                for k in range(self.inputs):
                    if self.D[i, j, k]:
                        rate = rate + self.D[i, j, k] * z[j] * w[k]
            rates.append(self.x_scale[i] * (rate + float(self.Q[i] @ self.parameters) * z[i]))
        return rates

    def step(self, x, u, dt, sin):
        """Classical Runge-Kutta, from lists to a list."""
        h = dt / self.substeps
        for _ in range(self.substeps):
            k1 = self.rates(x, u, sin)
            k2 = self.rates([a + h / 2 * b for a, b in zip(x, k1)], u, sin)
            k3 = self.rates([a + h / 2 * b for a, b in zip(x, k2)], u, sin)
            k4 = self.rates([a + h * b for a, b in zip(x, k3)], u, sin)
            x = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4)]
        return x

    def simulated(self, initial, inputs):
        states = [list(initial)]
        for u, dt in zip(inputs, self.dt):
            states.append(self.step(states[-1], u, dt, math.sin))
        return numpy.array(states)

    def guess(self):
        """States and inputs at which rhec begins: the simulation of the reference inputs."""
        inputs = self.held(self.u_reference)
        return self.simulated(self.states_met[0], inputs), inputs

    def has_row(self, q, i):
        """Whether row q is there at node i: something is decided there, and a side is finite."""
        has_inputs = self.rows[q].has_inputs
        decided = i < self.intervals if has_inputs else i > 0
        return decided and bool(numpy.isfinite(self.lower[i, q]) or numpy.isfinite(self.upper[i, q]))

    def _equations(self):
        lines = [f"z{i} = x{i} / {scale!r}" for i, scale in enumerate(self.x_scale.tolist())]
        lines += [f"w{k} = u{k} / {scale!r}" for k, scale in enumerate(self.u_scale.tolist())]
        for i in range(self.states):
            parts = [f"{number(self.A[i, j])}*z{j}" for j in range(self.states)]
            parts += [f"{number(self.B[i, k])}*w{k}" for k in range(self.inputs)]
            parts += [f"{number(self.C[i, j])}*sin(z{j})" for j in range(self.states) if self.C[i, j]]
            parts += [f"{number(self.D[i, j, k])}*z{j}*w{k}"
                      for j in range(self.states) for k in range(self.inputs) if self.D[i, j, k]]
            parts += [f"{number(self.Q[i, m])}*p{m}*z{i}" for m in range(len(self.parameters))]
            lines.append(f"x{i}' = {number(self.x_scale[i])} * ({' + '.join(parts)})")
        return "\n".join(lines) + "\n"

    def _terms(self, x_names, u_names):
        z = [f"({name}/{number(scale)})" for name, scale in zip(x_names, self.x_scale)]
        w = [f"({name}/{number(scale)})" for name, scale in zip(u_names, self.u_scale)]
        equations = {"name": "drawn", "states": x_names, "inputs": u_names}
        options = {"equations": equations}
        if self.rows:
            equations["limits"] = {f"r{q}": {"lower": 0, "term": row.text(z, w)} for q, row in enumerate(self.rows)}
            options |= {"hard": True} if self.is_hard else {"soft": {"linear": self.linear, "quadratic": self.quadratic}}
        if self.cost:
            equations["costs"] = {"c": self.cost.as_json(z, w)}
        return [{"name": "equations", "options": options, "data": [[] for _ in range(self.intervals + 1)],
                 **{side: [[json_number(value) for value in row] for row in rows]
                    for side, rows in (("lower", self.lower), ("upper", self.upper))}}]

    def record(self):
        x_names, u_names = [f"x{i}" for i in range(self.states)], [f"u{k}" for k in range(self.inputs)]

        def described(names, scales):
            return {name: {"typical": float(scale)} if self.tells_scales else {} for name, scale in zip(names, scales)}

        line = {
            "version": 5, "id": self.id, "problem": "rhc",
            "model": {"name": "equations", "equations": {
                "states": described(x_names, self.x_scale), "inputs": described(u_names, self.u_scale),
                "parameters": {f"p{m}": {} for m in range(len(self.parameters))}, "outputs": {"x0": {}},
                "equations": self._equations()}},
            "horizon": {"intervals": self.intervals, "dt": self.dt.tolist() if self.has_own_dts else self.usual_dt,
                        "integrator": "rk4", "substeps": self.substeps},
            "initial_state": self.states_met[0].tolist(), "parameters": self.parameters.tolist(),
            "reference": {**dict(zip(x_names, self.x_reference.T.tolist())), **dict(zip(u_names, self.u_reference.T.tolist()))},
            "weights": {"stage": {**dict(zip(x_names, self.x_weights.tolist())), **dict(zip(u_names, self.u_weights.tolist()))},
                        "terminal": dict(zip(x_names, self.last_weights.tolist()))},
            "bounds": {name: [json_number(lower), json_number(upper)]
                       for names, lowers, uppers in ((x_names, self.x_lower, self.x_upper), (u_names, self.u_lower, self.u_upper))
                       for name, lower, upper in zip(names, lowers, uppers)
                       if math.isfinite(lower) or math.isfinite(upper)}}
        if self.rows or self.cost:
            line["terms"] = self._terms(x_names, u_names)
        if self.starts:
            line["block_starts"] = {u_names[k]: starts for k, starts in self.starts.items()}
        return line
