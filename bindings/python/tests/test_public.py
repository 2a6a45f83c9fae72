"""Every public name has a signature with types, and says what it takes."""

import ast
import importlib
import inspect
from pathlib import Path

import pytest

import softrast
from softrast import _native

# Without an array, a shape or a unit to speak of.
PLAIN = {"families", "learned_names"}


def public():
    for name in ("softrast", "softrast.torch", "softrast.jax", "softrast.pytorch3d"):
        try:
            module = importlib.import_module(name)
        except ImportError:
            continue
        for own in module.__all__:
            yield pytest.param(getattr(module, own), id=f"{name}.{own}")


def members(scope):
    """Names that a stub gives a class or module."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return {node.name for node in scope.body if isinstance(node, kinds)}


@pytest.mark.parametrize("item", list(public()))
def test_a_public_name_has_types_and_says_its_shapes(item):
    assert item.__doc__.splitlines()[0].rstrip().endswith((".", ":", ",")) and len(item.__doc__) > 20
    if item.__name__ not in PLAIN | {"Softness"}:
        assert "`[" in item.__doc__, "a shape"
    if item.__module__.endswith("_native") or item is softrast.Softness:
        return
    call = item if inspect.isfunction(item) else item.__new__ if "__new__" in vars(item) else item.__init__
    signature = inspect.signature(call)
    assert signature.return_annotation is not inspect.Signature.empty
    for name, parameter in signature.parameters.items():
        assert name in ("self", "cls") or parameter.annotation is not inspect.Parameter.empty, name


def test_the_stub_has_what_the_compiled_half_has():
    stub = ast.parse((Path(softrast.__file__).parent / "_native.pyi").read_text())
    assert (Path(softrast.__file__).parent / "py.typed").exists()
    names = {name for name in dir(_native) if not name.startswith("_")}
    assert members(stub) == names
    for node in stub.body:
        found = getattr(_native, getattr(node, "name", "__name__"))
        assert isinstance(node, (ast.Expr, ast.Import, ast.ImportFrom, ast.Assign, ast.AnnAssign)) or found.__doc__, node.name
        if isinstance(node, ast.ClassDef):
            assert members(node) - {"__new__"} == {name for name in vars(found) if not name.startswith("_")}, node.name
            for method in (part for part in node.body if isinstance(part, ast.FunctionDef)):
                real = getattr(found, method.name)
                assert method.name == "__new__" or real.__doc__, method.name
                if callable(real) and method.name != "__new__":
                    arguments = [argument.arg for argument in method.args.args]
                    assert arguments == list(inspect.signature(real).parameters), method.name
        elif isinstance(node, ast.FunctionDef):
            assert [argument.arg for argument in node.args.args] == list(inspect.signature(found).parameters), node.name
