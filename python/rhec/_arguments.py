"""What a call that is given something else expects, in words: pybind11 lists its own types."""
from __future__ import annotations

import difflib
import numbers
import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ._errors import ArgumentError

# "control(): incompatible function arguments. The following argument types are supported:\n    1. (self: ...) -> ...\n\nInvoked with: ..."
_MESSAGE = re.compile(r"^(?P<name>\w+)\(\): incompatible (?:function|constructor) arguments\..*?^    1\. (?P<made>[\w.]*)\((?P<signature>.*?)\)(?: -> [^\n]*)?$",
                      re.DOTALL | re.MULTILINE)
_MADE_BY_A_ROBOT = "what is inside a Robot; call its make_estimator or make_controller"
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
    "initial_state": "a number for each state, (n_x), in their units, or None",
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
    "parameters": "a number for each parameter, (n_p), or rows of them, (n, n_p)",
    "path": "a Path",
    "robot": _MADE_BY_A_ROBOT,
    "solver": "the name of a solver, a text",
    "states": "a number for each state, (n_x), or rows of them, (n, n_x), in their units",
    "substeps": "a whole number",
    "time": "seconds, one number",
    "waypoints": "rows of x [m], y [m], speed [m/s], (n, 3), or with the room to the left and right [m], (n, 5)",
    "with_jacobian": "True or False",
}


_OF_TYPES = ((r"[Ll]ist\[|Sequence\[", "a list of texts"), (r"ndarray", "numbers"), (r"\bbool\b", "True or False"),
             (r"\bfloat\b|SupportsFloat", "a number"), (r"\bint\b|SupportsInt", "a whole number"), (r"\bstr\b", "a text"), (r"\bdict\b", "a dict"))


_LARGEST = 2**31 - 1  # of C's int


class _Parameter(NamedTuple):
    name: str
    type: str
    default: str | None
    by_name_only: bool


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


def parameters_of(signature: str) -> list[_Parameter]:
    """Of "self: rhec._rhec.Path, arc_length: float = 0"."""
    made, by_name_only = [], False
    for part in _parts(signature):
        if part in ("*", "/"):
            by_name_only = by_name_only or part == "*"
            continue
        name, _, rest = part.partition(":")
        kind, equals, default = rest.partition(" = ")
        made.append(_Parameter(name.strip(), kind.strip(), default.strip() if equals else None, by_name_only))
    return made


def _is_numbers(value: Any) -> bool:
    import numpy

    try:
        if numpy.ma.isMaskedArray(value):
            value = value.filled(0)
        made = numpy.asarray(value)
        if made.dtype.kind not in "biufO":
            return False
        made.astype(float)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def _is_sequence_of(test: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, Sequence) and not isinstance(value, (str, bytes)) and all(map(test, value))


def _is_text(value: Any) -> bool:
    return isinstance(value, (str, bytes))


def _fits(value: Any, kind: str) -> bool:
    """Whether pybind11 takes the value as that type, as far as one can tell."""
    from . import _rhec

    if value is None and ("Optional" in kind or "None" in kind):
        return True
    if "ndarray" in kind or "ArrayLike" in kind:
        return value is not None and _is_numbers(value)
    own = re.search(r"_rhec\.(\w+)", kind)
    if re.search(r"[Ll]ist\[|Sequence\[", kind):
        return _is_sequence_of(_is_text)(value) if "str" in kind and not own else isinstance(value, Sequence)
    if own:
        return isinstance(value, getattr(_rhec, own[1]))
    if re.search(r"\bbool\b", kind):
        return not isinstance(value, str) and value is not None
    if re.search(r"\bfloat\b|SupportsFloat", kind):
        return isinstance(value, numbers.Real) or hasattr(value, "__float__") and not _is_text(value)
    if re.search(r"\bint\b|SupportsInt", kind):
        return hasattr(value, "__index__") and -_LARGEST <= int(value) <= _LARGEST
    if re.search(r"\bstr\b", kind):
        return _is_text(value)
    if re.search(r"\bdict\b", kind):
        return isinstance(value, dict)
    return True


