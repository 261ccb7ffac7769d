"""A vehicle that is written in Python: with sympy's or CasADi's terms."""
from __future__ import annotations

import functools
import json
import pathlib
import re
from collections.abc import Sequence
from typing import Any

from . import _compile, _configuration, _notation, _rhec
from ._check import Check
from ._errors import Error
from ._types import File

_KINDS = ("states", "inputs", "parameters", "outputs", "options")


def name_of(key: Any) -> str:
    """Of a text or a symbol: x, x(t), SX x."""
    if isinstance(key, str):
        return key
    if hasattr(key, "func") and getattr(key, "args", None):
        return key.func.__name__
    name = getattr(key, "name", None)
    if name is None:
        raise Error(f"found {key!r} as the name of a variable, expected a text or a symbol")
    return name() if callable(name) else name


def by_name(given: Any, what: str) -> dict[str, Any]:
    """A dict by name of a dict by names or symbols, a list of them, or pairs."""
    if given is None:
        return {}
    if hasattr(given, "numel"):  # a vector of CasADi's symbols: its entries are x_0, x_1, ...
        given = [given[i] for i in range(given.numel())]
    pairs = given.items() if isinstance(given, dict) else [each if isinstance(each, tuple) else (each, None) for each in given]
    made = {}
    for key, value in pairs:
        name = name_of(key)
        if name in made:
            raise Error(f"{what}: '{name}' is there twice; keep one of them")
        made[name] = value
    return made


class Model:
    """A vehicle's equations, written once: dx/dt = f(x, u, p), y = h(x).

    name: of the vehicle
    states, inputs, parameters, outputs, options: by name or symbol (or, of nothing but symbols, a list or a vector) what docs/equations.md says of a variable, such as
        {"unit": "m", "typical": 10, "role": "position_x"}, or None; a list where there is nothing to say
    rates: f: by state, or as many in their order, a term of the others, a number or a text in the notation of equations
    measured: h: by output, or as many in their order; an output with the name of a state needs none
    definitions: names for common parts, which stay readable in `build`
    straight_motion: by input (and states that are speeds) a term of `ground_speed`, parameters and options
    source: where the equations were published
    smooth: a width; with it abs, min, max, sign and Piecewise get their smooth forms, without it they are refused
    """

    _plugin_path: list[str] = []

    def __init__(self, name: str, *, states: Any, inputs: Any, rates: Any, measured: Any = None, outputs: Any = None,
                 parameters: Any = None, options: Any = None, definitions: Any = None, straight_motion: Any = None,
                 source: str = "", smooth: float | None = None) -> None:
        self.name = name
        self._variables = {kind: by_name(given, kind) for kind, given in
                           zip(_KINDS, (states, inputs, parameters, outputs, options))}
        names = [each for variables in self._variables.values() for each in variables]
        definitions = by_name(definitions, "definitions")
        notes = _notation.Notes([*names, *definitions], smooth)
        equations = dict(definitions)
        equations |= {f"{state}'": term for state, term in self._matched(rates, "states", "rates").items()}
        equations |= self._matched(measured, "outputs", "measured")
        straight = by_name(straight_motion, "straight_motion")
        texts = texts_of([*equations.values(), *straight.values()], notes)
        self.equations = "".join(f"{left} = {right}\n" for left, right in
                                 [*notes.definitions.items(), *zip(equations, texts)])
        self._straight = "".join(f"{left} = {right}\n" for left, right in zip(straight, texts[len(equations):]))
        self._source = source
        self._options: dict[str, Any] = {}

    def _matched(self, given, kind, what):
        """Terms by the name of a variable of a kind, of a dict or as many in their order."""
        names = list(self._variables[kind])
        if given is None:
            return {}
        if not isinstance(given, dict):
            given = [given[i] for i in range(given.numel())] if hasattr(given, "numel") else list(given)
            if len(given) != len(names):
                raise Error(f"{what}: found {len(given)} terms, expected {len(names)}: {', '.join(names)}")
            return dict(zip(names, given))
        terms = by_name(given, what)
        for name in terms:
            if name not in names:
                raise Error(f"{what}: '{name}' is none of the {kind}; they are {', '.join(names)}")
        return terms

    def _file(self):
        """The keys of a file with equations."""
        made = {"name": self.name}
        if self._source:
            made["source"] = self._source
        for kind in _KINDS:
            if self._variables[kind]:
                made[kind] = {name: {} if about is None else about for name, about in self._variables[kind].items()}
        made["equations"] = self.equations
        if self._straight:
            made["straight_motion"] = self._straight
        return made

    def yaml(self) -> str:
        """The vehicle as a text of docs/equations.md, which every command takes."""
        made = self._file()
        blocks = {key: made.pop(key) for key in ("equations", "straight_motion") if key in made}
        lines = []
        for key, value in made.items():
            if isinstance(value, dict):
                lines.append(f"{key}:")
                lines += [f"  {name}: {json.dumps(about)}" for name, about in value.items()]
            else:
                lines.append(f"{key}: {json.dumps(value)}")
        for key, text in blocks.items():
            lines += [f"{key}: |", *(f"  {line}" for line in text.splitlines())]
        return "\n".join(lines) + "\n"

    def with_options(self, **options: Any) -> Model:
        """The same vehicle with other values of its options, such as wheelbase=2.8; and `outputs`, a list."""
        made = object.__new__(type(self))
        made.__dict__ = {**self.__dict__, "_options": {**self._options, **options}}
        return made

    def _section(self):
        """What a configuration has for it under `model`."""
        return {"equations": _configuration.plain(self._file(), []), **self._options}

    def load(self) -> _rhec.Vehicle:
        """The Vehicle, at once and without a compiler. In a configuration {"model": model} does the same."""
        return _vehicle_of(self)

    def check(self) -> Check:
        """What `rhec check` says of it (docs/check.md)."""
        return Check.of(self)

    def build(self, folder: File | None = None, *, instruction_sets: Sequence[str] | None = None) -> BuiltModel:
        """Checks it, writes it as a plugin in C++, compiles that against the rhec that this package belongs to, and loads
        it. Returns a BuiltModel, for configurations as this one is.

        folder: of the sources; without one a folder of the user's cache, where it is found again the next time
        instruction_sets: of generic, avx2, avx512 (on ARM generic, neon); all without any. One is enough to try a model out.

        Takes cmake and the compiler that rhec was built with.
        """
        if not re.fullmatch(r"[A-Za-z]\w*", self.name, re.ASCII):
            raise Error(f"build: the model's name is '{self.name}'; a plugin takes letters, digits and underscores, and begins with a letter")
        return _Builder(self, folder, instruction_sets).build()

    def __repr__(self) -> str:
        return f"<model '{self.name}': {', '.join(self._variables['states'])}>"


