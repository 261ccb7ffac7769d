"""Arguments that cannot be: which one, what was found, what was expected. The annotations of a function say what it takes; of what
is made in C++ it is pybind11's list of types."""
from __future__ import annotations

import difflib
import functools
import inspect
import math
import operator
import os
import pathlib
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

from ._errors import ArgumentError

_Checked = TypeVar("_Checked", bound=Callable[..., Any])


def found_in_words(value: Any, with_class: bool = False) -> str:
    """What was found, in a few words: short things as they are, others by their class."""
    kind = type(value).__name__
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        return f"an array of {value.dtype}, {tuple(value.shape)}" if value.shape else f"{kind} {value!s:.60}"
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
        shown = repr(value)
        return f"{shown[:57] + '...' if len(shown) > 60 else shown}" + (f" ({kind})" if with_class and value is not None else "")
    if isinstance(value, (list, tuple)) and value and all(isinstance(each, (list, tuple)) for each in value):
        lengths = sorted({len(each) for each in value})
        if len(lengths) > 1:
            return f"rows of {', '.join(map(str, lengths[:-1]))} and {lengths[-1]} entries"
    return f"an object of the class '{kind}'"


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_file(value: Any) -> bool:
    return isinstance(value, (str, os.PathLike)) and "\0" not in str(value)


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool) or type(value).__module__ == "numpy" and getattr(value, "dtype", None) == bool


def _is_integer(value: Any) -> bool:
    """Of C's int."""
    try:
        return -2**31 <= operator.index(value) < 2**31
    except TypeError:
        return False


def _is_number(value: Any) -> bool:
    """Of CasADi and sympy numbers, too, which Python makes a float of."""
    return not isinstance(value, (str, bytes)) and (hasattr(value, "__float__") or hasattr(value, "__index__"))


def _is_sequence(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes))


def _is_texts(value: Any) -> bool:
    return _is_sequence(value) and all(map(_is_text, value))


def is_array(value: Any) -> bool:
    """Whether numpy makes real numbers of it, as the module in C++ asks for them."""
    import numpy

    try:
        made = numpy.asarray(value.filled(0) if numpy.ma.isMaskedArray(value) else value)
        if made.dtype.kind == "O":
            made = made.astype(float)
    except (TypeError, ValueError, OverflowError):
        return False
    return value is not None and made.dtype.kind in "biuf"


def is_table(value: Any) -> bool:
    """Whether it has columns by name: a dict, a rhec.Table, a pandas.DataFrame."""
    return isinstance(value, Mapping) or hasattr(value, "columns") and hasattr(value, "keys") and hasattr(value, "__getitem__")


def is_log(value: Any) -> bool:
    """Whether it may be a recorded drive."""
    import rhec

    several = _is_sequence(value) and len(value) > 0 and all(map(is_table, value))
    return isinstance(value, rhec.Log) or _is_file(value) or is_table(value) or several or is_array(value)


def _is_dict(value: Any) -> bool:
    return isinstance(value, Mapping) and all(map(_is_text, value))


def is_terms(value: Any) -> bool:
    """Whether one can go through it: also through matrices of sympy and vectors of CasADi."""
    return not isinstance(value, (str, bytes)) and (isinstance(value, Iterable) or hasattr(value, "numel") or
                                                    hasattr(value, "__getitem__") and hasattr(value, "__len__"))


class _Kind(NamedTuple):
    """What one annotation takes."""

    words: str
    takes: Callable[[Any], bool]


