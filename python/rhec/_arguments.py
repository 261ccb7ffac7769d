"""Arguments that cannot be: which one, what was found, what was expected. The annotations of a function say what it takes."""
from __future__ import annotations

import ast
import functools
import inspect
import math
import os
import pathlib
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from ._errors import ArgumentError

_Checked = TypeVar("_Checked", bound=Callable[..., Any])


def found_in_words(value: Any) -> str:
    """What was found: short things as they are, others by their class."""
    if value is None or isinstance(value, bool):
        return str(value)
    if isinstance(value, (str, bytes, int, float)) and len(repr(value)) <= 60:
        return repr(value)
    return f"an object of the class '{type(value).__name__}'"


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_file(value: Any) -> bool:
    return isinstance(value, (str, os.PathLike)) and "\0" not in str(value)


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool) or type(value).__module__ == "numpy" and getattr(value, "dtype", None) == bool


def _is_integer(value: Any) -> bool:
    return hasattr(value, "__index__") and not hasattr(value, "__len__") and -2**31 <= value.__index__() < 2**31


def _is_number(value: Any) -> bool:
    """Of CasADi and sympy numbers, too, which Python makes a float of."""
    return not isinstance(value, (str, bytes)) and (hasattr(value, "__float__") or hasattr(value, "__index__"))


def _is_folders(value: Any) -> bool:
    return _is_file(value) or isinstance(value, Sequence) and all(map(_is_file, value))


def _is_texts(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes)) and all(map(_is_text, value))


def is_array(value: Any) -> bool:
    """Whether numpy makes real numbers of it, as the module in C++ asks for them."""
    import numpy

    try:
        made = numpy.asarray(value)
        if made.dtype.kind == "O":
            made = made.astype(float)
    except (TypeError, ValueError, OverflowError):
        return False
    return made.dtype.kind in "biuf"


def _is_dict(value: Any) -> bool:
    return isinstance(value, Mapping) and all(map(_is_text, value))


def is_terms(value: Any) -> bool:
    """Whether one can go through it: also through matrices of sympy and vectors of CasADi."""
    return not isinstance(value, (str, bytes)) and (isinstance(value, Iterable) or hasattr(value, "numel") or
                                                    hasattr(value, "__getitem__") and hasattr(value, "__len__"))


_ARRAY = "real numbers: a number, a list or an array of numpy"
_FILE = "the name of a file, a text or a path"
_FOLDERS = "a directory, or a list of them"
# What each annotation takes, in words.
_KINDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "None": ("None", lambda value: value is None),
    "str": ("a text", _is_text),
    "bool": ("True or False", _is_flag),
    "int": ("an integer of 32 bits", _is_integer),
    "float": ("a number", _is_number),
    "File": (_FILE, _is_file),
    "Configuration": ("the name of a YAML file or a dict", lambda value: isinstance(value, dict) or _is_file(value)),
    "Changes": ("a dict of dotted keys and values, or None", lambda value: value is None or _is_dict(value)),
    "PluginPath": (_FOLDERS, _is_folders),
    "LogPart": ("the name of a file, or an array (n, 3)", lambda value: _is_file(value) or is_array(value)),
    "Progress": ("None, True, False, or a function of (share, text)",
                 lambda value: value is None or _is_flag(value) or callable(value)),
    "Array": (_ARRAY, is_array),
    "ArrayLike": (_ARRAY, is_array),
    "Terms": ("a dict by names or symbols, or a list of them", is_terms),
    "Callable": ("a function", callable),
    "dict": ("a dict whose keys are texts", _is_dict),
    "Mapping": ("a dict whose keys are texts", _is_dict),
    "list": ("a list", lambda value: isinstance(value, Sequence) and not isinstance(value, (str, bytes))),
    "Sequence[str]": ("a list of texts", _is_texts),
    "list[str]": ("a list of texts", _is_texts),
    "Sequence": ("a list", lambda value: isinstance(value, Sequence) and not isinstance(value, (str, bytes))),
    "Iterable": ("a list", lambda value: isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping))),
    "pathlib.Path": ("a path", lambda value: isinstance(value, pathlib.PurePath)),
}
# Who makes what is made in C++.
_MAKERS = {"Estimate": "Estimator.estimate", "Command": "Controller.control", "Estimator": "Robot.make_estimator",
           "Controller": "Robot.make_controller", "Path": "rhec.Path", "Vehicle": "Robot.vehicle or Model.load",
           "Drive": "rhec.run", "Replays": "rhec.estimate", "ProblemBase": "rhec.read_problems", "Settings": "a configuration",
           "Solution": "Problem.solve", "Report": "a solve", "Variable": "a Vehicle",
           "LogFiles": "rhec.estimate"}