class BuiltModel:
    """A model that was compiled, for configurations: {"model": built}.

    folder: its sources; vehicle: the Vehicle; check: what `rhec check` says of what was compiled, when it is first asked for
    """

    def __init__(self, plugin: str, folder: pathlib.Path, options: dict[str, Any]) -> None:
        self.plugin, self.folder, self._options = plugin, folder, options
        self._plugin_path = [str(folder.absolute() / "build")]
        self.vehicle = _vehicle_of(self)

    @functools.cached_property
    def check(self) -> Check:
        return Check.of(self)

    def _section(self):
        return {"name": self.plugin, **self._options}

    def with_options(self, **options: Any) -> BuiltModel:
        """The same with other values of its options."""
        return BuiltModel(self.plugin, self.folder, {**self._options, **options})

    def __repr__(self) -> str:
        return f"<model '{self.plugin}', compiled in {self.folder}>"


def _vehicle_of(model):
    return _rhec.make_vehicle(list(model._plugin_path), _rhec.Settings.of(model._section(), "configuration"))


def texts_of(terms: list[Any], notes: _notation.Notes) -> list[str]:
    """Texts are taken as they are; all others are read together."""
    others = [term for term in terms if not isinstance(term, str)]
    read = iter(_notation.reader_of(others, notes).read_all(others) if others else [])
    return [term if isinstance(term, str) else next(read) for term in terms]


class _Builder:
    def __init__(self, model, folder, instruction_sets):
        self._model, self._sets = model, instruction_sets
        self._yaml = model.yaml()
        self._folder = _compile.folder_of(folder, model.name, f"{self._yaml}|{instruction_sets}")

    def build(self) -> BuiltModel:
        file = self._folder / f"{self._model.name}.yaml"
        _compile.write(file, self._yaml)
        check = self._model.check()  # before it is compiled, which takes longer
        if check.failed:
            raise Error(f"{file}: the check of the model '{self._model.name}' failed: {check.failures()}")
        sources = _rhec.vehicle_as_cpp(str(file))
        for name, content in sources["files"].items():
            _compile.write(self._folder / name, content)
        _compile.compile_in(self._folder, [f"-DRHEC_MODEL_INSTRUCTION_SETS={';'.join(self._sets)}"] if self._sets else [])
        return BuiltModel(sources["plugin"], self._folder, self._model._options)
