"""Terms of sympy and CasADi in the notation of vehicles' equations (docs/equations.md), or as C++."""
from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable
from typing import Any

from ._arguments import checked, found_in_words
from ._errors import ArgumentError, Error

# How tightly a text binds: a sum, a product, a sign, a power, an atom.
_SUM, _PRODUCT, _SIGNED, _POWER, _ATOM = range(1, 6)
# A term may be 100 levels deep; deeper ones are divided.
_DEEPEST = 40
# Beyond so many operations common parts become definitions of their own.
_MANY = 2000
# By how many arguments they have.
FUNCTIONS = {"sqrt": 1, "exp": 1, "log": 1, "sin": 1, "cos": 1, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "tanh": 1,
                     "atan2": 2, "hypot": 2, "smooth_abs": 2, "smooth_min": 3, "smooth_max": 3}
_MOST_LEVELS = 100
_IDENTIFIER = re.compile(r"(?<![\w.:])[A-Za-z_]\w*")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_SMOOTH = ("has no derivative everywhere; write rhec.smooth_abs, rhec.smooth_max or rhec.smooth_min of a width, or give "
           "smooth=WIDTH, a little below what matters")


def _of_numbers(title: str, compute: Callable[[], Any], *given: Any) -> Any:
    try:
        return compute()
    except TypeError:
        raise ArgumentError(f"{title}: found {', '.join(map(found_in_words, given))}, expected numbers, or terms of sympy or CasADi") from None


@checked
def smooth_abs(x: Any, width: float) -> Any:
    """sqrt(x^2 + width^2): |x| with a derivative everywhere; of numbers, sympy's and CasADi's terms."""
    return _of_numbers("smooth_abs", lambda: (x * x + width * width) ** 0.5, x, width)


@checked
def smooth_max(a: Any, b: Any, width: float) -> Any:
    """The larger of a and b, rounded off where they differ by about `width`."""
    return _of_numbers("smooth_max", lambda: (a + b + smooth_abs(a - b, width)) / 2, a, b, width)


@checked
def smooth_min(a: Any, b: Any, width: float) -> Any:
    """The smaller of a and b, likewise."""
    return _of_numbers("smooth_min", lambda: (a + b - smooth_abs(a - b, width)) / 2, a, b, width)


@dataclasses.dataclass(frozen=True)
class Text:
    """A term as it is written, how tightly it binds, and how deep it is."""

    text: str
    level: int = _ATOM
    depth: int = 1

    def within(self, level):
        return self.text if self.level >= level else f"({self.text})"


def _joined(pattern, level, *parts):
    """`parts` are pairs of a Text and the level that its place needs."""
    return Text(pattern.format(*(part.within(needed) for part, needed in parts)), level,
                1 + max((part.depth for part, _ in parts), default=0))


def add(a, b):
    if b.text.startswith("-") and b.level >= _SIGNED:
        return _joined("{} - {}", _SUM, (a, _SUM), (Text(b.text[1:], b.level, b.depth), _PRODUCT))
    return _joined("{} + {}", _SUM, (a, _SUM), (b, _PRODUCT))


def subtract(a, b):
    return _joined("{} - {}", _SUM, (a, _SUM), (b, _PRODUCT))


def multiply(a, b):
    return _joined("{} * {}", _PRODUCT, (a, _PRODUCT), (b, _SIGNED))


def divide(a, b):
    return _joined("{} / {}", _PRODUCT, (a, _PRODUCT), (b, _SIGNED))


def negate(a):
    return _joined("-{}", _SIGNED, (a, _POWER))


def call(function, *arguments):
    return Text(f"{function}({', '.join(argument.text for argument in arguments)})", _ATOM,
                1 + max(argument.depth for argument in arguments))


class Equations:
    """How equations write what is not alike everywhere."""

    pi = "pi"
    has_corners = False
    # Of styles with corners.
    corners = {"Abs": "abs", "Max": "max", "Min": "min"}

    def number(self, value):
        value = float(value)
        if not math.isfinite(value):
            raise Error(f"a number that is not finite in an equation: {value}; expected finite ones")
        return Text(self._digits(value), _SIGNED if value < 0 else _ATOM)

    def _digits(self, value):
        return repr(value).removesuffix(".0")

    def power(self, a, b):
        return _joined("{}^{}", _POWER, (a, _ATOM), (b, _POWER))

    def call(self, function, *arguments):
        return call(function, *arguments)

    def choice(self, a, sign, b, value, otherwise):
        """`value` where a and b compare as the sign says."""
        if sign in ("==", "!="):
            off = call("abs", subtract(a, b))
            return call("where", off, otherwise, value) if sign == "==" else call("where", off, value, otherwise)
        above = subtract(a, b) if sign in (">", "<=") else subtract(b, a)
        return call("where", above, value, otherwise) if sign in ("<", ">") else call("where", above, otherwise, value)