_ARRAY = _Kind("real numbers: a number, a list or an array of numpy", is_array)
_TEXTS = _Kind("a list of texts", _is_texts)
_DICT = _Kind("a dict whose keys are texts", _is_dict)
_LIST = _Kind("a list", _is_sequence)
_KINDS = {
    "None": _Kind("None", lambda value: value is None),
    "str": _Kind("a text", _is_text),
    "bool": _Kind("True or False", _is_flag),
    "int": _Kind("an integer of 32 bits", _is_integer),
    "float": _Kind("a number", _is_number),
    "File": _Kind("the name of a file, a text or a path", _is_file),
    "Configuration": _Kind("the name of a YAML file or a dict", lambda value: isinstance(value, dict) or _is_file(value)),
    "Changes": _Kind("a dict of keys, such as {'estimator.horizon': 20}, or None", lambda value: value is None or _is_dict(value)),
    "PluginPath": _Kind("a folder or a list of folders", lambda value: _is_file(value) or isinstance(value, Sequence) and all(map(_is_file, value))),
    "LogPart": _Kind("the name of a file, or an array (n, 3)", lambda value: _is_file(value) or is_array(value)),
    "DriveLog": _Kind("the name of a file, a Log, a table by columns, a list of tables, or beside gps an array (n, 3)", is_log),
    "Progress": _Kind("True, False, None or a function of (share, text)", lambda value: value is None or _is_flag(value) or callable(value)),
    "Array": _ARRAY,
    "ArrayLike": _ARRAY,
    "Terms": _Kind("a dict by names or symbols, or a list of them", is_terms),
    "Callable": _Kind("a function", callable),
    "dict": _DICT,
    "Mapping": _DICT,
    "list": _LIST,
    "Sequence": _LIST,
    "list[str]": _TEXTS,
    "Sequence[str]": _TEXTS,
    "Iterable": _Kind("a list", lambda value: isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping))),
    "pathlib.Path": _Kind("a path", lambda value: isinstance(value, pathlib.PurePath)),
    # pybind11's text and bool
    "Text": _Kind("a text", lambda value: isinstance(value, (str, bytes))),
    "Truth": _Kind("True or False", lambda value: value is not None and not isinstance(value, str)),
}
# Who makes what is made in C++.
_MAKERS = {"Estimate": "Estimator.estimate", "Command": "Controller.control", "Estimator": "Robot.make_estimator",
           "Controller": "Robot.make_controller", "Path": "rhec.Path", "Vehicle": "Robot.vehicle or Model.load",
           "Drive": "rhec.run", "Replays": "rhec.estimate", "DriveReplays": "rhec.estimate", "DriveLog": "rhec.estimate", "LogFile": "rhec.Log", "ProblemBase": "rhec.read_problems", "Settings": "a configuration",
           "Solution": "Problem.solve", "Report": "a solve", "Variable": "a Vehicle", "LogFiles": "rhec.estimate"}
_SPLIT = re.compile(r"\s*\|\s*(?![^\[]*\])")


def _class_of(name: str) -> type | None:
    """A class of this package that an annotation names; of names that both have, the module's where it says so."""
    import rhec

    from . import _rhec

    plain = name.rpartition("_rhec.")[2]
    homes = (_rhec,) if plain != name else (rhec, _rhec)
    return next((getattr(home, plain) for home in homes if inspect.isclass(getattr(home, plain, None))), None)


def _kind_of(annotation: str) -> _Kind | None:
    """What one part of an annotation takes; None: anything."""
    found = _KINDS.get(annotation) or _KINDS.get(annotation.split("[")[0])
    kind = None if found else _class_of(annotation)
    if kind is None:
        return found
    of, maker = kind, _MAKERS.get(kind.__name__)
    return _Kind(f"an object of the class '{kind.__name__}'" + (f" ({maker})" if maker else ""), lambda value: isinstance(value, of))


def _takes(annotation: str, value: Any) -> bool:
    kinds = [_kind_of(part) for part in _SPLIT.split(annotation)]
    return any(kind is None or kind.takes(value) for kind in kinds)


def _expected(annotation: str) -> str:
    kinds = [_kind_of(part) for part in _SPLIT.split(annotation)]
    return " or ".join(dict.fromkeys(kind.words for kind in kinds if kind)) or annotation


class _Parameter(NamedTuple):
    name: str
    annotation: str
    default: str | None
    kind: Any = inspect.Parameter.POSITIONAL_OR_KEYWORD


