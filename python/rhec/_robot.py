"""A robot, sample by sample."""
from __future__ import annotations

import os
from typing import Any

from . import _configuration, _rhec
from ._arguments import checked, told_below
from ._types import ArrayLike, Changes, Configuration, PluginPath


@checked
class Robot:
    """What a robot is, and how it is estimated and controlled.

    configuration: a YAML file with the keys of docs/configuration.md, or the same as a dict
    set: keys to change, such as {"estimator.horizon": 20}
    plugin_path: further directories with plugins
    """

    def __init__(self, configuration: Configuration, *, set: Changes = None, plugin_path: PluginPath = ()) -> None:
        settings, folders = _configuration.read(configuration, set, plugin_path)
        self._robot = _rhec.Robot(folders, settings)
        file = os.path.abspath(configuration) if isinstance(configuration, (str, os.PathLike)) else configuration
        self._made_of = (file, set, plugin_path)

    def __reduce__(self) -> tuple[Any, ...]:
        """To another process goes what it is made of; it is made there again."""
        return _robot_of, self._made_of

    @property
    def step(self) -> float:
        """Interval of the estimator's nodes, and of the controller [s]."""
        return self._robot.step

    @property
    def vehicle(self) -> _rhec.Vehicle:
        """The model, with the bounds of this robot."""
        return self._robot.vehicle

    @told_below
    def make_estimator(self, initial_state: ArrayLike | None = None) -> _rhec.Estimator:
        """A new estimator; `initial_state` (n_x, NaN where it is not known) is used where the configuration has none.

        A heading that neither of them tells may be any: it is searched as soon as the vehicle moves.
        """
        return _rhec.Estimator(self._robot, initial_state)

    @told_below
    def make_controller(self, path: _rhec.Path, ahead: _rhec.Estimator | None = None) -> _rhec.Controller:
        """A new controller that follows a path. `ahead`: an estimator that remembers places; the controller then plans
        with the slip that its map knows ahead."""
        return _rhec.Controller(self._robot, path, ahead)

    def __repr__(self) -> str:
        return f"<robot: {self.vehicle.name}, a step of {self.step} s>"


def _robot_of(configuration: Configuration, changes: Changes, plugin_path: PluginPath) -> Robot:
    return Robot(configuration, set=changes, plugin_path=plugin_path)