class EquationNumbers(Equations):
    """Numbers that nobody differentiates: they may have corners, and be infinite."""

    has_corners = True

    def number(self, value):
        if math.isinf(float(value)):
            return Text("infinity" if value > 0 else "-infinity", _ATOM if value > 0 else _SIGNED)
        return super().number(value)


class Cpp(Equations):
    """How C++ does, for double and rhec::Expression alike."""

    pi = "std::numbers::pi"

    def __init__(self, numbers=()):
        """`numbers`: names that stand for a double in a formula; functions of several arguments need one type."""
        self._numbers = {*numbers, *FUNCTIONS, "pow", "std", "numbers", "pi"}

    def call(self, function, *arguments):
        if len(arguments) > 1:
            arguments = [each if set(_NAME.findall(each.text)) - self._numbers else Text(f"rhec::Expression({each.text})", _ATOM, each.depth)
                         for each in arguments]
        return call(function, *arguments)

    def _digits(self, value):
        return repr(value)  # 1.0, not 1: 1 / 2 is 0

    def power(self, a, b):
        if re.fullmatch(r"-?\d+\.0", b.text):
            return call("pow", a, Text(b.text[:-2], b.level))
        return call("exp", multiply(b, call("log", a)))


class CppNumbers(Cpp):
    """As EquationNumbers."""

    has_corners = True
    corners = {"Abs": "fabs", "Max": "fmax", "Min": "fmin"}

    def call(self, function, *arguments):
        return call(function, *arguments)

    def choice(self, a, sign, b, value, otherwise):
        return Text(f"({a.within(_SUM)} {sign} {b.within(_SUM)} ? {value.text} : {otherwise.text})", _ATOM,
                    1 + max(each.depth for each in (a, b, value, otherwise)))

    def number(self, value):
        if math.isinf(float(value)):
            return Text("rhec::infinity" if value > 0 else "-rhec::infinity", _ATOM if value > 0 else _SIGNED)
        return super().number(value)


class Notes:
    """Definitions that are made on the way, what is smoothed, and how terms are written."""

    def __init__(self, taken, smooth, style=None):
        if smooth is not None and not 0 < smooth < math.inf:
            raise Error(f"smooth: found {smooth}, expected a width greater than 0")
        self.definitions, self.taken, self.smooth = {}, set(taken), smooth
        self.style = style or Equations()

    def name(self, text):
        if not _NAME.fullmatch(text):
            raise Error(f"the name '{text}': expected letters, digits and underscores, with no digit first; rename the symbol")
        return Text(text)

    def define(self, term):
        if self.style.has_corners:  # numbers have no definitions
            return term
        number_of = len(self.definitions) + 1
        while f"part{number_of}" in self.taken:
            number_of += 1
        name = f"part{number_of}"
        self.taken.add(name)
        self.definitions[name] = term.text
        return Text(name)

    def shallow(self, term):
        return self.define(term) if term.depth > _DEEPEST else term

    def width(self, what):
        if self.smooth is None:
            raise Error(f"{what} {_SMOOTH}")
        return self.style.number(self.smooth)

    def step(self, difference, what):
        """1 where `difference` is above 0, 0 below, and a slope of the width between."""
        slope = call("tanh", divide(difference, self.width(what)))
        return divide(add(self.style.number(1), slope), self.style.number(2))


