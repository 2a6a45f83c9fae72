"""Softnesses that are learned for finding poses of a mesh."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Tuple, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _native, _progress, _shapes
from ._native import Softness


@dataclass(frozen=True, eq=False)
class LearnedSoftness:
    """A softness that was learned, as `learn_softness` returns it.

    `errors` `[validations]` are mean losses that runs for validation end with, at the start and after each tenth of the updates: one less the
    overlap over the union, under a narrow softness. `softness` is that of the least. `complete` is False where Ctrl-C ended learning.
    """

    softness: Softness
    errors: Tuple[float, ...]
    complete: bool

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes a JSON file at `path`, which `Softness.load` and the command line read."""
        self.softness.save(path)


def learn_softness(
    mesh: Tuple[ArrayLike, ArrayLike, object], softness: Softness, *, size: int = 64, steps: int = 100, updates: int = 50, batch: int = 8,
    learning_rate: float = 0.03, progress: _progress.Progress = None,
) -> LearnedSoftness:
    """A softness for finding poses of a mesh: what makes runs of gradient descent end as near to the pose as they can.

    `mesh` is positions `[V, 3]`, faces `[F, 3]` and anything third, anywhere and in any unit. Learning begins with `softness`. A run looks for a
    pose by `steps` steps on `size` by `size` pixels, from a start that is 35 to 55 degrees off. Each of the `updates` draws `batch` runs, and
    moves the parameters by Adam at `learning_rate`: by an evolution strategy up to ten parameters, else by the exact gradient through all steps.
    Other tasks can be learned through a loop of your own, with `softrast.torch`.

    `progress` is a function that receives the number of each update, how many there are and the error, or a bar of tqdm. Ctrl-C returns the best
    softness until then, with `complete` False; before the first update it raises KeyboardInterrupt. Raises `ValueError` if an argument is out of
    range.
    """
    positions, faces = _shapes.rows(mesh[0], "positions"), _shapes.faces(mesh[1])
    _shapes.softness(softness)
    numbers = [_shapes.whole(x, name, least) for x, name, least in (
        (size, "size", 8), (steps, "steps", 1), (updates, "updates", 1), (batch, "batch", 1))]
    if not 0.0 < learning_rate < np.inf:
        raise ValueError(f"learning_rate must be more than 0, found {learning_rate}")
    learned, errors, complete = _native.learn_softness(
        positions, faces, softness, *numbers, float(learning_rate), _progress.visit(progress))
    return LearnedSoftness(learned, tuple(errors), complete)
