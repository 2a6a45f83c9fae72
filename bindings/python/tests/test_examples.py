"""The examples of the pages and of the notebooks run."""

import json
import re
from pathlib import Path

import pytest

pytest.importorskip("torch")

ROOT = Path(__file__).parents[3]


def blocks(page):
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.S)


def test_the_example_of_the_readme_is_short_and_finds_the_camera():
    (example,) = blocks("bindings/python/README.md")
    assert len(example.splitlines()) <= 12
    scope = {}
    exec(example, scope)
    assert (scope["angles"] - scope["torch"].tensor([20.0, 30.0])).abs().max() < 1.0 / 3.0


def test_the_examples_of_the_guide_run_one_after_the_other(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data")
    scope = {}
    for example in blocks("docs/guide/python.md"):
        if "jax" in example:
            jax = pytest.importorskip("jax")
        exec(example, scope)
    jax.clear_caches()


@pytest.mark.parametrize("path", sorted((ROOT / "bindings/python/notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs(path, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib").use("agg")
    monkeypatch.chdir(tmp_path)
    scope = {}
    for cell in json.loads(path.read_text())["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), scope)