class SympyReader:
    """Reads terms of sympy."""

    _FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "tanh", "exp", "log")

    def __init__(self, sympy, notes):
        self._sympy, self._notes, self._known = sympy, notes, {}
        self._number, self._raised = notes.style.number, notes.style.power

    def read_all(self, terms):
        """The texts of several terms."""
        terms = [self._term(term) for term in terms]
        if sum(term.count_ops() for term in terms) > _MANY:
            parts, terms = self._sympy.cse(terms, symbols=self._sympy.numbered_symbols("rhec_part"))
            for symbol, part in parts:
                self._known[symbol] = self._notes.define(self.read(part))
        return [self.read(term).text for term in terms]

    def _term(self, given):
        """A term, or a number; sympy itself would make terms of nearly anything by its text."""
        try:
            return self._sympy.sympify(given, strict=True)
        except self._sympy.SympifyError:
            raise Error(f"found an object of the class '{type(given).__name__}' as an equation, expected a term of sympy, a number or "
                        "a text") from None

    def read(self, term):
        if term not in self._known:
            self._known[term] = self._notes.shallow(self._read(term))
        return self._known[term]

    def _read(self, term):
        sympy = self._sympy
        if term.is_Symbol:
            return self._notes.name(term.name)
        if isinstance(term, sympy.core.function.AppliedUndef):  # x(t) of sympy.physics.mechanics
            return self._notes.name(term.func.__name__)
        if isinstance(term, sympy.Derivative) and isinstance(term.expr, sympy.core.function.AppliedUndef):
            return Text(self._notes.name(term.expr.func.__name__).text + "'")
        if term is sympy.pi:
            return Text(self._notes.style.pi)
        if term.is_Rational and not term.is_Integer:
            return divide(self._number(term.p), self._number(term.q))
        if term.is_number and not term.args:
            return self._number(self._finite(term))
        if term.is_Add:
            return self._sum(term)
        if term.is_Mul:
            return self._product(term)
        if term.is_Pow:
            return self._power(term)
        return self._function(term)

    def _finite(self, term):
        if self._notes.style.has_corners and term in (self._sympy.oo, -self._sympy.oo):
            return term
        if not term.is_finite or not term.is_real:
            raise Error(f"{term} in an equation: expected real, finite numbers")
        return term

    def _sum(self, term):
        first, *others = sorted(term.as_ordered_terms(), key=lambda part: part.could_extract_minus_sign())
        made = self.read(first)
        for other in others:
            made = subtract(made, self.read(-other)) if other.could_extract_minus_sign() else add(made, self.read(other))
            made = self._notes.shallow(made)
        return made

    def _product(self, term):
        if term.could_extract_minus_sign():
            return negate(self.read(-term))
        above, below = self._sympy.fraction(term, exact=True)
        if below != 1:
            return divide(self.read(above), self.read(below))
        made = None
        for factor in term.as_ordered_factors():
            each = self.read(factor)
            made = each if made is None else self._notes.shallow(multiply(made, each))
        return made

    def _power(self, term):
        base, exponent = term.base, term.exp
        if base is self._sympy.E:
            return call("exp", self.read(exponent))
        if exponent == self._sympy.Rational(1, 2) or exponent == 0.5:
            return call("sqrt", self.read(base))
        if exponent == -self._sympy.Rational(1, 2) or exponent == -0.5:
            return divide(self._number(1), call("sqrt", self.read(base)))
        if exponent == -1:
            return divide(self._number(1), self.read(base))
        return self._raised(self.read(base), self.read(exponent))

    def _function(self, term):
        sympy, name = self._sympy, type(term).__name__
        if self._notes.style.has_corners and isinstance(term, (sympy.Abs, sympy.Max, sympy.Min, sympy.Piecewise)):
            return self._corner(term)
        if name in self._FUNCTIONS and len(term.args) in (1, 2 if name == "atan2" else 1):
            return self._notes.style.call(name, *map(self.read, term.args))
        if isinstance(term, sympy.Abs):
            return self._notes.style.call("smooth_abs", self.read(term.args[0]), self._notes.width(f"{term}: abs"))
        if isinstance(term, (sympy.Max, sympy.Min)):
            function = "smooth_max" if isinstance(term, sympy.Max) else "smooth_min"
            made, *others = map(self.read, sorted(term.args, key=str))
            for other in others:
                made = self._notes.style.call(function, made, other, self._notes.width(f"{term}: {name.lower()}"))
            return made
        if isinstance(term, sympy.sign):
            return call("tanh", divide(self.read(term.args[0]), self._notes.width(f"{term}: sign")))
        if isinstance(term, sympy.Heaviside):
            return self._notes.step(self.read(term.args[0]), f"{term}: a step")
        if isinstance(term, sympy.Piecewise):
            return self._piecewise(term)
        if isinstance(term, (sympy.Derivative, sympy.Integral)):
            raise Error(f"{term}: not evaluated; write term.doit(), or simplify the equation until no {name} is left")
        plain = term.rewrite(sympy.exp if name in ("sinh", "cosh", "coth", "sech", "csch") else sympy.tan)
        if plain != term and not plain.has(type(term)):
            return self.read(plain)
        raise Error(f"{term}: equations do not have the function '{name}'; expected one of "
                    f"{', '.join(self._FUNCTIONS)}, sqrt, and powers (docs/equations.md)")

    def _corner(self, term):
        """Where only the value counts."""
        sympy = self._sympy
        if isinstance(term, sympy.Piecewise):
            made = self.read(self._otherwise(term))
            for value, condition in reversed(term.args[:-1]):
                made = self._chosen(condition, self.read(value), made)
            return made
        function = self._notes.style.corners[term.func.__name__]
        made, *others = map(self.read, sorted(term.args, key=str))
        if not others:
            return call(function, made)
        for other in others:
            made = call(function, made, other)
        return made

    def _chosen(self, condition, value, otherwise):
        sympy = self._sympy
        if isinstance(condition, sympy.core.relational.Relational):
            return self._notes.style.choice(self.read(condition.lhs), condition.rel_op, self.read(condition.rhs), value, otherwise)
        if isinstance(condition, sympy.And):
            for part in condition.args:
                value = self._chosen(part, value, otherwise)
            return value
        if isinstance(condition, sympy.Or):
            for part in condition.args:
                otherwise = self._chosen(part, value, otherwise)
            return otherwise
        raise Error(f"the condition {condition}: expected comparisons, 'and' and 'or' of them")

    def _otherwise(self, term):
        if term.args[-1][1] != True:  # noqa: E712  (sympy's own truth)
            raise Error(f"{term}: a value for all other cases is missing; end it with (value, True)")
        return term.args[-1][0]

    def _piecewise(self, term):
        made = self.read(self._otherwise(term))
        for value, condition in reversed(term.args[:-1]):
            share = self._condition(condition, f"{term}: Piecewise")
            made = add(multiply(share, self.read(value)), multiply(subtract(self._number(1), share), made))
        return made

    def _condition(self, condition, what):
        sympy = self._sympy
        if isinstance(condition, (sympy.StrictLessThan, sympy.LessThan)):
            return self._notes.step(self.read(condition.rhs - condition.lhs), what)
        if isinstance(condition, (sympy.StrictGreaterThan, sympy.GreaterThan)):
            return self._notes.step(self.read(condition.lhs - condition.rhs), what)
        if isinstance(condition, sympy.And):
            made, *others = [self._condition(part, what) for part in condition.args]
            for other in others:
                made = multiply(made, other)
            return made
        raise Error(f"{what}: the condition {condition} has no smooth form; expected inequalities, and 'and' of them")


