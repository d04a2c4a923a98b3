"""The stub says what the module has, and only that."""

import ast
import inspect
from pathlib import Path

import farnear
from farnear import _farnear


def test_the_stub_and_the_module_agree():
    stub = ast.parse((Path(farnear.__file__).parent / "_farnear.pyi").read_text())
    told = {node.name: node for node in stub.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    # What only measure.py uses is there only where it was asked for.
    there = {name for name in dir(_farnear) if not name.startswith("_") and not name.startswith("seconds_of")}
    assert there == set(told)
    for name, node in told.items():
        assert ast.get_docstring(node), name
        if not isinstance(node, ast.ClassDef):
            arguments = node.args
            names = [argument.arg for argument in arguments.args + arguments.kwonlyargs]
            assert list(inspect.signature(getattr(_farnear, name)).parameters) == names, name
            continue
        members = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
        for member in members - {"__init__"}:
            assert hasattr(getattr(_farnear, name), member), f"{name}.{member}"


def test_the_package_is_typed():
    assert (Path(farnear.__file__).parent / "py.typed").is_file()
    assert set(farnear.__all__) <= set(dir(farnear))
