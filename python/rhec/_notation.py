"""Terms of sympy and CasADi in the notation of vehicles' equations (docs/equations.md), or as C++."""
from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

from ._errors import Error

# How tightly a text binds: a sum, a product, a sign, a power, an atom.
_SUM, _PRODUCT, _SIGNED, _POWER, _ATOM = range(1, 6)
# A term may be 100 levels deep; deeper ones are divided.
_DEEPEST = 40
# Beyond so many operations common parts become definitions of their own.
_MANY = 2000
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_SMOOTH = ("has no derivative everywhere; write rhec.smooth_abs, rhec.smooth_max or rhec.smooth_min of a width, or give "
           "Model(..., smooth=WIDTH), a little below what matters")


def smooth_abs(x: Any, width: float) -> Any:
    """sqrt(x^2 + width^2): |x| with a derivative everywhere; of numbers, sympy's and CasADi's terms."""
    return (x * x + width * width) ** 0.5


def smooth_max(a: Any, b: Any, width: float) -> Any:
    """The larger of a and b, rounded off where they differ by about `width`."""
    return (a + b + smooth_abs(a - b, width)) / 2


def smooth_min(a: Any, b: Any, width: float) -> Any:
    """The smaller of a and b, likewise."""
    return (a + b - smooth_abs(a - b, width)) / 2


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

    def number(self, value):
        value = float(value)
        if not math.isfinite(value):
            raise Error(f"a number that is not finite in an equation: {value}; expected finite ones")
        return Text(self._digits(value), _SIGNED if value < 0 else _ATOM)

    def _digits(self, value):
        return repr(value).removesuffix(".0")

    def power(self, a, b):
        return _joined("{}^{}", _POWER, (a, _ATOM), (b, _POWER))


class Cpp(Equations):
    """How C++ does, for double and rhec::Expression alike."""

    pi = "std::numbers::pi"

    def _digits(self, value):
        return repr(value)  # 1.0, not 1: 1 / 2 is 0

    def power(self, a, b):
        if re.fullmatch(r"-?\d+\.0", b.text):
            return call("pow", a, Text(b.text[:-2], b.level))
        return call("exp", multiply(b, call("log", a)))


class CppNumbers(Cpp):
    """Numbers that nobody differentiates: they may have corners, and be infinite."""

    has_corners = True

    def number(self, value):
        if math.isinf(float(value)):
            return Text("rhec::infinity" if value > 0 else "-rhec::infinity", _ATOM if value > 0 else _SIGNED)
        return super().number(value)


class Notes:
    """Definitions that are made on the way, what is smoothed, and how terms are written."""

    def __init__(self, taken, smooth, style=None):
        self.definitions, self._taken, self._smooth = {}, set(taken), smooth
        self.style = style or Equations()

    def name(self, text):
        if not _NAME.fullmatch(text):
            raise Error(f"the name '{text}': expected letters, digits and underscores, with no digit first; rename the symbol")
        return Text(text)

    def define(self, term):
        number_of = len(self.definitions) + 1
        while f"part{number_of}" in self._taken:
            number_of += 1
        name = f"part{number_of}"
        self._taken.add(name)
        self.definitions[name] = term.text
        return Text(name)

    def shallow(self, term):
        return self.define(term) if term.depth > _DEEPEST else term

    def width(self, what):
        if self._smooth is None:
            raise Error(f"{what} {_SMOOTH}")
        return self.style.number(self._smooth)

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
            return call(name, *map(self.read, term.args))
        if isinstance(term, sympy.Abs):
            return call("smooth_abs", self.read(term.args[0]), self._notes.width(f"{term}: abs"))
        if isinstance(term, (sympy.Max, sympy.Min)):
            function = "smooth_max" if isinstance(term, sympy.Max) else "smooth_min"
            made, *others = map(self.read, sorted(term.args, key=str))
            for other in others:
                made = call(function, made, other, self._notes.width(f"{term}: {name.lower()}"))
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
                made = Text(f"({self._truth(condition)} ? {self.read(value).text} : {made.text})")
            return made
        function = {sympy.Abs: "fabs", sympy.Max: "fmax", sympy.Min: "fmin"}[term.func]
        made, *others = map(self.read, sorted(term.args, key=str))
        if function == "fabs":
            return call(function, made)
        for other in others:
            made = call(function, made, other)
        return made

    def _truth(self, condition):
        sympy = self._sympy
        if isinstance(condition, sympy.core.relational.Relational):
            return f"({self.read(condition.lhs).within(_SUM)} {condition.rel_op} {self.read(condition.rhs).within(_SUM)})"
        if isinstance(condition, (sympy.And, sympy.Or)):
            sign = " && " if isinstance(condition, sympy.And) else " || "
            return f"({sign.join(self._truth(part) for part in condition.args)})"
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
            "FABS": lambda a: call("smooth_abs", a, width("fabs")),
            "FMAX": lambda a, b: call("smooth_max", a, b, width("fmax")),
            "FMIN": lambda a, b: call("smooth_min", a, b, width("fmin")),
            "SIGN": lambda a: call("tanh", divide(a, width("sign"))),
            "LT": lambda a, b: step(subtract(b, a), "a comparison"), "LE": lambda a, b: step(subtract(b, a), "a comparison"),
            "NOT": lambda a: subtract(one, a), "AND": multiply,
            "OR": lambda a, b: subtract(add(a, b), multiply(a, b)), "IF_ELSE_ZERO": multiply,
        }
        rules |= {name: (lambda *a, function=function: call(function, *a)) for name, function in plain.items()}
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
