"""A vehicle that is written in Python: with sympy's or CasADi's terms."""
from __future__ import annotations

import functools
import pathlib
import re
from collections.abc import Sequence
from typing import Any

from . import _compile, _configuration, _notation, _rhec
from ._arguments import checked, found_in_words, is_terms
from ._check import Check
from ._errors import ArgumentError, Error
from ._types import File, Terms

_SETS = ("generic", "avx2", "avx512", "neon")
_KINDS = ("states", "inputs", "parameters", "outputs", "options")


def name_of(key: Any) -> str:
    """Of a text or a symbol: x, x(t), SX x."""
    if isinstance(key, str):
        return key
    if hasattr(key, "func") and getattr(key, "args", None):
        return key.func.__name__
    name = getattr(key, "name", None)
    if name is None:
        raise ArgumentError(f"found {key!r} as the name of a variable, expected a text or a symbol")
    return name() if callable(name) else name


def by_name(given: Any, what: str) -> dict[str, Any]:
    """A dict by name of a dict by names or symbols, a list of them, or pairs."""
    if given is None:
        return {}
    if not is_terms(given):
        raise ArgumentError(f"{what}: found {found_in_words(given)}, expected a dict by names or symbols, or a list of them", what)
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


@checked
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

    def __init__(self, name: str, *, states: Terms, inputs: Terms, rates: Terms, measured: Terms | None = None,
                 outputs: Terms | None = None,
                 parameters: Terms | None = None, options: Terms | None = None, definitions: Terms | None = None,
                 straight_motion: Terms | None = None,
                 source: str = "", smooth: float | None = None) -> None:
        self.name = name
        self._variables = {kind: by_name(given, kind) for kind, given in
                           zip(_KINDS, (states, inputs, parameters, outputs, options))}
        names = [each for variables in self._variables.values() for each in variables]
        definitions = by_name(definitions, "definitions")
        notes = _notation.Notes([*names, *definitions], smooth)
        equations = dict(definitions)
        equations |= {f"{state}'": term for state, term in self._matched(rates, "states", "rates").items()}
        # What measures the state of its name has no equation.
        equations |= {output: term for output, term in self._matched(measured, "outputs", "measured").items()
                      if output not in self._variables["states"] or str(term) != output}
        straight = by_name(straight_motion, "straight_motion")
        owner, of_equations = f"the model '{name}'", _where(equations, definitions)
        of_straight = [f"straight_motion: {each}" for each in straight]
        texts = labelled_texts(owner, dict(zip([*of_equations, *of_straight], [*equations.values(), *straight.values()])), notes)
        known = {*names, *definitions, *notes.definitions}
        for labels, terms, written, further in ((of_equations, equations, texts, ()), (of_straight, straight, texts[len(equations):], ("ground_speed",))):
            read = {each: text for each, term, text in zip(labels, terms.values(), written) if not isinstance(term, str)}
            check_known(owner, read, {*known, *further})
        check_known(owner, parts_of(notes), {*known, "ground_speed"})
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
                lines += [f"  {name}: {_configuration.as_json(about, f'{key}: {name}')}" for name, about in value.items()]
            else:
                lines.append(f"{key}: {_configuration.as_json(value, key)}")
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
        return _vehicle_of(self, self.name)

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
        for each in instruction_sets or ():
            if each not in _SETS:
                raise ArgumentError(f"Model.build: instruction_sets: found {found_in_words(each)}, expected some of {', '.join(_SETS)}",
                                    "instruction_sets")
        return _Builder(self, folder, instruction_sets).build()

    def __repr__(self) -> str:
        return f"<model '{self.name}': {', '.join(self._variables['states'])}>"


@checked
class BuiltModel:
    """A model that was compiled, for configurations: {"model": built}.

    folder: its sources; vehicle: the Vehicle; check: what `rhec check` says of what was compiled, when it is first asked for
    """

    def __init__(self, plugin: str, folder: pathlib.Path, options: dict[str, Any]) -> None:
        self.plugin, self.folder, self._options = plugin, folder, options
        self._plugin_path = [str(folder.absolute() / "build")]
        self.vehicle = _vehicle_of(self, plugin)

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


def _vehicle_of(model, name):
    return _rhec.make_vehicle(list(model._plugin_path), _rhec.Settings.of(model._section(), f"the model '{name}'"))


def texts_of(terms: list[Any], notes: _notation.Notes, reads_texts: bool = False) -> list[str]:
    """Texts are taken as they are, or read where the style is another one than that of equations; all others are read
    together."""
    others = [term for term in terms if not isinstance(term, str)]
    read = iter(_notation.reader_of(others, notes).read_all(others) if others else [])
    texts = _notation.TextReader(notes)
    return [next(read) if not isinstance(term, str) else texts.read(term).text if reads_texts else term for term in terms]


def labelled_texts(owner: str, terms: dict[str, Any], notes: _notation.Notes, writes_texts: bool = False) -> list[str]:
    """As `texts_of`, of terms by where they stand, which is said with what is wrong with one of them. Of texts that stay as they are
    the equations' own reader tells, with line and column, when they are loaded."""
    for where, term in terms.items():
        if isinstance(term, str) and not writes_texts:
            continue
        alone = _notation.Notes(notes.taken, notes.smooth, notes.style)
        try:
            texts_of([term], alone, writes_texts)
        except Error as mistake:
            raise type(mistake)(f"{owner}: {where}: {mistake}") from None
    return texts_of(list(terms.values()), notes, writes_texts)


def parts_of(notes: _notation.Notes) -> dict[str, str]:
    """What terms have in common, or what was too deep for one text, by what it is."""
    return {f"a part of the terms ({name})": text for name, text in notes.definitions.items()}


def check_known(owner: str, texts: dict[str, str], known: set[str], hint: str = "") -> None:
    """Throws Error where a text names what is not known."""
    for where, text in texts.items():
        for name in _notation.names_in(text):
            if name not in known:
                raise Error(f"{owner}: {where}: '{name}' is not known; expected one of {', '.join(sorted(known))}{hint}")


def _where(equations: dict[str, Any], definitions: dict[str, Any]) -> list[str]:
    return [f"definitions: {each}" if each in definitions else f"rates: {each[:-1]}" if each.endswith("'") else f"measured: {each}"
            for each in equations]


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
