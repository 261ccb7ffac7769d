"""Configurations: a YAML file, or the same as a dict."""
from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from . import _rhec
from ._errors import ArgumentError, Error
from ._types import Changes, Configuration, PluginPath


def plain(value: Any, folders: list[str]) -> Any:
    """The same of dicts and lists alone. Models that were written in Python become their sections; the folders of
    their plugins are added to `folders`."""
    if hasattr(value, "_section"):
        folders.extend(folder for folder in value._plugin_path if folder not in folders)
        return value._section()
    if isinstance(value, dict):
        return {key: plain(each, folders) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each, folders) for each in value]
    return value


def folders_of(plugin_path: PluginPath) -> list[str]:
    """Plugin directories as a list of texts; one of them may be given alone."""
    if isinstance(plugin_path, (str, os.PathLike)):
        plugin_path = [plugin_path]
    if not isinstance(plugin_path, Sequence) or not all(isinstance(each, (str, os.PathLike)) for each in plugin_path):
        raise ArgumentError(f"plugin_path: found {plugin_path!r:.60}, expected a folder or a list of folders")
    return [os.path.abspath(os.fspath(folder)) for folder in plugin_path]


def read(source: Configuration, changes: Changes = None, plugin_path: PluginPath = ()) -> tuple[_rhec.Settings, list[str]]:
    """The settings of a YAML file or a dict, with `changes` (a dict of dotted keys) put over them, and the directories
    of the plugins that they need."""
    folders = folders_of(plugin_path)
    if isinstance(source, (str, os.PathLike)):
        settings = _rhec.Settings.load(os.fspath(source))
    elif isinstance(source, dict):
        try:
            settings = _rhec.Settings.of(plain(source, folders), "configuration")
        except RecursionError:
            raise Error("configuration: a dict or a list in it contains itself, or they are nested too deep") from None
    else:
        raise ArgumentError(f"configuration: found an object of the class '{type(source).__name__}', expected the name of a YAML "
                    "file or a dict")
    if changes is not None and not (isinstance(changes, Mapping) and all(isinstance(key, str) for key in changes)):
        raise ArgumentError(f"set: found {changes!r:.60}, expected a dict of keys, such as {{'estimator.horizon': 20}}")
    for key, value in (changes or {}).items():
        settings.set(key, plain(value, folders))
    return settings, folders
