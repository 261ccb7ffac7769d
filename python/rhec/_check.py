"""What `rhec check` says of a model (docs/check.md)."""
from __future__ import annotations

import json
import os
from typing import Any

from . import _configuration, _rhec
from ._arguments import checked, found_in_words
from ._errors import ArgumentError
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

        self.details: dict[str, Any] = json.loads(text)
        columns = ("check", "verdict", "where", "found", "advice")
        self.findings = Table({column: numpy.array([each.get(column, "") for each in self.details["findings"]], dtype=object)
                               for column in columns})

    @classmethod
    def of(cls, model: Any) -> Check:
        """That of a Model or a BuiltModel."""
        if not hasattr(model, "_section"):
            raise ArgumentError(f"Check.of: model: found {found_in_words(model)}, expected a Model or a BuiltModel", "model")
        folders = list(model._plugin_path)
        return cls(_rhec.check(folders, _rhec.Settings.of(model._section(), "configuration")))

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


@checked
def check(model: Any, *, plugin_path: PluginPath = (), **options: Any) -> Check:
    """Looks at a model before its first run: a Model, the name of a plugin, or a file with equations."""
    if hasattr(model, "_section"):
        return Check.of(model)
    if isinstance(model, os.PathLike):
        model = os.fspath(model)
    if not isinstance(model, str):
        raise ArgumentError(f"check: model: found {found_in_words(model)}, expected a Model, the name of a plugin, or a file with "
                            "equations", "model")
    folders = _configuration.folders_of(plugin_path)
    return Check(_rhec.check(folders, _rhec.Settings.of({"name": model, **options}, "configuration")))