class CasadiReader:
    """Reads CasADi's scalar terms (SX)."""

    def __init__(self, casadi, notes):
        self._casadi, self._notes = casadi, notes
        plain = {"SIN": "sin", "COS": "cos", "TAN": "tan", "ASIN": "asin", "ACOS": "acos", "ATAN": "atan", "TANH": "tanh",
                 "EXP": "exp", "LOG": "log", "SQRT": "sqrt", "ATAN2": "atan2", "HYPOT": "hypot"}
        number, power = notes.style.number, notes.style.power
        one, step, width = number(1), notes.step, notes.width
        rules = {
            "ASSIGN": lambda a: a,
            "ADD": add, "SUB": subtract, "MUL": multiply, "DIV": divide, "NEG": negate, "POW": power, "CONSTPOW": power,
            "SQ": lambda a: power(a, number(2)), "TWICE": lambda a: multiply(number(2), a), "INV": lambda a: divide(one, a),
            "SINH": lambda a: divide(subtract(call("exp", a), call("exp", negate(a))), number(2)),
            "COSH": lambda a: divide(add(call("exp", a), call("exp", negate(a))), number(2)),
            "EXPM1": lambda a: subtract(call("exp", a), one), "LOG1P": lambda a: call("log", add(one, a)),
            "FABS": lambda a: notes.style.call("smooth_abs", a, width("fabs")),
            "FMAX": lambda a, b: notes.style.call("smooth_max", a, b, width("fmax")),
            "FMIN": lambda a, b: notes.style.call("smooth_min", a, b, width("fmin")),
            "SIGN": lambda a: call("tanh", divide(a, width("sign"))),
            "LT": lambda a, b: step(subtract(b, a), "a comparison"), "LE": lambda a, b: step(subtract(b, a), "a comparison"),
            "NOT": lambda a: subtract(one, a), "AND": multiply,
            "OR": lambda a, b: subtract(add(a, b), multiply(a, b)), "IF_ELSE_ZERO": multiply,
        }
        if notes.style.has_corners:
            zero, corners, choice = number(0), notes.style.corners, notes.style.choice
            rules |= {
                "FABS": lambda a: call(corners["Abs"], a),
                "FMAX": lambda a, b: call(corners["Max"], a, b), "FMIN": lambda a, b: call(corners["Min"], a, b),
                "SIGN": lambda a: choice(a, ">", zero, one, choice(a, "<", zero, number(-1), zero)),
                "LT": lambda a, b: choice(a, "<", b, one, zero), "LE": lambda a, b: choice(a, "<=", b, one, zero),
                "EQ": lambda a, b: choice(a, "==", b, one, zero), "NE": lambda a, b: choice(a, "!=", b, one, zero),
                "IF_ELSE_ZERO": lambda a, b: choice(a, "!=", zero, b, zero),  # b may be infinite
            }
        rules |= {name: (lambda *a, function=function: notes.style.call(function, *a)) for name, function in plain.items()}
        self._rules = {getattr(casadi, f"OP_{name}"): rule for name, rule in rules.items() if hasattr(casadi, f"OP_{name}")}
        self._names = {getattr(casadi, name): name[3:].lower() for name in dir(casadi) if name.startswith("OP_")}

    def read_all(self, terms):
        """The texts of several terms."""
        casadi = self._casadi
        if any(isinstance(term, casadi.MX) for term in terms):
            raise Error("found CasADi's MX, whose terms are matrices; write the equations with SX, or of a Function f of MX take "
                        "f.expand() of SX symbols")
        terms = [casadi.SX(term) for term in terms]
        for term in terms:
            if term.shape != (1, 1):
                raise Error(f"an equation of the shape {term.shape}; expected one number for each state and output")
        symbols = casadi.symvar(casadi.vertcat(*terms))
        if not symbols:
            return [self._notes.style.number(term).text for term in terms]
        made = casadi.Function("equations", symbols, terms)
        uses = self._count(made)
        work, results = {}, [None] * len(terms)
        for k in range(made.n_instructions()):
            operation, inputs, outputs = made.instruction_id(k), made.instruction_input(k), made.instruction_output(k)
            if operation == casadi.OP_OUTPUT:
                results[outputs[0]] = work[inputs[0]].text
                continue
            term = self._term(made, k, operation, [work[i] for i in inputs] if operation != casadi.OP_INPUT else inputs, symbols)
            work[outputs[0]] = self._notes.define(term) if uses[k] > 1 and term.depth > 1 else self._notes.shallow(term)
        return [text if text is not None else self._notes.style.number(0).text for text in results]

    def _count(self, made):
        """How often the result of each instruction is used."""
        casadi = self._casadi
        uses, writer = [0] * made.n_instructions(), {}
        for k in range(made.n_instructions()):
            if made.instruction_id(k) not in (casadi.OP_INPUT, casadi.OP_CONST):
                for i in made.instruction_input(k):
                    uses[writer[i]] += 1
            if made.instruction_id(k) != casadi.OP_OUTPUT:
                writer[made.instruction_output(k)[0]] = k
        return uses

    def _term(self, made, k, operation, inputs, symbols):
        casadi = self._casadi
        if operation == casadi.OP_CONST:
            return self._notes.style.number(made.instruction_constant(k))
        if operation == casadi.OP_INPUT:
            return self._notes.name(symbols[inputs[0]].name())
        if operation not in self._rules:
            raise Error(f"equations do not have CasADi's operation '{self._names.get(operation, operation)}'; write it in others "
                        "(docs/equations.md)")
        return self._rules[operation](*inputs)