_SPLIT = re.compile(r"\s*\|\s*(?![^\[]*\])")


def _class_of(name: str) -> type | None:
    """A class of this package that an annotation names; of names that both have, the module's where it says so."""
    import rhec

    from . import _rhec

    plain = name.removeprefix("_rhec.")
    homes = (_rhec,) if plain != name else (rhec, _rhec)
    return next((getattr(home, plain) for home in homes if inspect.isclass(getattr(home, plain, None))), None)


def _kind_of(annotation: str) -> tuple[str, Callable[[Any], bool]] | None:
    """What one part of an annotation takes; None: anything."""
    found = _KINDS.get(annotation) or _KINDS.get(annotation.split("[")[0])
    if found:
        return found
    kind = _class_of(annotation)
    if kind is None:
        return None
    if annotation == "_rhec.Robot":
        return "what make_estimator and make_controller of a Robot hand over: call these", lambda value: isinstance(value, kind)
    maker = _MAKERS.get(kind.__name__)
    return f"an object of the class '{kind.__name__}'" + (f" ({maker})" if maker else ""), lambda value: isinstance(value, kind)


def check(title: str, name: str, annotation: str, value: Any) -> None:
    """Throws ArgumentError unless the annotation of an argument takes the value."""
    kinds = [_kind_of(part) for part in _SPLIT.split(annotation)]
    known = [kind for kind in kinds if kind is not None]
    if len(known) < len(kinds) or any(takes(value) for _, takes in known):
        return
    raise ArgumentError(f"{title}: {name}: found {found_in_words(value)}, expected {' or '.join(words for words, _ in known)}", name)


def check_range(title: str, **given: tuple[float | None, float, float]) -> None:
    """Throws ArgumentError unless each number, if there is one, lies between two others; NaN does not."""
    for name, (value, least, most) in given.items():
        if value is not None and not least <= value <= most:
            expected = f"at least {least}" if most == math.inf else f"from {least} to {most}"
            raise ArgumentError(f"{title}: {name}: found {found_in_words(value)}, expected a number, {expected}", name)


def _names_of(signature: inspect.Signature) -> str:
    return ", ".join(str(each.replace(annotation=inspect.Parameter.empty)) for each in signature.parameters.values())


def check_all(title: str, signature: inspect.Signature, given: tuple[Any, ...], named: dict[str, Any]) -> None:
    """Throws ArgumentError unless a signature takes the arguments, by number, names and classes."""
    try:
        bound = signature.bind(*given, **named)
    except TypeError as mistake:
        raise ArgumentError(f"{title}: {mistake}; expected {title}({_names_of(signature)})") from None
    for name, value in bound.arguments.items():
        parameter = signature.parameters[name]
        if isinstance(parameter.annotation, str) and parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            check(title, name, parameter.annotation, value)


def _checked_function(function: _Checked, title: str, skipped: int) -> _Checked:
    whole = inspect.signature(function)
    signature = whole.replace(parameters=list(whole.parameters.values())[skipped:])

    @functools.wraps(function)
    def call(*given: Any, **named: Any) -> Any:
        check_all(title, signature, given[skipped:], named)
        return function(*given, **named)

    return call  # type: ignore[return-value]


