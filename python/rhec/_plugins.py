"""Which plugins there are, and which options."""
from __future__ import annotations

import os

from . import _configuration, _rhec
from ._arguments import checked
from ._errors import Error, nearest
from ._table import Table
from ._types import PluginPath


@checked
def plugins(*, plugin_path: PluginPath = (), refused: bool = False) -> Table:
    """The plugins that are found: a Table of kind, name, version, licence, source, backend, path. With `refused` also
    those that are not used, with the reason."""
    import numpy

    found = _rhec.plugins(_configuration.folders_of(plugin_path))
    chosen = [each for each in found if refused or not each["refusal"]]
    names = ["kind", "name", "version", "licence", "source", "backend", "path"] + (["refusal"] if refused else [])
    return Table({name: numpy.array([str(each[name] or "") for each in chosen], dtype=object) for name in names})


@checked
def options(name: str = "", *, kind: str = "", plugin_path: PluginPath = ()) -> Table:
    """The options of a plugin, by its name, of a section of scenarios ('estimator'), or, without a name, of a scenario's
    root; or a single key ('estimator.horizon', 'speed'): a Table of name, type, default, values, meaning."""
    import numpy

    sections, folders = _rhec.sections(), _configuration.folders_of(plugin_path)
    keys = {f"{section}.{row['name']}" if section else row["name"]: row for section, rows in sections.items() for row in rows}
    of_key = [{**row, "name": key} for key, row in keys.items() if name in (key, row["name"])]
    plugin_names = {each["name"] for each in _rhec.plugins(folders) if not each["refusal"]}
    if name in sections and not kind:
        rows = sections[name]
    elif of_key and not kind and name not in plugin_names:
        rows = of_key
    elif not kind and name not in plugin_names and not os.path.exists(name) and (near := nearest(name, [*sections, *keys, *plugin_names])):
        raise Error(f"options: there is no section, key or plugin '{name}'; did you mean '{near}'?")
    else:
        by_kind = _rhec.plugin_options(folders, name, kind)
        if len(by_kind) > 1:
            raise Error(f"name: '{name}' is a {' and a '.join(by_kind)}; say which by kind=")
        rows = next(iter(by_kind.values()))
    columns = ("name", "type", "default", "values", "meaning")
    return Table({column: numpy.array([row[column] for row in rows], dtype=object) for column in columns})
