"""The formula of a vehicle, handed to other programs: nodes of rhec's graph become their terms."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from . import _rhec
from ._arguments import checked, found_in_words
from ._errors import ArgumentError, Error, Names, module_of


def evaluate(vehicle: _rhec.Vehicle, library: dict[str, Any], states: Sequence[Any], inputs: Sequence[Any],
             parameters: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Rates and outputs as terms, of terms for the variables. `library` has the functions sqrt, exp, ..., tanh, atan2
    (CasADi, sympy or numpy, by their names), and options have their values."""
    graph = vehicle.graph()
    if graph is None:
        raise Error(f"{vehicle.name}: its formula is code of its own, not a graph; expected a model of FormulaModel, or a "
                    "vehicle of equations")
    known = {node: value for node, (_, value) in graph["options"].items()}
    for kind, terms in (("states", states), ("inputs", inputs), ("parameters", parameters)):
        known |= dict(zip(graph[kind], terms))
    rules: dict[str, Callable[[Any, Any], Any]] = {
        "add": lambda a, b: a + b, "subtract": lambda a, b: a - b, "multiply": lambda a, b: a * b,
        "negate": lambda a, _: -a, "reciprocal": lambda a, _: 1 / a,
        "arc_tangent_2": lambda a, b: library["atan2"](a, b),
    }
    plain = {"square_root": "sqrt", "exponential": "exp", "logarithm": "log", "sine": "sin", "cosine": "cos", "tangent": "tan",
             "arc_sine": "asin", "arc_cosine": "acos", "arc_tangent": "atan", "hyperbolic_tangent": "tanh"}

    def of_one(function: Callable[[Any], Any]) -> Callable[[Any, Any], Any]:
        return lambda a, _: function(a)

    rules |= {operation: of_one(library[name]) for operation, name in plain.items()}
    values = []
    for index, (operation, a, b, value, _) in enumerate(graph["nodes"]):
        if index in known:
            values.append(known[index])
        elif operation == "constant":
            values.append(value)
        elif operation == "power":
            values.append(values[a] ** b)
        elif operation == "input":
            values.append(None)  # nothing is computed of it: all that are needed are known
        else:
            values.append(rules[operation](values[a], values[b] if b >= 0 else None))
    return [values[node] for node in graph["rates"]], [values[node] for node in graph["outputs"]]


def vehicle_of(model: Any, title: str) -> _rhec.Vehicle:
    """The Vehicle of a Model, a BuiltModel or a Vehicle."""
    if isinstance(model, _rhec.Vehicle):
        return model
    made = getattr(model, "vehicle", None)
    if made is None and hasattr(model, "_section"):
        made = model.load()
    if not isinstance(made, _rhec.Vehicle):
        raise ArgumentError(f"{title}: model: found {found_in_words(model)}, expected a Vehicle, a Model, a BuiltModel or a Robot", "model")
    return made


@checked
def to_sympy(model: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The formula of a model as sympy's terms: (rates, outputs), dicts by the names of states and outputs. Symbols have
    the names of variables; options have their values."""
    sympy = module_of("sympy", "to_sympy")
    vehicle = vehicle_of(model, "to_sympy")
    symbols = [[sympy.Symbol(each.name, real=True) for each in variables]
               for variables in (vehicle.states, vehicle.inputs, vehicle.parameters)]
    names = ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "tanh", "atan2")
    rates, outputs = evaluate(vehicle, {name: getattr(sympy, name) for name in names}, *symbols)
    return (Names({each.name: term for each, term in zip(vehicle.states, rates)}),
            Names({each.name: term for each, term in zip(vehicle.outputs, outputs)}))
