"""The types of the module are those that its stub says; the package passes mypy."""
import ast
import importlib.util
import inspect
import pathlib
import re
import subprocess
import sys

import pytest
import rhec
from rhec import _rhec
from shared import ROOT

STUB = pathlib.Path(rhec.__file__).parent / "_rhec.pyi"
# What Python adds to every class, and pybind11 to its own.
COMMON = set(dir(object)) | {"__module__", "__dict__", "__weakref__", "_pybind11_conduit_v1_"}
SHOWN_ANYHOW = {"__repr__", "__init__", "__setstate__"}


def members(value):
    return {name for name in vars(value) if name not in COMMON and name not in SHOWN_ANYHOW}


def parameters(text):
    """The names in the first line of a docstring of pybind11: f(self: x, a: y, *, b: z = 3) -> w."""
    inside = re.match(r"\w+\((.*)\)(?: -> .*)?$", text.splitlines()[0]).group(1)
    depth, parts, part = 0, [], ""
    for letter in inside:
        depth += letter in "[(<"
        depth -= letter in "])>"
        if letter == "," and depth == 0:
            parts.append(part)
            part = ""
        else:
            part += letter
    parts.append(part)
    return [each.split(":")[0].split("=")[0].strip() for each in parts if each.strip()]


def stub_parameters(function):
    arguments = function.args
    names = [each.arg for each in arguments.args]
    return names + (["*"] if arguments.kwonlyargs else []) + [each.arg for each in arguments.kwonlyargs]


def stubs():
    return ast.parse(STUB.read_text()).body


def functions(body):
    return {each.name: each for each in body if isinstance(each, ast.FunctionDef)}


def test_the_stub_has_what_the_module_has():
    classes = {each.name for each in stubs() if isinstance(each, ast.ClassDef)}
    assert classes == {name for name, value in vars(_rhec).items() if inspect.isclass(value)}
    calls = {name for name, value in vars(_rhec).items() if callable(value) and not inspect.isclass(value)}
    assert set(functions(stubs())) == calls
    assert len(classes) > 10 and len(calls) > 10


@pytest.mark.parametrize("name", [each.name for each in stubs() if isinstance(each, ast.ClassDef)])
def test_classes_have_the_members_of_their_stubs(name):
    stub = functions(next(each for each in stubs() if isinstance(each, ast.ClassDef) and each.name == name).body)
    kind = getattr(_rhec, name)
    assert set(stub) - SHOWN_ANYHOW == members(kind)
    for member, function in stub.items():
        is_property = any(isinstance(each, ast.Name) and each.id == "property" for each in function.decorator_list)
        assert is_property == isinstance(inspect.getattr_static(kind, member), property), member
        if not is_property:
            assert parameters(getattr(kind, member).__doc__) == stub_parameters(function), f"{name}.{member}"


def test_functions_have_the_parameters_of_their_stubs():
    for name, function in functions(stubs()).items():
        assert parameters(getattr(_rhec, name).__doc__) == stub_parameters(function), name


def test_everything_public_is_described():
    for name in rhec.__all__:
        value = getattr(rhec, name)
        assert isinstance(value, str) or inspect.getdoc(value), name
        if inspect.isclass(value) and value.__module__.startswith("rhec"):
            for member in members(value):
                if not member.startswith("_") and callable(getattr(value, member)):
                    assert inspect.getdoc(getattr(value, member)), f"{name}.{member}"


def test_the_package_passes_mypy():
    if importlib.util.find_spec("mypy") is None:
        pytest.skip("mypy is not installed")
    result = subprocess.run([sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", "/dev/null",
                             "-p", "rhec"], cwd=STUB.parent.parent, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout


def test_every_argument_has_words():
    """What a call expects is told by name, and each name that is told is one."""
    from rhec._arguments import MEANINGS

    seen = set()
    for each in (rhec.Path, rhec.Vehicle, rhec.Estimator, rhec.Controller, rhec.Estimate):
        for name, value in vars(each).items():
            text = getattr(value, "__doc__", None) or ""
            if name.startswith("__") and name not in ("__init__", "__getitem__") or not text.startswith(f"{name}("):
                continue
            for parameter in parameters(text):
                if parameter not in ("self", "*"):
                    assert parameter in MEANINGS, (each, name, parameter)
                    seen |= {parameter, f"{each.__name__}.{name}.{parameter}"}
    inside = {"cold", "covariances", "file", "folder", "solver"}  # of what the package calls itself
    assert set(MEANINGS) <= seen | inside
