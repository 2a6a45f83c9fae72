"""Every public name has a signature with types, and says what it takes."""

import ast
import importlib
import inspect
import os
import subprocess
import sys
from pathlib import Path

import pytest

import softrast
from softrast import _native

# Without an array, a shape or a unit to speak of.
PLAIN = {"families", "learned_names"}


def public():
    for name in ("softrast", "softrast.torch", "softrast.jax", "softrast.nn", "softrast.pytorch3d"):
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


def test_the_package_states_its_version_backend_and_threads():
    environment = {**os.environ, "RAYON_NUM_THREADS": "3"}
    said = subprocess.run([sys.executable, "-m", "softrast"], env=environment, stdout=subprocess.PIPE, text=True, check=True).stdout
    assert said.startswith(f"softrast {softrast.__version__}\nbackend: CPU\nthreads: 3 ") and "numpy: " in said


def test_types_are_right_by_mypy(tmp_path):
    pytest.importorskip("mypy")
    used = tmp_path / "used.py"
    used.write_text(USED)
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), str(used)], stdout=subprocess.PIPE, text=True,
    )
    assert checked.returncode == 0, checked.stdout


# A user's script; each line of it must have a type.
USED = """
import numpy as np
from numpy.typing import NDArray

import softrast

positions, faces, colours = softrast.fox()
renderer = softrast.Renderer(faces, (48, 64), softrast.Softness("logistic", 0.01), tolerance=1e-4)
cameras: NDArray[np.float64] = softrast.pinhole(np.eye(3), np.eye(3), np.zeros(3), (48, 64), "opencv")
seen = softrast.project(positions, softrast.orbit(2.7, 20.0, 30.0))
alpha: NDArray[np.float64] = softrast.silhouette(renderer, seen, renderer.phi)
painter = softrast.ColourRenderer(faces, 64, softrast.Softness.learned("pose"), [1.7, 3.7])
height: int = painter.size[0]
image = softrast.blend(painter, seen, positions, background=[0.0, 0.0, 0.0])
bound: float = renderer.error_bound + image.max() + alpha.max() + cameras.max()
views: softrast.Views = softrast.load_views("views", masks="masks", invert=True)
made = softrast.Views(views.masks, np.eye(3), views.R, views.t, names=["a"] * len(views))


def visit(step: int, steps: int, loss: float) -> None:
    print(step / steps, loss)


found: softrast.FoundMesh = softrast.fit_mesh(made[::2], colours=True, start=softrast.icosphere(2), max_faces=1000, progress=visit)
painted = softrast.paint(found.mesh, views[1], steps=10)
pose: softrast.FoundPose = softrast.find_pose(found.mesh, views.masks[0], views.K[0], progress=visit)
iou: NDArray[np.float64] = painted.iou + painted.psnr + found.iou_of(views)
done: bool = pose.complete and found.complete
found.save("a.glb")
"""