_TOKEN = re.compile(r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*'?)|(?P<sign>\*\*|\S))", re.ASCII)
_CORNERS_OF_TEXTS = {"abs": ("Abs", 1), "min": ("Min", 2), "max": ("Max", 2)}


def names_in(text: str) -> list[str]:
    """The names in a text of the notation, but functions and pi."""
    return [name for name in _IDENTIFIER.findall(text) if name not in FUNCTIONS and name != "pi"]


class TextReader:
    """Reads texts in the notation of equations (docs/equations.md), for other styles than that."""

    def __init__(self, notes):
        self._notes, self._text, self._tokens, self._at, self._levels = notes, "", [], 0, 0

    def read(self, text):
        """A text as a Text."""
        self._text, self._at, self._levels = text, 0, 0
        text = re.sub(r"#.*", "", text)  # a comment
        self._tokens = [(found.lastgroup, found[found.lastgroup]) for found in _TOKEN.finditer(text)] + [("end", "")]
        made = self._sum()
        if self._next() != ("end", ""):
            raise self._wrong("an operator + - * / ^ or the end")
        return made

    def _next(self):
        return self._tokens[self._at]

    def _take(self, *signs):
        """The next sign, if it is one of these."""
        kind, text = self._next()
        if kind != "sign" or text not in signs:
            return None
        self._at += 1
        return text

    def _wrong(self, expected):
        kind, text = self._next()
        found = "the end" if kind == "end" else f"'{text}'"
        advice = "; write a power as x^2" if text == "**" else "; a product is written with '*'" if kind in ("name", "number") else ""
        return Error(f"the text '{self._text}': found {found}, expected {expected}{advice}")

    def _sum(self):
        made = self._product()
        while sign := self._take("+", "-"):
            made = self._notes.shallow((add if sign == "+" else subtract)(made, self._product()))
        return made

    def _product(self):
        made = self._signed()
        while sign := self._take("*", "/"):
            made = self._notes.shallow((multiply if sign == "*" else divide)(made, self._signed()))
        return made

    def _signed(self):
        self._levels += 1
        if self._levels > _MOST_LEVELS:
            raise Error(f"the text '{self._text[:60]}...' is nested deeper than {_MOST_LEVELS} levels; give its parts to several terms")
        made = self._unlimited()
        self._levels -= 1
        return made

    def _unlimited(self):
        if self._take("-"):
            return negate(self._signed())
        if self._take("+"):
            return self._signed()
        base = self._atom()
        if not self._take("^"):
            return base
        exponent = self._signed()
        return call("sqrt", base) if exponent.text == "0.5" else self._notes.style.power(base, exponent)

    def _atom(self):
        kind, text = self._next()
        if kind == "number":
            self._at += 1
            return self._notes.style.number(float(text))
        if kind == "name":
            self._at += 1
            return self._call(text) if self._take("(") else self._named(text)
        if not self._take("("):
            raise self._wrong("a number, a name or '('")
        made = self._sum()
        self._close()
        return made

    def _named(self, name):
        if name == "pi":
            return Text(self._notes.style.pi)
        if name == "infinity" and self._notes.style.has_corners:
            return self._notes.style.number(math.inf)
        if name.endswith("'"):
            return Text(self._notes.name(name[:-1]).text + "'")
        return self._notes.name(name)

    def _close(self):
        if not self._take(")"):
            raise self._wrong("an operator or ')'")

    def _call(self, name):
        corner = _CORNERS_OF_TEXTS.get(name) if self._notes.style.has_corners else None
        count = corner[1] if corner else 3 if name == "where" and self._notes.style.has_corners else FUNCTIONS.get(name)
        if count is None:
            what = f" It {_SMOOTH}" if name in (*_CORNERS_OF_TEXTS, "fabs", "fmin", "fmax", "sign", "where") else ""
            raise Error(f"the text '{self._text}': there is no function '{name}'; expected one of {', '.join(FUNCTIONS)}.{what}")
        given = [self._sum()]
        while self._take(","):
            given.append(self._sum())
        self._close()
        if len(given) != count:
            raise Error(f"the text '{self._text}': {name} has {count} argument{'s' if count > 1 else ''}, found {len(given)}")
        if name == "where":
            return self._notes.style.choice(given[0], ">", self._notes.style.number(0), *given[1:])
        return self._notes.style.call(self._notes.style.corners[corner[0]] if corner else name, *given)


def reader_of(terms, notes):
    """What reads these terms: CasADi's where one of them is of CasADi, else sympy's."""
    if any(str(type(term).__module__).startswith("casadi") for term in terms):
        import casadi

        return CasadiReader(casadi, notes)
    try:
        import sympy
    except ImportError as missing:
        raise Error("equations take sympy (python3-sympy, or pip install sympy) or CasADi; neither is there") from missing
    return SympyReader(sympy, notes)