def checked(thing: _Checked) -> _Checked:
    """A function, or a class with its public methods, that says which argument cannot be, instead of failing within."""
    if not inspect.isclass(thing):
        return _checked_function(thing, thing.__name__, 0)
    for name, member in list(vars(thing).items()):
        if name.startswith("_") and name != "__init__":
            continue
        title = thing.__name__ if name == "__init__" else f"{thing.__name__}.{name}"
        if isinstance(member, classmethod):
            setattr(thing, name, classmethod(_checked_function(member.__func__, title, 1)))
        elif inspect.isfunction(member):
            setattr(thing, name, _checked_function(member, title, 1))
    return thing


# Of what is made in C++ the stub says the same.


class _Default:
    """Of a parameter whose default the stub does not say."""

    def __repr__(self) -> str:
        return "..."


_DEFAULT = _Default()


@functools.lru_cache(maxsize=None)
def _stubs() -> dict[str, inspect.Signature]:
    """Signatures by "name" and "Class.name"; a constructor's by "Class"."""
    body = ast.parse(pathlib.Path(__file__).with_name("_rhec.pyi").read_text(encoding="utf-8")).body
    made = {}
    for each in body:
        if isinstance(each, ast.FunctionDef):
            made[each.name] = _signature_of(each, 0)
        elif isinstance(each, ast.ClassDef):
            for member in each.body:
                if isinstance(member, ast.FunctionDef):
                    is_static = any(getattr(mark, "id", "") == "staticmethod" for mark in member.decorator_list)
                    title = each.name if member.name == "__init__" else f"{each.name}.{member.name}"
                    made[title] = _signature_of(member, 0 if is_static else 1)
    return made


def _signature_of(function: ast.FunctionDef, skipped: int) -> inspect.Signature:
    given = function.args
    plain = len(given.args) - len(given.defaults)
    made = []
    for i, each in enumerate(given.args):
        made.append(_parameter_of(each, inspect.Parameter.POSITIONAL_OR_KEYWORD, i >= plain))
    for each, default in zip(given.kwonlyargs, given.kw_defaults):
        made.append(_parameter_of(each, inspect.Parameter.KEYWORD_ONLY, default is not None))
    return inspect.Signature(made[skipped:])


def _parameter_of(each: ast.arg, kind: Any, has_default: bool) -> inspect.Parameter:
    annotation = ast.unparse(each.annotation) if each.annotation else "Any"
    annotation = re.sub(r"\bRobot\b", "_rhec.Robot", annotation)  # not that of the package
    return inspect.Parameter(each.arg, kind, default=_DEFAULT if has_default else inspect.Parameter.empty, annotation=annotation)


_METHOD = re.compile(r"^\s*1\. \(self: (?:[\w.]+\.)?(\w+)", re.MULTILINE)
_CONSTRUCTOR = re.compile(r"^\s*1\. (?:[\w.]+\.)?(\w+)\(", re.MULTILINE)


def refusal(text: str, given: tuple[Any, ...], named: dict[str, Any] | None) -> ArgumentError:
    """In the place of pybind11's words for a call whose arguments do not fit."""
    name, method = text.split("(", 1)[0], _METHOD.search(text)
    try:
        if name == "__init__":
            found = _CONSTRUCTOR.search(text)
            title = found[1] if found else name
            check_all(title, _stubs()[title], given[1:], named or {})
        elif method:
            title = f"{method[1]}.{name}"
            if not given:
                return ArgumentError(f"{title}: called without its object; expected one of the class '{method[1]}'", "self")
            check(title, "self", f"_rhec.{method[1]}", given[0])
            check_all(title, _stubs()[title], given[1:], named or {})
        else:
            statics = [each for each in _stubs() if each == name or each.endswith(f".{name}")]
            title = statics[0] if statics else name
            check_all(title, _stubs()[title], given, named or {})
    except ArgumentError as mistake:
        return mistake
    classes = ", ".join(found_in_words(each) for each in [*given[1 if method or name == "__init__" else 0:], *(named or {}).values()])
    return ArgumentError(f"{title}: found {classes}; expected {title}({_names_of(_stubs()[title])})")


def without_constructor(name: str) -> ArgumentError:
    """Of a class whose objects only C++ makes."""
    maker = _MAKERS.get(name)
    return ArgumentError(f"{name}: No constructor defined! Expected one of those that {maker} hands over" if maker else
                         f"{name}: No constructor defined!")
