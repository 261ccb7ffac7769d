"""The problems of `drawn_problems` as nonlinear programs of CasADi: solved by its own Ipopt, and answers of others judged.

Variables are states from node 1 on, inputs where they are free, and for each finite side of a soft row a slack, all in their
scales. Of an answer this says what its objective is, by how much it violates constraints, and how far it is from an optimum:
the multipliers of the constraints that are active there are those that leave least of the Lagrangian's gradient.
"""
import dataclasses

import casadi
import numpy

ACTIVE = 1e-6  # a constraint this close to its side, relative to 1 + |side|, may have a multiplier
COUNTS = 1e-7  # a multiplier that is smaller, relative to the largest, is taken for 0
QUIET = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes"}
# Accurate, and within bounds to the last bit.
SOLVER = QUIET | {"ipopt.tol": 1e-10, "ipopt.acceptable_tol": 1e-10, "ipopt.max_iter": 1000, "ipopt.bound_relax_factor": 0,
                  "ipopt.honor_original_bounds": "yes"}
# Of least squares, which are convex; what is left of the gradient is judged by its size, not by this tolerance.
LEAST_SQUARES = QUIET | {"ipopt.tol": 1e-9, "ipopt.max_iter": 300, "ipopt.bound_relax_factor": 0, "ipopt.mu_strategy": "adaptive",
                         "ipopt.hessian_constant": "yes", "ipopt.jac_c_constant": "yes"}


@dataclasses.dataclass
class Assessment:
    objective: float
    violation: float  # largest, in units of the scales
    kkt: float        # what is left of the Lagrangian's gradient, relative to 1 + its largest term


def violations(values, lower, upper):
    return numpy.maximum(0.0, numpy.maximum(lower - values, values - upper))


def multiplier_bounds(values, lower, upper):
    """Of L = f + m c: m >= 0 at an upper side, m <= 0 at a lower one, and none between."""
    with numpy.errstate(invalid="ignore"):
        at_lower = numpy.isfinite(lower) & (values - lower < ACTIVE * (1 + numpy.abs(lower)))
        at_upper = numpy.isfinite(upper) & (upper - values < ACTIVE * (1 + numpy.abs(upper)))
    return numpy.where(at_lower, -numpy.inf, 0.0), numpy.where(at_upper, numpy.inf, 0.0)