_VARIABLE = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
_BY_PLACE = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
_BY_NAME = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


def _taken(parameters: list[_Parameter]) -> str:
    """A signature without types."""
    made = []
    for index, each in enumerate(parameters):
        if each.kind == inspect.Parameter.KEYWORD_ONLY and (index == 0 or parameters[index - 1].kind in _BY_PLACE):
            made.append("*")
        stars = "**" if each.kind == inspect.Parameter.VAR_KEYWORD else "*" if each.kind in _VARIABLE else ""
        made.append(f"{stars}{each.name}" + ("" if each.default is None else f"={each.default}"))
    return ", ".join(made)


class _Call:
    """What a function takes, and who asks for it."""

    def __init__(self, title: str, parameters: list[_Parameter], words: Callable[[_Parameter], str] | None = None) -> None:
        """words: what is expected of an argument, where it is more than its annotation says"""
        self._title, self._parameters = title, parameters
        self._words, self._shows_class = words or (lambda parameter: _expected(parameter.annotation)), words is not None

    def mistake(self, given: Sequence[Any], named: Mapping[str, Any], values_count: bool = True) -> ArgumentError | None:
        """Of arguments, by their number, names and, if they count, values; None if there is none that one can tell."""
        return self._of_names(given, named) or (self._of_values(self._by_name(given, named)) if values_count else None)

    def unclear(self, given: Sequence[Any], named: Mapping[str, Any]) -> ArgumentError:
        """Of arguments one of which was refused, whichever it is."""
        found = ", ".join(f"{name}: {self._found(value)}" for name, value in self._by_name(given, named).items())
        expected = "; ".join(f"{each.name}: {self._words(each)}" for each in self._parameters)
        return ArgumentError(f"{self._title}: found {found or 'nothing'}; expected {expected}")

    def _by_name(self, given: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
        known = {each.name for each in self._parameters if each.kind in _BY_NAME}
        places = [each.name for each in self._parameters if each.kind in _BY_PLACE]
        return {**dict(zip(places, given)), **{name: value for name, value in named.items() if name in known}}

    def _of_names(self, given: Sequence[Any], named: Mapping[str, Any]) -> ArgumentError | None:
        title, takes = self._title, f"{self._title}({_taken(self._parameters)})"
        places, kinds = [each for each in self._parameters if each.kind in _BY_PLACE], {each.kind for each in self._parameters}
        known = [each.name for each in self._parameters if each.kind in _BY_NAME]
        if len(given) > len(places) and inspect.Parameter.VAR_POSITIONAL not in kinds:
            return ArgumentError(f"{title}: found {len(given)} arguments without a name, expected at most {len(places)}: {takes}")
        for word in named:
            if word not in known and inspect.Parameter.VAR_KEYWORD not in kinds:
                near = difflib.get_close_matches(word, known, 1)
                hint = f"did you mean {near[0]!r}? " if near else f"keys of a configuration go into set={{'{word}': ...}}; " if "set" in known else ""
                return ArgumentError(f"{title}: there is no argument '{word}'; {hint}it is {takes}")
        for each, _ in zip(places, given):
            if each.name in named and each.name in known:
                return ArgumentError(f"{title}: {each.name} is there twice, once without its name; it is {takes}", each.name)
        there = self._by_name(given, named)
        for each in self._parameters:
            if each.name not in there and each.default is None and each.kind not in _VARIABLE:
                return ArgumentError(f"{title}: {each.name} is missing; expected {self._words(each)}: {takes}", each.name)
        return None

    def _of_values(self, values: dict[str, Any]) -> ArgumentError | None:
        for each in self._parameters:
            value = values.get(each.name)
            if each.name in values and not _takes(each.annotation, value) and not (value is None and each.default == "None"):
                is_odd = each.annotation == "Configuration" and not _is_text(value)  # most are objects, of which the class says more
                found = f"an object of the class '{type(value).__name__}'" if is_odd else self._found(value)
                return ArgumentError(f"{self._title}: {each.name}: found {found}, expected {self._words(each)}", each.name)
        return None

    def _found(self, value: Any) -> str:
        return found_in_words(value, self._shows_class)


def check_range(title: str, **given: tuple[float | None, float, float]) -> None:
    """Throws ArgumentError unless each number, if there is one, lies between two others; NaN does not."""
    for name, (value, least, most) in given.items():
        if value is not None and not least <= value <= most:
            expected = f"at least {least}" if most == math.inf else f"from {least} to {most}"
            raise ArgumentError(f"{title}: {name}: found {found_in_words(value)}, expected a number, {expected}", name)


# Functions in Python.


def told_below(method: _Checked) -> _Checked:
    """Marks a method whose arguments the module in C++ takes as they are, and tells what is wrong with them: `checked` then looks
    only at how many there are, and at their names."""
    method.told_below = True  # type: ignore[attr-defined]
    return method


def _checked_function(function: _Checked, title: str, skipped: int) -> _Checked:
    parameters = [_Parameter(each.name, each.annotation if isinstance(each.annotation, str) else "Any",
                             None if each.default is inspect.Parameter.empty else repr(each.default), each.kind)
                  for each in list(inspect.signature(function).parameters.values())[skipped:]]
    asked, values_count = _Call(title, parameters), not hasattr(function, "told_below")

    @functools.wraps(function)
    def call(*given: Any, **named: Any) -> Any:
        mistake = asked.mistake(given[skipped:], named, values_count)
        if mistake:
            raise mistake
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


# Functions in C++: pybind11 lists the types that it has for them.

# "control(): incompatible function arguments. The following argument types are supported:\n    1. (self: ...) -> ...\n\nInvoked with: ..."
_MESSAGE = re.compile(r"^(?P<name>\w+)\(\): incompatible (?:function|constructor) arguments\..*?^    1\. (?P<made>[\w.]*)\((?P<signature>.*?)\)(?: -> [^\n]*)?$",
                      re.DOTALL | re.MULTILINE)
# What is expected of an argument, by its name, or by function and name.
MEANINGS = {
    "acceleration": "a number [m/s^2]",
    "ahead": "an Estimator that remembers places, or None",
    "arc_length": "a number [m]",
    "cold": "True or False",
    "covariance": "that of the mean, (n_x + n_p, n_x + n_p), or None",
    "covariances": "True or False",
    "deadline": "seconds from now, a number, or None",
    "duration": "seconds, one number for all",
    "estimate": "an Estimate, as an estimator's `estimate` returns it",
    "file": "the name of a file, a text",
    "folder": "the name of a folder, a text",
    "id": "a text",
    "initial_state": "a number for each state, (n_x), in their units, NaN where it is not known, or None",
    "inputs": "a number for each input, (n_u), or rows of them, (n, n_u), in their units",
    "Controller.applied.inputs": "a number for each input, (n_u), in their units",
    "Estimator.push_input.inputs": "a number for each input, (n_u), in their units",
    "lateral_acceleration": "a number [m/s^2]",
    "mean": "of [state; parameters], (n_x + n_p), in their units, or None",
    "name": "a text",
    "Estimate.__getitem__.name": "the name of a state or a parameter, a text",
    "obstacles": "rows of x [m], y [m], semi-axes along and across [m], heading [rad], velocity in x and y [m/s], (n, 7)",
    "out": "what an earlier call returned, or None",
    "outputs": "a number for each output, (n_y), in their units, NaN for what is missing",
    "sigmas": "a standard deviation for each output, (n_y), in their units, NaN for those that are as usual",
    "parameters": "a number for each parameter, (n_p), or rows of them, (n, n_p)",
    "path": "a Path",
    "robot": "what is inside a Robot; call its make_estimator or make_controller",
    "solver": "the name of a solver, a text",
    "states": "a number for each state, (n_x), or rows of them, (n, n_x), in their units",
    "substeps": "a whole number",
    "time": "seconds, one number",
    "waypoints": "rows of x [m], y [m], speed [m/s], (n, 3), or with the room to the left and right [m], (n, 5)",
    "with_jacobian": "True or False",
}
_OF_PYBIND = ((r"\bbool\b", "Truth"), (r"\bfloat\b|SupportsFloat", "float"), (r"\bint\b|SupportsInt", "int"), (r"\bstr\b", "Text"), (r"\bdict\b", "dict"))


def _annotation_of(kind: str) -> str:
    """Of a type as pybind11 writes it."""
    own = re.search(r"_rhec\.\w+", kind)
    if "ndarray" in kind or "ArrayLike" in kind:
        plain = "ArrayLike"
    elif re.search(r"[Ll]ist\[|Sequence\[", kind):
        plain = "Sequence[str]" if "str" in kind and not own else "Sequence"
    else:
        plain = own[0] if own else next((each for pattern, each in _OF_PYBIND if re.search(pattern, kind)), "Any")
    return f"{plain} | None" if "Optional" in kind or "None" in kind else plain


def _parts(text: str) -> list[str]:
    """What is between the commas that are in no brackets and no quotes."""
    made, depth, begin, quote = [], 0, 0, ""
    for at, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "'\"":
            quote = letter
        elif letter in "([{<":
            depth += 1
        elif letter in ")]}>":
            depth -= 1
        elif letter == "," and depth == 0:
            made.append(text[begin:at])
            begin = at + 1
    return [each.strip() for each in [*made, text[begin:]] if each.strip()]


def _parameters_of(signature: str) -> list[_Parameter]:
    """Of "self: rhec._rhec.Path, arc_length: float = 0"."""
    made, by_name_only = [], False
    for part in _parts(signature):
        if part in ("*", "/"):
            by_name_only = by_name_only or part == "*"
            continue
        name, _, rest = part.partition(":")
        of, equals, default = rest.partition(" = ")
        made.append(_Parameter(name.strip(), _annotation_of(of), default.strip() if equals else None,
                               inspect.Parameter.KEYWORD_ONLY if by_name_only else inspect.Parameter.POSITIONAL_OR_KEYWORD))
    return made


def _static_title(name: str) -> str:
    """pybind11 says a static method's name without that of its class."""
    from . import _rhec

    owner = next((each.__name__ for each in vars(_rhec).values() if inspect.isclass(each) and isinstance(vars(each).get(name), staticmethod)), None)
    return f"{owner}.{name}" if owner and not hasattr(_rhec, name) else name


def in_words(message: str, arguments: tuple[Any, ...], by_name: dict[str, Any] | None) -> ArgumentError | None:
    """The error of a call that pybind11 has refused with a message; None if the message is of something else."""
    match = _MESSAGE.match(message)
    if not match:
        return None
    parameters, given, named = _parameters_of(match["signature"]), list(arguments), by_name or {}
    if match["made"]:  # pybind11 lists a constructor as the class, without the object that is made
        title = match["made"].rpartition(".")[2]
        function = f"{title}.__init__"
        given = given[1:]
    elif parameters and parameters[0].name == "self":
        itself = parameters.pop(0).annotation
        owner = itself.rpartition(".")[2]
        title = function = f"{owner}.{match['name']}"
        if not given or not _takes(itself, given[0]):
            return ArgumentError(f"{title}: found {found_in_words(given[0], True) if given else 'nothing'} before the arguments, expected an object of "
                                 f"the class '{owner}'; call it as a method of one", "self")
        given.pop(0)
    else:
        title = function = _static_title(match["name"])
    call = _Call(title, parameters,
                 lambda each: MEANINGS.get(f"{function}.{each.name}") or MEANINGS.get(each.name) or _expected(each.annotation))
    return call.mistake(given, named) or call.unclear(given, named)


def without_constructor(name: str) -> ArgumentError:
    """Of a class whose objects only C++ makes."""
    maker = _MAKERS.get(name)
    return ArgumentError(f"{name}: No constructor defined!" + (f" Expected one of those that {maker} hands over" if maker else ""))
