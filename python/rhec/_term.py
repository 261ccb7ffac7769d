"""A term of a controller's problem, limits and costs, that is written in Python."""
from __future__ import annotations

import functools
import json
import math
import numbers
import pathlib
import re
from typing import Any

from . import _compile, _configuration, _notation, _rhec
from ._arguments import checked, found_in_words
from ._check import Check
from ._errors import Error
from ._model import by_name, check_known, labelled_texts, parts_of
from ._types import File, Terms

# What a formula may name of every vehicle, and how a TermWriter says it.
_ROLES = {name: f"writer.{name}()" for name in ("position_x", "position_y", "heading", "wheel_speed", "ground_speed", "heading_rate")}
# What is known of a node, in formulas and in bounds.
_PLACE = {"path_x": "place.x", "path_y": "place.y", "path_heading": "place.heading", "path_speed": "place.speed",
          "arc_length": "place.arc_length", "time": "place.time", "room_left": "place.left", "room_right": "place.right"}
_CPP_FUNCTIONS = ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "tanh", "pow", "hypot", "fabs", "fmax",
              "fmin")
_SMOOTH = ("smooth_abs", "smooth_max", "smooth_min")
# What a name cannot be in C++: its words, macros of its library, and what the source below has already.
_WORDS_OF_CPP = set("""alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t char32_t class
co_await co_return co_yield compl concept const const_cast consteval constexpr constinit continue decltype default delete do double
dynamic_cast else enum explicit export extern false final float for friend goto if import inline int long module mutable namespace
new noexcept not not_eq nullptr operator or or_eq override private protected public register reinterpret_cast requires return short
signed sizeof static static_assert static_cast struct switch template this thread_local throw true try typedef typeid typename union
unsigned using virtual void volatile wchar_t while xor xor_eq
assert errno linux unix EOF EDOM ERANGE EILSEQ HUGE_VAL HUGE_VALF HUGE_VALL INFINITY NAN NULL""".split())
_WORDS_OF_SOURCE = set("data infinity lower options place pi rhec std table upper writer write write_data Made TermOptions".split())
# What the notation of equations has, and of numbers that may have corners.
_WORDS = (*_notation.FUNCTIONS, "pi")
_CORNERS = ("abs", "min", "max", "where", "infinity")
_IDENTIFIER = re.compile(r"(?<![\w.:])[A-Za-z_]\w*")
_INFINITE = "rhec::infinity"

def _literal(text: str) -> str:
    """A literal of C++."""
    return json.dumps(text, ensure_ascii=False)


def _without_none(given: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in given.items() if value is not None}


def _shape(value: Any) -> str:
    return f"{len(value)} of them" if isinstance(value, (tuple, list)) else found_in_words(value)


_SOURCE = """\
// The term '@NAME@', written from Python's terms.
#include <cmath>
#include <numbers>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/formula/expression.hpp"
#include "rhec/core/formula/smooth.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_options.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace {

struct TermOptions : rhec::LimitOptions {
@MEMBERS@
  static const rhec::OptionTable<TermOptions>& table() {
    static const auto options = rhec::with_limit_options(rhec::OptionTable<TermOptions>()@ROWS@);
    return options;
  }
};

class Made final : public rhec::Term {
 public:
  using Options = TermOptions;
  explicit Made(const Options& options) : options_(options) {}

  void write(rhec::TermWriter& writer) const override {
@FORMULA@  }
  void write_data([[maybe_unused]] const rhec::TermPlace& place, [[maybe_unused]] double* data, [[maybe_unused]] double* lower,
                  [[maybe_unused]] double* upper) const noexcept override {
@DATA@  }

 private:
  Options options_;
};

}  // namespace

RHEC_PLUGIN(rhec::PluginKind::term, Made,
            {.name = "@NAME@", .version = "1.0.0", .licence = "", .capabilities = @MEANING@});
"""
_CMAKE = """\
cmake_minimum_required(VERSION 3.25)
project(@NAME@ LANGUAGES CXX)
find_package(rhec REQUIRED)
rhec_add_plugin(@NAME@ SOURCES @NAME@.cpp)
install(TARGETS @NAME@ LIBRARY DESTINATION "${rhec_PLUGIN_DIRECTORY}")
"""