def _found(value: Any) -> str:
    """A value in a few words."""
    kind = type(value).__name__
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        return f"an array of {value.dtype}, {tuple(value.shape)}" if value.shape else f"{kind} {value!s:.60}"
    if value is None or isinstance(value, (bool, int, float, complex, str)):
        shown = repr(value)
        return f"{shown[:57] + '...' if len(shown) > 60 else shown}" + ("" if value is None else f" ({kind})")
    if isinstance(value, (list, tuple)) and value and all(isinstance(each, (list, tuple)) for each in value):
        lengths = sorted({len(each) for each in value})
        if len(lengths) > 1:
            return f"rows of {', '.join(map(str, lengths[:-1]))} and {lengths[-1]} entries"
    return f"an object of the class '{kind}'"


def _words(function: str, parameter: _Parameter) -> str:
    known = MEANINGS.get(f"{function}.{parameter.name}") or MEANINGS.get(parameter.name)
    if known:
        return known
    own = re.search(r"_rhec\.(\w+)", parameter.type)
    if own:
        return f"an object of the class '{own[1]}'"
    return next((words for kind, words in _OF_TYPES if re.search(kind, parameter.type)), parameter.type)


def _taken(parameters: list[_Parameter]) -> str:
    """A signature without types."""
    made = []
    for index, each in enumerate(parameters):
        if each.by_name_only and (index == 0 or not parameters[index - 1].by_name_only):
            made.append("*")
        made.append(each.name if each.default is None else f"{each.name}={each.default}")
    return ", ".join(made)


def in_words(message: str, arguments: tuple[Any, ...], by_name: dict[str, Any] | None) -> ArgumentError | None:
    """The error of a call that pybind11 has refused with a message; None if the message is of something else."""
    match = _MESSAGE.match(message)
    if not match:
        return None
    parameters, given, named = parameters_of(match["signature"]), list(arguments), dict(by_name or {})
    name, function = match["name"], match["name"]
    if match["made"]:  # pybind11 lists a constructor as the class, without the object that is made
        name = match["made"].rpartition(".")[2]
        function = f"{name}.__init__"
        given = given[1:]
    elif parameters and parameters[0].name == "self":
        own, itself = re.search(r"_rhec\.(\w+)", parameters[0].type), parameters.pop(0)
        if own:
            name = function = f"{own[1]}.{name}"
        if not given or (own and not _fits(given[0], itself.type)):
            return ArgumentError(f"{name}: found {_found(given[0]) if given else 'nothing'} before the arguments, expected an object of the class "
                                 f"'{own[1] if own else 'object'}'; call it as a method of one")
        given.pop(0)
    takes = f"{name}({_taken(parameters)})"
    places = [each for each in parameters if not each.by_name_only]
    if len(given) > len(places):
        return ArgumentError(f"{name}: found {len(given)} arguments without a name, expected at most {len(places)}: {takes}")
    known = [each.name for each in parameters]
    for word in named:
        if word not in known:
            near = difflib.get_close_matches(word, known, 1)
            return ArgumentError(f"{name}: there is no argument '{word}'; {f'did you mean {near[0]!r}? ' if near else ''}it is {takes}")
    for each, _ in zip(places, given):
        if each.name in named:
            return ArgumentError(f"{name}: {each.name} is there twice, once without its name; it is {takes}")
    values = {**{each.name: value for each, value in zip(places, given)}, **named}
    for each in parameters:
        if each.name not in values and each.default is None:
            return ArgumentError(f"{name}: {each.name} is missing; expected {_words(function, each)}: {takes}")
    for each in parameters:
        if each.name in values and not _fits(values[each.name], each.type) and not (values[each.name] is None and each.default == "None"):
            return ArgumentError(f"{name}: {each.name}: found {_found(values[each.name])}, expected {_words(function, each)}")
    found = ", ".join(f"{each}: {_found(value)}" for each, value in values.items())
    expected = "; ".join(f"{each.name}: {_words(function, each)}" for each in parameters)
    return ArgumentError(f"{name}: found {found or 'nothing'}; expected {expected}")
