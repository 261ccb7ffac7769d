"""A term of a controller's problem, limits and costs, that is written in Python."""
from __future__ import annotations

import json
import pathlib
import re
from typing import Any

from . import _compile, _notation, _rhec
from ._errors import Error
from ._model import by_name, texts_of
from ._types import File

# What a formula may name of every vehicle, and how a TermWriter says it.
_ROLES = {name: f"writer.{name}()" for name in ("position_x", "position_y", "heading", "wheel_speed", "ground_speed", "heading_rate")}
# What is known of a node, in formulas and in bounds.
_PLACE = {"path_x": "place.x", "path_y": "place.y", "path_heading": "place.heading", "path_speed": "place.speed",
          "arc_length": "place.arc_length", "time": "place.time", "room_left": "place.left", "room_right": "place.right"}
_FUNCTIONS = ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "tanh", "pow", "hypot", "fabs", "fmax",
              "fmin")
_SMOOTH = ("smooth_abs", "smooth_max", "smooth_min")
_WORDS_OF_CPP = set("""alignas and asm auto bool break case catch char class const continue data default delete do double else enum
explicit export extern false float for friend goto if inline int long lower namespace new not operator options or place private
protected public register return rhec short signed sizeof static std struct switch template this throw true try typedef typename
union unsigned upper using virtual void volatile while writer xor""".split())
_IDENTIFIER = re.compile(r"(?<![\w.:])[A-Za-z_]\w*")
_INFINITE = "rhec::infinity"

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
    """

    def __init__(self, name: str, *, limits: Any = None, costs: Any = None, states: Any = None, inputs: Any = None,
                 options: Any = None, meaning: str = "", smooth: float | None = None) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise Error(f"name: found '{name}', expected a word of small letters, digits and underscores")
        self.name, self._meaning = name, meaning
        self._states, self._inputs = list(by_name(states, "states")), list(by_name(inputs, "inputs"))
        self._options = {key: value if isinstance(value, dict) else {"default": value}
                         for key, value in by_name(options, "options").items()}
        self._check_names()
        self._limits, self._costs = by_name(limits, "limits"), by_name(costs, "costs")
        if not self._limits and not self._costs:
            raise Error(f"the term '{name}' has neither limits nor costs")
        self.source = self._written(smooth)

    def _check_names(self) -> None:
        names = [*self._states, *self._inputs, *self._options]
        for each in names:
            if each in _WORDS_OF_CPP or each in _ROLES or each in _PLACE or names.count(each) > 1:
                raise Error(f"the name '{each}' is taken; rename it")
        for key, about in self._options.items():
            for word in about:
                if word not in ("default", "unit", "meaning", "above", "at_least"):
                    raise Error(f"options: {key}: '{word}' is not known; expected default, unit, meaning, above, at_least")
            if not isinstance(about.get("default"), (int, float)):
                raise Error(f"options: {key}: expected a number as its default")

    def _written(self, smooth: float | None) -> str:
        formulas, bounds, weights = [], [], []
        for key, limit in self._limits.items():
            if not isinstance(limit, (tuple, list)) or len(limit) != 3:
                raise Error(f"limits: {key}: expected (lower, term, upper)")
            formulas.append(limit[1])
            bounds += [limit[0], limit[2]]
        for key, cost in self._costs.items():
            about = cost if isinstance(cost, dict) else {"term": cost}
            if "term" not in about:
                raise Error(f"costs: {key}: 'term' is missing")
            formulas.append(about["term"])
            weights.append((about.get("weight", 1), about.get("delta")))
        known = [*self._states, *self._inputs, *self._options]
        notes = _notation.Notes([*known, *_ROLES, *_PLACE], smooth, _notation.Cpp())
        texts = texts_of(formulas, notes)
        flat = [each for pair in weights for each in pair]
        numbers = self._numbers([*bounds, *flat])
        of_limits, of_costs = numbers[:len(bounds)], numbers[len(bounds):]
        formula = self._formula(texts, notes, list(zip(of_costs[::2], of_costs[1::2])))
        return self._fill(formula, self._data(texts, notes, of_limits))

    def _numbers(self, terms: list[Any]) -> list[str]:
        """Terms that are numbers at a node: bounds, weights."""
        given = [term for term in terms if term is not None]
        notes = _notation.Notes([*self._options, *_PLACE], None, _notation.CppNumbers())
        read = iter(texts_of(given, notes))
        return [_INFINITE if term is None else next(read) for term in terms]

    # C++, line by line.

    def _used(self, texts: list[str]) -> list[str]:
        used = {name for text in texts for name in _IDENTIFIER.findall(text)}
        known = {*self._states, *self._inputs, *self._options, *_ROLES, *_PLACE}
        unknown = sorted(name for name in used - known - {*_FUNCTIONS, *_SMOOTH, "std", "rhec"} if not re.fullmatch(r"part\d+", name))
        if unknown:
            raise Error(f"the term '{self.name}': '{unknown[0]}' is not known; expected one of {', '.join(sorted(known))}; name states "
                        "and inputs by states= and inputs=")
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
        lines = [f"    using std::{name};\n" for name in _FUNCTIONS if name in used]
        return "".join(lines + [f"    using rhec::{name};\n" for name in _SMOOTH if name in used])

    def _formula(self, texts: list[str], notes: _notation.Notes, weights: list[tuple[str, str]]) -> str:
        parts = [text for _, text in notes.definitions.items()]
        all_texts = [*parts, *texts, *(text for pair in weights for text in pair if text != _INFINITE)]
        used = self._used(all_texts)
        if any(name.startswith("room_") for name in used):
            raise Error(f"the term '{self.name}': room_left and room_right may be infinite; expected them in bounds alone")
        lines = [self._functions(all_texts), *(self._declared(name, True) for name in used)]
        lines += [f"    const rhec::Expression {name} = {text};\n" for name, text in notes.definitions.items()]
        for key, text in zip(self._limits, texts):
            lines.append(f'    writer.limit({text}, options_.softness(), "{key}");\n')
        for key, text, (weight, delta) in zip(self._costs, texts[len(self._limits):], weights):
            lines.append(f'    writer.residual({text}, {{.weight = {weight}, .delta = {delta}}}, "{key}");\n')
        return "".join(lines)

    def _data(self, texts: list[str], notes: _notation.Notes, bounds: list[str]) -> str:
        of_formula = [name for name in self._used([*notes.definitions.values(), *texts]) if name in _PLACE]
        finite = [text for text in bounds if text != _INFINITE]
        used = self._used(finite)
        wrong = [name for name in used if name not in _PLACE and name not in self._options]
        if wrong:
            raise Error(f"the term '{self.name}': a bound or a weight depends on '{wrong[0]}'; expected options and what is known of a "
                        "node; put the rest into the limit's term")
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
            rows += f"\n        .number(\"{name}\", &TermOptions::{name}, {json.dumps(meaning)}{limit})"
        filled = {"NAME": self.name, "MEMBERS": members, "ROWS": rows, "FORMULA": formula, "DATA": data,
                  "MEANING": json.dumps(self._meaning or f"limits and costs: {', '.join([*self._limits, *self._costs])}")}
        return re.sub(r"@([A-Z]+)@", lambda found: filled[found[1]], _SOURCE)

    def build(self, folder: File | None = None) -> BuiltTerm:
        """Compiles it as a plugin against the rhec that this package belongs to. Returns a BuiltTerm, for
        configurations: {"controller": {"terms": [built]}}.

        folder: of the sources; without one a folder of the user's cache, where it is found again the next time
        """
        place = _compile.folder_of(folder, self.name, self.source)
        _compile.write(place / f"{self.name}.cpp", self.source)
        _compile.write(place / "CMakeLists.txt", _CMAKE.replace("@NAME@", self.name))
        _compile.compile_in(place, [])
        found = [each for each in _rhec.plugins([str(place / "build")]) if each["path"] == str(place.resolve() / "build" / f"{self.name}.so")
                 or each["path"] == str(place / "build" / f"{self.name}.so")]
        for each in found:
            if each["refusal"]:
                raise Error(f"{each['path']}: {each['refusal']}")
        return BuiltTerm(self.name, place, {})

    def __repr__(self) -> str:
        return f"<term '{self.name}': {', '.join([*self._limits, *self._costs])}>"


class BuiltTerm:
    """A term that was compiled, for configurations: {"controller": {"terms": [built]}}; folder: its sources."""

    def __init__(self, plugin: str, folder: pathlib.Path, options: dict[str, Any]) -> None:
        self.plugin, self.folder, self._options = plugin, folder, options
        self._plugin_path = [str(folder.absolute() / "build")]

    def _section(self) -> dict[str, Any]:
        return {"name": self.plugin, **self._options}

    def with_options(self, **options: Any) -> BuiltTerm:
        """The same with other values of its options; `hard` and `soft` are options of every term with limits."""
        return BuiltTerm(self.plugin, self.folder, {**self._options, **options})

    def __repr__(self) -> str:
        return f"<term '{self.plugin}', compiled in {self.folder}>"