@checked
class Term:
    """Limits lower <= g <= upper and costs weight r^2 at the nodes of a controller's plan (docs/terms.md).

    name: a word of small letters
    limits: by name (lower, g, upper); None for no bound. Bounds are terms of options and of what is known of a node
    costs: by name r, or a dict of "term", "weight" and "delta", from which on it grows linearly
    states, inputs: names or symbols of the vehicle's that g and r use
    options: numbers that a configuration may set, {"most": {"default": 3, "unit": "m/s^2", "above": 0, "meaning": ...}}
    smooth: as of a Model

    In g and r every vehicle has position_x, position_y, heading, wheel_speed, ground_speed and heading_rate. Of a node
    path_x, path_y, path_heading, path_speed, arc_length, time, and in bounds also room_left and room_right, are known.
    All are terms of sympy or CasADi, numbers, or texts in the notation of equations; bounds may have abs, max, min and
    Piecewise. In a configuration {"controller": {"terms": [term]}} takes it without a compiler.
    """

    _plugin_path: list[str] = []
    _is_term = True

    def __init__(self, name: str, *, limits: Terms | None = None, costs: Terms | None = None,
                 states: Terms | None = None, inputs: Terms | None = None,
                 options: Terms | None = None, meaning: str = "", smooth: float | None = None) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise Error(f"name: found '{name}', expected a word of small letters, digits and underscores")
        self.name, self._meaning = name, meaning
        self._states, self._inputs = list(self._by_name(states, "states")), list(self._by_name(inputs, "inputs"))
        self._options = {key: value if isinstance(value, dict) else {"default": value}
                         for key, value in self._by_name(options, "options").items()}
        self._limits, self._costs = self._by_name(limits, "limits"), self._by_name(costs, "costs")
        self._given: dict[str, Any] = {}
        if not self._limits and not self._costs:
            raise Error(f"the term '{name}' has neither limits nor costs")
        self._check_names()
        self._check_options()
        formulas, bounds, weights = self._rows()
        self._equations = self._as_equations(formulas, bounds, weights, smooth)
        self.load()
        self.source = self._as_cpp(formulas, bounds, weights, smooth)

    def _by_name(self, given: Any, what: str) -> dict[str, Any]:
        try:
            return by_name(given, what)
        except Error as mistake:
            raise type(mistake)(f"the term '{self.name}': {mistake}") from None

    def _wrong(self, where: str, what: str) -> Error:
        return Error(f"the term '{self.name}': {where}: {what}")

    def _check_names(self) -> None:
        names = [*self._states, *self._inputs, *self._options]
        of_all = {*_ROLES, *_PLACE}
        for each in names:
            if not re.fullmatch(r"[A-Za-z_]\w*", each, re.ASCII):
                raise self._wrong(f"the name '{each}'", "expected letters, digits and underscores, with no digit first; rename it")
            if names.count(each) > 1:
                raise self._wrong("a name", f"'{each}' is there twice, among states, inputs and options; rename one of them")
            if each in of_all:
                raise self._wrong("a name", f"'{each}' is taken: every vehicle or every node has it; rename it, or leave it out")
            if each in _WORDS_OF_CPP or each.startswith("_") or "__" in each:
                raise self._wrong("a name", f"'{each}' is taken: C++, into which `build` writes it, keeps it for itself; rename it")
            if each in _WORDS_OF_SOURCE or each in (*_CPP_FUNCTIONS, *_WORDS, *_CORNERS):
                raise self._wrong("a name", f"'{each}' is taken by a function or a constant of the notation, or of the source; rename it")
        for each in self._options:
            if each in ("name", "equations", "hard", "soft", "softness"):
                raise self._wrong(f"options: {each}", "is a key of every term; rename it")
        for row in (*self._limits, *self._costs):
            if row in self._limits and row in self._costs:
                raise self._wrong(f"costs: {row}", "there is a limit of that name; rename one of them")
            if not row or not row.isprintable():
                raise self._wrong(f"the name {row!r}", "expected a text that can be printed")

    def _check_options(self) -> None:
        for key, about in self._options.items():
            for word in about:
                if word not in ("default", "unit", "meaning", "above", "at_least"):
                    raise self._wrong(f"options: {key}", f"'{word}' is not known; expected default, unit, meaning, above, at_least")
            for word in ("default", "above", "at_least"):
                value = about.get(word)
                if word == "default" or word in about:
                    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value):
                        raise self._wrong(f"options: {key}: {word}", f"found {found_in_words(value)}, expected a number"
                                          + (" as its default" if word == "default" else ""))
            for word in ("unit", "meaning"):
                if not isinstance(about.get(word, ""), str):
                    raise self._wrong(f"options: {key}: {word}", f"found {found_in_words(about[word])}, expected a text")
            if "above" in about and "at_least" in about:
                raise self._wrong(f"options: {key}", "found 'above' and 'at_least'; expected one of them")

    def _rows(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        """Formulas, bounds and weights, by where they stand."""
        formulas, bounds, weights = {}, {}, {}
        for key, limit in self._limits.items():
            if not isinstance(limit, (tuple, list)) or len(limit) != 3:
                raise self._wrong(f"limits: {key}", f"found {_shape(limit)}, expected (lower, term, upper)")
            formulas[f"limits: {key}"] = limit[1]
            bounds[f"limits: {key}: lower"], bounds[f"limits: {key}: upper"] = limit[0], limit[2]
            if limit[0] is None and limit[2] is None:
                raise self._wrong(f"limits: {key}", "it has no bound; expected one beside None, or leave it out")
        for key, cost in self._costs.items():
            about = cost if isinstance(cost, dict) else {"term": cost}
            for word in about:
                if word not in ("term", "weight", "delta"):
                    raise self._wrong(f"costs: {key}", f"{word!r} is not known; expected term, weight, delta")
            if "term" not in about:
                raise self._wrong(f"costs: {key}", "'term' is missing")
            formulas[f"costs: {key}"] = about["term"]
            weights[f"costs: {key}: weight"], weights[f"costs: {key}: delta"] = about.get("weight", 1), about.get("delta")
        return formulas, bounds, weights

    def _texts(self, terms: dict[str, Any], notes: _notation.Notes) -> list[str]:
        """Texts of terms in a style; what is wrong with one of them says where it stands."""
        return labelled_texts(f"the term '{self.name}'", terms, notes, writes_texts=True)

    def _numbers(self, terms: dict[str, Any], style: _notation.Equations) -> list[str | None]:
        """Terms that are numbers at a node: bounds, weights."""
        given = {where: term for where, term in terms.items() if term is not None}
        notes = _notation.Notes([*self._options, *_PLACE], None, style)
        texts = dict(zip(given, self._texts(given, notes)))
        return [texts.get(where) for where in terms]

    def _as_cpp(self, formulas: dict[str, Any], bounds: dict[str, Any], weights: dict[str, Any], smooth: float | None) -> str:
        notes = self._notes(smooth, _notation.Cpp(self._options))
        texts = self._texts(formulas, notes)
        of_limits, of_costs = ([text or _INFINITE for text in self._numbers(terms, _notation.CppNumbers())] for terms in (bounds, weights))
        formula = self._formula(texts, notes, list(zip(of_costs[::2], of_costs[1::2])))
        return self._fill(formula, self._data(texts, notes, of_limits))

    def _as_equations(self, formulas: dict[str, Any], bounds: dict[str, Any], weights: dict[str, Any],
                      smooth: float | None) -> dict[str, Any]:
        """What a configuration has for it under `equations`."""
        notes = self._notes(smooth, _notation.Equations())
        texts = dict(zip(formulas, self._texts(formulas, notes)))
        of_limits = dict(zip(bounds, self._numbers(bounds, _notation.EquationNumbers())))
        of_costs = dict(zip(weights, self._numbers(weights, _notation.EquationNumbers())))
        self._check_known(texts, notes)
        self._check_numbers({**of_limits, **of_costs})
        made: dict[str, Any] = {"name": self.name}
        for key, names in (("states", self._states), ("inputs", self._inputs)):
            if names:
                made[key] = names
        if self._options:
            made["options"] = {name: dict(about) for name, about in self._options.items()}
        if self._meaning:
            made["meaning"] = self._meaning
        if notes.definitions:
            made["definitions"] = dict(notes.definitions)
        if self._limits:
            made["limits"] = {key: _without_none({"lower": of_limits[f"limits: {key}: lower"], "term": texts[f"limits: {key}"],
                                                  "upper": of_limits[f"limits: {key}: upper"]}) for key in self._limits}
        if self._costs:
            made["costs"] = {key: _without_none({"term": texts[f"costs: {key}"], "weight": of_costs[f"costs: {key}: weight"],
                                                 "delta": of_costs[f"costs: {key}: delta"]}) for key in self._costs}
        return made

    def _notes(self, smooth: float | None, style: _notation.Equations) -> _notation.Notes:
        return _notation.Notes([*self._states, *self._inputs, *self._options, *_ROLES, *_PLACE], smooth, style)

    def _check_known(self, texts: dict[str, str], notes: _notation.Notes) -> None:
        """Names in formulas, also in parts of them."""
        owner, rooms = f"the term '{self.name}'", {"room_left", "room_right"}
        known = {*self._states, *self._inputs, *self._options, *_ROLES, *_PLACE, *notes.definitions}
        all_texts = {**texts, **parts_of(notes)}
        for where, text in all_texts.items():
            if rooms & {*_notation.names_in(text)}:
                raise self._wrong(where, "room_left and room_right may be infinite; expected them in bounds alone")
        check_known(owner, all_texts, known - rooms, "; name states and inputs by states= and inputs=")

    def _check_numbers(self, texts: dict[str, str | None]) -> None:
        for where, text in texts.items():
            is_weight = where.startswith("costs")
            for name in _notation.names_in(text or ""):
                if name in self._options or name in _CORNERS or name in _PLACE and not is_weight:
                    continue
                raise self._wrong(where, f"a bound or a weight depends on '{name}'; expected options"
                                  + ("" if is_weight else " and what is known of a node; put the rest into the limit's term"))

    # C++, line by line.

    def _used(self, texts: list[str]) -> list[str]:
        used = {name for text in texts for name in _IDENTIFIER.findall(text)}
        return [name for name in [*self._states, *self._inputs, *self._options, *_ROLES, *_PLACE] if name in used]

    def _declared(self, name: str, is_formula: bool) -> str:
        if name in self._options:
            return f"    const double {name} = options_.{name};\n"
        if not is_formula:
            return f"    const double {name} = {_PLACE[name]};\n"
        by_role = _ROLES.get(name) or (f'writer.state("{name}")' if name in self._states else f'writer.input("{name}")')
        value = f'writer.data("{name}")' if name in _PLACE else by_role
        return f"    const rhec::Expression {name} = {value};\n"

    def _functions(self, texts: list[str]) -> str:
        used = {name for text in texts for name in _IDENTIFIER.findall(text)}
        lines = [f"    using std::{name};\n" for name in _CPP_FUNCTIONS if name in used]
        return "".join(lines + [f"    using rhec::{name};\n" for name in _SMOOTH if name in used])

    def _formula(self, texts: list[str], notes: _notation.Notes, weights: list[tuple[str, str]]) -> str:
        parts = [text for _, text in notes.definitions.items()]
        all_texts = [*parts, *texts, *(text for pair in weights for text in pair if text != _INFINITE)]
        used = self._used(all_texts)
        lines = [self._functions(all_texts), *(self._declared(name, True) for name in used)]
        lines += [f"    const rhec::Expression {name} = {text};\n" for name, text in notes.definitions.items()]
        for key, text in zip(self._limits, texts):
            lines.append(f"    writer.limit({text}, options_.softness(), {_literal(key)});\n")
        for key, text, (weight, delta) in zip(self._costs, texts[len(self._limits):], weights):
            lines.append(f"    writer.residual({text}, {{.weight = {weight}, .delta = {delta}}}, {_literal(key)});\n")
        return "".join(lines)

    def _data(self, texts: list[str], notes: _notation.Notes, bounds: list[str]) -> str:
        of_formula = [name for name in self._used([*notes.definitions.values(), *texts]) if name in _PLACE]
        finite = [text for text in bounds if text != _INFINITE]
        used = self._used(finite)
        lines = [self._functions(finite), *(self._declared(name, False) for name in used)]
        lines += [f"    data[{i}] = {_PLACE[name]};\n" for i, name in enumerate(of_formula)]
        for i, (lower, upper) in enumerate(zip(bounds[::2], bounds[1::2])):
            lines.append(f"    lower[{i}] = {'-' + _INFINITE if lower == _INFINITE else lower};\n    upper[{i}] = {upper};\n")
        return "".join(lines)

    def _fill(self, formula: str, data: str) -> str:
        number = _notation.Cpp().number
        members = "".join(f"  double {name} = {number(about['default']).text};\n" for name, about in self._options.items())
        rows = ""
        for name, about in self._options.items():
            meaning = f"{about.get('meaning', name)} [{about.get('unit', '1')}]"
            limit = "".join(f", rhec::{function}({number(about[word]).text})" for word, function in
                            (("above", "greater_than"), ("at_least", "at_least")) if word in about)
            rows += f"\n        .number(\"{name}\", &TermOptions::{name}, {_literal(meaning)}{limit})"
        filled = {"NAME": self.name, "MEMBERS": members, "ROWS": rows, "FORMULA": formula, "DATA": data,
                  "MEANING": _literal(self._meaning or f"limits and costs: {', '.join([*self._limits, *self._costs])}")}
        return re.sub(r"@([A-Z]+)@", lambda found: filled[found[1]], _SOURCE)

    def with_options(self, **options: Any) -> Term:
        """The same with other values of its options; `hard` and `soft` are options of every term with limits."""
        made = object.__new__(type(self))
        made.__dict__ = {**self.__dict__, "_given": {**self._given, **options}}
        return made

    def _section(self) -> dict[str, Any]:
        """What a configuration has for it among `controller.terms`."""
        return {"equations": self._equations, **self._given}

    def yaml(self) -> str:
        """The same as a text, an item of `controller.terms` (docs/terms.md)."""
        return json.dumps(self._section(), indent=2) + "\n"

    def load(self, vehicle: _rhec.Vehicle | None = None) -> Term:
        """Reads it as a configuration does, at once and without a compiler, for a vehicle if there is one: whether that has
        the states and inputs that it names. Returns itself, for {"controller": {"terms": [term]}}."""
        _rhec.check_term(_rhec.Settings.of(_configuration.plain(self._section(), []), f"the term '{self.name}'"), vehicle)
        return self

    def check(self, vehicle: Any = None) -> Check:
        """What `rhec check` says of it (docs/check.md), on a Vehicle or a Model; without one on all model plugins that are
        found."""
        return Check.of(self, vehicle)

    def build(self, folder: File | None = None, *, vehicle: Any = None) -> BuiltTerm:
        """Checks it, compiles it as a plugin against the rhec that this package belongs to, and loads that. Returns a
        BuiltTerm, for configurations: {"controller": {"terms": [built]}}.

        folder: of the sources; without one a folder of the user's cache, where it is found again the next time
        vehicle: on which it is checked, as of `check`
        """
        self.load()
        _compile.check_name(self.name)
        check = self.check(vehicle)  # before it is compiled, which takes longer
        if check.failed:
            raise Error(f"the term '{self.name}': its check failed: {check.failures()}")
        place = _compile.folder_of(folder, self.name, self.source)
        _compile.write(place / f"{self.name}.cpp", self.source)
        _compile.write(place / "CMakeLists.txt", _CMAKE.replace("@NAME@", self.name))
        _compile.compile_in(place, [])
        library = place.resolve() / "build" / f"{self.name}.so"
        found = [each for each in _rhec.plugins([str(library.parent)]) if pathlib.Path(each["path"]).resolve() == library]
        if not found or found[0]["refusal"]:
            raise Error(f"{library}: {found[0]['refusal'] if found else 'is not there after the build; expected a plugin'}")
        _rhec.plugin_options([str(library.parent)], self.name, "term")  # loads it
        return BuiltTerm(self.name, place, self._given)

    def __repr__(self) -> str:
        return f"<term '{self.name}': {', '.join([*self._limits, *self._costs])}>"


@checked
class BuiltTerm:
    """A term that was compiled, for configurations: {"controller": {"terms": [built]}}.

    folder: its sources; check: what `rhec check` says of what was compiled, when it is first asked for
    """

    _is_term = True

    def __init__(self, plugin: str, folder: pathlib.Path, options: dict[str, Any]) -> None:
        self.plugin, self.folder, self._options = plugin, folder, options
        self._plugin_path = [str(folder.absolute() / "build")]

    @functools.cached_property
    def check(self) -> Check:
        return Check.of(self)

    def _section(self) -> dict[str, Any]:
        return {"name": self.plugin, **self._options}

    def with_options(self, **options: Any) -> BuiltTerm:
        """The same with other values of its options; `hard` and `soft` are options of every term with limits."""
        return BuiltTerm(self.plugin, self.folder, {**self._options, **options})

    def __repr__(self) -> str:
        return f"<term '{self.plugin}', compiled in {self.folder}>"