class Program:
    def __init__(self, problem):
        self.problem = problem
        self._symbols, self._guess, self._lower, self._upper = [], [], [], []
        self._constraints, self._least, self._most = [], [], []
        self._objective = 0
        self._build()
        self._v, self._g = casadi.vertcat(*self._symbols), casadi.vertcat(*self._constraints)
        self._lower, self._upper = numpy.array(self._lower), numpy.array(self._upper)
        self._least, self._most = numpy.array(self._least), numpy.array(self._most)
        self._at = casadi.Function("at", [self._v], [self._objective, casadi.gradient(self._objective, self._v), self._g,
                                                     casadi.jacobian(self._g, self._v)])

    def _variable(self, name, guess, lower, upper):
        symbol = casadi.SX.sym(name)
        self._symbols.append(symbol)
        for values, value in ((self._guess, guess), (self._lower, lower), (self._upper, upper)):
            values.append(value)
        return symbol

    def _constrain(self, term, least, most):
        self._constraints.append(term)
        self._least.append(least)
        self._most.append(most)

    def _build(self):
        p = self.problem
        states_guess, inputs_guess = p.guess()
        u = []
        for i in range(p.intervals):
            u.append([self._variable(f"u{k}_{i}", inputs_guess[i, k] / scale, p.u_lower[k] / scale, p.u_upper[k] / scale) * scale
                      if p.is_free(k, i) else u[i - 1][k] for k, scale in enumerate(p.u_scale)])
        x = [[casadi.SX(float(value)) for value in p.states_met[0]]]
        for i in range(1, p.intervals + 1):
            x.append([self._variable(f"x{j}_{i}", states_guess[i, j] / scale, p.x_lower[j] / scale, p.x_upper[j] / scale) * scale
                      for j, scale in enumerate(p.x_scale)])
        for i in range(p.intervals):
            for after, value, scale in zip(p.step(x[i], u[i], p.dt[i], casadi.sin), x[i + 1], p.x_scale):
                self._constrain((after - value) / scale, 0.0, 0.0)
        self._soft = []  # constraints of the slacks, which are the last variables, in their order
        for i in range(p.intervals + 1):
            self._add_costs(i, x[i], u[min(i, p.intervals - 1)])
            for q in range(len(p.rows)):
                if p.has_row(q, i):
                    self._add_row(q, i, x[i], u[min(i, p.intervals - 1)])

    def _add_costs(self, i, x, u):
        p = self.problem
        is_last = i == p.intervals
        for value, weight, wanted in zip(x, p.last_weights if is_last else p.x_weights, p.x_reference[i]):
            self._objective += weight * (value - wanted) ** 2
        if is_last:
            return
        for value, weight, wanted in zip(u, p.u_weights, p.u_reference[i]):
            self._objective += weight * (value - wanted) ** 2
        if p.cost:
            self._objective += p.cost.value(*self._scaled(x, u), casadi.sqrt)

    def _scaled(self, x, u):
        return [a / b for a, b in zip(x, self.problem.x_scale)], [a / b for a, b in zip(u, self.problem.u_scale)]

    def _add_row(self, q, i, x, u):
        p, unit = self.problem, self.problem.rows[q].unit
        value = p.rows[q].value(*self._scaled(x, u)) / unit
        if p.is_hard:
            self._constrain(value, p.lower[i, q] / unit, p.upper[i, q] / unit)
            return
        for sign, side in ((1, p.upper[i, q]), (-1, p.lower[i, q])):
            if not numpy.isfinite(side):
                continue
            slack = self._variable(f"s{i}_{q}_{sign}", 0.1, 0.0, numpy.inf)
            self._soft.append(len(self._constraints))
            self._constrain(sign * (value - side / unit) - slack, -numpy.inf, 0.0)
            self._objective += p.linear * unit * slack + 0.5 * p.quadratic * (unit * slack) ** 2

    def solve(self):
        """The objective at the optimum that Ipopt finds from rhec's guess; None where it finds none."""
        solver = casadi.nlpsol("drawn", "ipopt", {"x": self._v, "f": self._objective, "g": self._g}, SOLVER)
        answer = solver(x0=self._guess, lbx=self._lower, ubx=self._upper, lbg=self._least, ubg=self._most)
        return float(answer["f"]) if solver.stats()["success"] else None

    def assess(self, states, inputs):
        """An answer, with the least slacks that go with it."""
        p = self.problem
        v = [inputs[i][k] / p.u_scale[k] for i in range(p.intervals) for k in range(p.inputs) if p.is_free(k, i)]
        v += [states[i][j] / p.x_scale[j] for i in range(1, p.intervals + 1) for j in range(p.states)]
        v = numpy.array(v + [0.0] * len(self._soft))
        if self._soft:
            # Slacks enter constraints with a factor of -1.
            g = numpy.array(self._at(v)[2]).ravel()
            v[-len(self._soft):] = numpy.maximum(0.0, g[self._soft])
        objective, gradient, g, jacobian = self._at(v)
        gradient, g = numpy.array(gradient).ravel(), numpy.array(g).ravel()
        violation = max(violations(g, self._least, self._most).max(initial=0.0), violations(v, self._lower, self._upper).max())
        return Assessment(float(objective), float(violation), self._kkt(v, gradient, g, jacobian))

    def _kkt(self, v, gradient, g, jacobian):
        sides = [multiplier_bounds(g, self._least, self._most), multiplier_bounds(v, self._lower, self._upper)]
        least, most = (numpy.concatenate(side) for side in zip(*sides))
        may = numpy.flatnonzero(least < most)
        if not len(may):
            return float(numpy.abs(gradient).max() / (1 + numpy.abs(gradient).max()))
        columns = casadi.horzcat(jacobian.T, casadi.DM.eye(len(v)))[:, may.tolist()]
        size = numpy.sqrt(numpy.array(casadi.sum1(columns**2)).ravel())
        size[size == 0.0] = 1.0
        columns = columns @ casadi.diag(casadi.DM(1 / size))
        scale = 1 + numpy.abs(gradient).max()
        least, most, gradient = least[may], most[may], gradient / scale
        m = self._least_squares(columns, gradient, least, most)
        # What the interior-point method leaves to rounding: the multipliers that count, exactly.
        count = numpy.abs(m) > COUNTS * (1 + numpy.abs(m).max())
        exact = numpy.zeros(len(m))
        exact[count] = numpy.linalg.lstsq(columns.full()[:, count], -gradient, rcond=None)[0]
        return min(self._left(columns, gradient, numpy.clip(m, least, most)), self._left(columns, gradient, numpy.clip(exact, least, most)))

    @staticmethod
    def _least_squares(columns, gradient, least, most):
        rows, count = columns.shape
        m, r = casadi.SX.sym("m", count), casadi.SX.sym("r", rows)
        solver = casadi.nlpsol("multipliers", "ipopt",
                               {"x": casadi.vertcat(m, r), "f": 0.5 * casadi.sumsqr(r),
                                "g": casadi.mtimes(columns, m) + casadi.DM(gradient) - r}, LEAST_SQUARES)
        free = numpy.full(rows, numpy.inf)
        answer = solver(x0=0, lbx=numpy.concatenate([least, -free]), ubx=numpy.concatenate([most, free]), lbg=0, ubg=0)
        return numpy.array(answer["x"]).ravel()[:count]

    @staticmethod
    def _left(columns, gradient, m):
        """Of the gradient, relative to the largest of its terms."""
        left = numpy.array(casadi.mtimes(columns, casadi.DM(m))).ravel() + gradient
        largest = numpy.abs((columns @ casadi.diag(casadi.DM(m))).full()).max(initial=1.0)
        return float(numpy.abs(left).max() / largest)
