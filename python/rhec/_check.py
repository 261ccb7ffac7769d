"""What `rhec check` says of a model or a term (docs/check.md)."""
from __future__ import annotations

import json
import os
from typing import Any

from . import _configuration, _rhec
from ._arguments import checked, found_in_words
from ._errors import ArgumentError, Names
from ._table import Table
from ._types import PluginPath


@checked
class Check:
    """Derivatives, scales, numbers that are not finite, what can be estimated.

    findings: Table of check, verdict (pass, skip, warn, fail), where, found, advice
    details: all of it, as `rhec check --json` prints it
    """

    def __init__(self, text: str) -> None:
        import numpy

        self.details: dict[str, Any] = json.loads(text, object_hook=Names)
        columns = ("check", "verdict", "where", "found", "advice")
        self.findings = Table({column: numpy.array([each.get(column, "") for each in self.details["findings"]], dtype=object)
                               for column in columns})

    @classmethod
    def of(cls, model: Any, vehicle: Any = None) -> Check:
        """That of a Model, a BuiltModel, a Term or a BuiltTerm; a term's on a vehicle, as `check` has it."""
        if not hasattr(model, "_section"):
            raise ArgumentError(f"Check.of: model: found {found_in_words(model)}, expected a Model, a BuiltModel, a Term or a BuiltTerm",
                                "model")
        of_what = _rhec.check_of_term if getattr(model, "_is_term", False) else _rhec.check
        section = _configuration.plain(model._section(), [])
        return cls(of_what(list(model._plugin_path), _rhec.Settings.of(section, "configuration"), vehicle_of(vehicle)))

    @property
    def failed(self) -> bool:
        """Whether a check fails; warnings are no failure."""
        return "fail" in list(self.findings["verdict"])

    def failures(self) -> str:
        """The findings that fail, in words."""
        rows = zip(*(self.findings[column] for column in ("verdict", "check", "where", "found")))
        return "; ".join(" ".join(filter(None, row[1:])) for row in rows if row[0] == "fail")

    def __repr__(self) -> str:
        verdicts = list(self.findings["verdict"])
        return f"<check: {verdicts.count('fail')} failed, {verdicts.count('warn')} warnings>"

    def _repr_html_(self) -> str:
        return self.findings._repr_html_()


def vehicle_of(given: Any) -> _rhec.Vehicle | None:
    """The Vehicle of a Vehicle, a Model or a BuiltModel."""
    if given is None or isinstance(given, _rhec.Vehicle):
        return given
    made = given.load() if hasattr(given, "load") else getattr(given, "vehicle", None)
    if not isinstance(made, _rhec.Vehicle):
        raise ArgumentError(f"check: vehicle: found {found_in_words(given)}, expected a Vehicle, a Model or a BuiltModel", "vehicle")
    return made


@checked
def check(model: Any, *, vehicle: Any = None, plugin_path: PluginPath = (), **options: Any) -> Check:
    """Looks at a model or a term before its first run: a Model, a Term, the name of a plugin, or a file with equations.

    vehicle: on which a term is looked at, a Vehicle or a Model; without one on all model plugins that are found
    """
    if hasattr(model, "_section"):
        if options:
            raise ArgumentError(f"check: found the option '{next(iter(options))}' beside an object; expected it in with_options", next(iter(options)))
        return Check.of(model, vehicle)
    if isinstance(model, os.PathLike):
        model = os.fspath(model)
    if not isinstance(model, str):
        raise ArgumentError(f"check: model: found {found_in_words(model)}, expected a Model, a Term, the name of a plugin, or a file "
                            "with equations", "model")
    folders = _configuration.folders_of(plugin_path)
    return Check(_rhec.check(folders, _rhec.Settings.of({"name": model, **options}, "configuration"), vehicle_of(vehicle)))
