"""Optimal control and estimation problems, each with every number that a solver needs (docs/problem_format.md)."""
from __future__ import annotations

import json
import os
from collections.abc import Iterable
from typing import Any

from . import _configuration, _files, _rhec
from ._arguments import checked, found_in_words
from ._errors import ArgumentError, Names
from ._types import ArrayLike, File, PluginPath


@checked
class Problem:
    """One problem: of estimation (kind 'rhe') or control ('rhc')."""

    def __init__(self, made: _rhec.ProblemBase, plugin_path: PluginPath = ()) -> None:
        self._made, self._plugin_path = made, plugin_path

    def __reduce__(self) -> tuple[Any, ...]:
        return _problem_of, (self.line(), self.id, self._plugin_path)

    @classmethod
    def from_dict(cls, keys: dict[str, Any], *, plugin_path: PluginPath = ()) -> Problem:
        """Of a dict with the keys of docs/problem_format.md."""
        return problems_of(_configuration.as_json(keys, "problem"), "problem", plugin_path)[0]

    @classmethod
    def of(cls, source: _rhec.Estimator | _rhec.Controller, id: str = "live", *, plugin_path: PluginPath = ()) -> Problem:
        """The problem that an estimator or a controller has solved last, with its solution as the guess. Of a vehicle
        from outside give the `plugin_path` of its robot."""
        return problems_of(source.problem_line(id), id, plugin_path)[0]

    def to_dict(self) -> dict[str, Any]:
        """As such a dict."""
        return json.loads(self.line(), object_hook=Names)

    def line(self) -> str:
        """As a line of a problem file."""
        return self._made.line()

    @property
    def id(self) -> str:
        return self._made.id

    @property
    def kind(self) -> str:
        """'rhe' or 'rhc'."""
        return self._made.kind

    @property
    def intervals(self) -> int:
        """N."""
        return self._made.intervals

    @property
    def vehicle(self) -> _rhec.Vehicle:
        """The model, before the problem adds states to it."""
        return self._made.vehicle

    @property
    def names(self) -> dict[str, list[str]]:
        """The names of its states, inputs and parameters, as a dict of lists."""
        made = self._made
        return {"states": made.state_names, "inputs": made.input_names, "parameters": made.parameter_names}

    def solve(self, solver: str = "gn_rti", *, deadline: float | None = None, cold: bool = False, covariances: bool = False,
              **options: Any) -> _rhec.Solution:
        """Solves it from its guess, or from a simulation if it has none or with `cold`. Returns a Solution, also where
        that is not usable: `Solution.usable` says so.

        solver: one of rhec.plugins(); options: its own, such as mode="converge"
        deadline: seconds from now after which the best so far is returned
        covariances: of [state; parameters] at each node, too
        """
        return self._made.solve(solver, _rhec.Settings.of(options, "configuration"), deadline, cold, covariances)

    def evaluate(self, states: ArrayLike, inputs: ArrayLike, parameters: ArrayLike) -> dict[str, float]:
        """Objective and largest defect of a point: states (N + 1, n_x), inputs (N, n_u), parameters (N, n_p). Parameters
        of a control problem are those given, on every interval."""
        return self._made.evaluate(states, inputs, parameters)

    def __repr__(self) -> str:
        return f"<problem '{self.id}': {self.kind} of {self.intervals} intervals, {self.vehicle.name}>"


def problems_of(text: str, name: str, plugin_path: PluginPath) -> list[Problem]:
    """The problems of lines of JSON; `name` stands for the file in errors."""
    folders = _configuration.folders_of(plugin_path)
    return [Problem(made, folders) for made in _rhec.problems(folders, text, name)]


def _problem_of(line: str, name: str, plugin_path: PluginPath) -> Problem:
    return problems_of(line, name, plugin_path)[0]


@checked
def read_problems(file: File, *, plugin_path: PluginPath = ()) -> list[Problem]:
    """The problems of a file, one on each line."""
    return problems_of(_files.read_text(file), os.fspath(file), plugin_path)


@checked
def write_problems(file: File, problems: Iterable[Problem]) -> None:
    """Writes problems to a file, one on each line, whole or not at all."""
    lines = []
    for i, problem in enumerate(problems):
        if not callable(getattr(problem, "line", None)):
            raise ArgumentError(f"write_problems: problems[{i}]: found {found_in_words(problem)}, expected a Problem", "problems")
        lines.append(problem.line() + "\n")
    _files.write_text(file, "".join(lines))
