"""Configurations: a YAML file, or the same as a dict."""
from __future__ import annotations

import json
import os
from typing import Any

from . import _rhec
from ._arguments import found_in_words
from ._errors import Error
from ._types import Changes, Configuration, PluginPath


def plain(value: Any, folders: list[str]) -> Any:
    """The same of dicts and lists alone, as below; one that contains itself has no end."""
    try:
        return _plain(value, folders)
    except RecursionError:
        raise Error("configuration: found a dict or a list that contains itself, or is nested too deep; expected one that ends") from None


def _plain(value: Any, folders: list[str]) -> Any:
    """The same of dicts and lists alone. Models that were written in Python become their sections; the folders of
    their plugins are added to `folders`."""
    if hasattr(value, "_section"):
        folders.extend(folder for folder in value._plugin_path if folder not in folders)
        return value._section()
    if isinstance(value, dict):
        return {key: _plain(each, folders) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each, folders) for each in value]
    return value


def as_json(value: Any, what: str) -> str:
    """A text of JSON; numbers and arrays of numpy are as Python's own."""
    try:
        return json.dumps(value, default=_of_numpy)
    except (TypeError, ValueError, RecursionError) as mistake:
        raise Error(f"{what}: {mistake}; expected numbers, texts, lists, dicts and None") from None


def _of_numpy(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"found {found_in_words(value)}")


def folders_of(plugin_path: PluginPath) -> list[str]:
    """Plugin directories as a list of texts; one of them may be given alone."""
    if isinstance(plugin_path, (str, os.PathLike)):
        plugin_path = [plugin_path]
    return [os.path.abspath(os.fspath(folder)) for folder in plugin_path]


def read(source: Configuration, changes: Changes = None, plugin_path: PluginPath = ()) -> tuple[_rhec.Settings, list[str]]:
    """The settings of a YAML file or a dict, with `changes` (a dict of dotted keys) put over them, and the directories
    of the plugins that they need."""
    folders = folders_of(plugin_path)
    if isinstance(source, (str, os.PathLike)):
        settings = _rhec.Settings.load(os.fspath(source))
    else:
        settings = _rhec.Settings.of(plain(source, folders), "configuration")
    for key, value in (changes or {}).items():
        settings.set(key, plain(value, folders))
    return settings, folders
