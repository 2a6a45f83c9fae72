"""The camera from which a mesh has a given silhouette."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Dict, List, Optional, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _cameras, _native, _progress, _shapes


@dataclass(frozen=True, eq=False)
class Pose:
    """A camera that fits a mask: `R` `[3, 3]` and `t` `[3]` in OpenCV's convention, `R X + t` with x right, y down, z ahead.

    `t` is in the units of the mesh. `iou` is the overlap over the union of its hard silhouette and the mask, in [0, 1].
    """

    R: NDArray[np.float64]
    t: NDArray[np.float64]
    iou: float


@dataclass(frozen=True, eq=False)
class FoundPose(Pose):
    """The pose that fits best, and others that fit nearly as well, as `find_pose` returns them.

    `K` `[3, 3]` and `size` `(height, width)` are those of the mask. `alternatives` are at least 6 degrees apart and have an overlap that is less
    by 0.03 at most, the best first: a silhouette alone does not tell them from the answer. `complete` is False where Ctrl-C ended the search:
    the pose is the best until then, without alternatives.
    """

    K: NDArray[np.float64]
    size: Tuple[int, int]
    alternatives: Tuple[Pose, ...]
    complete: bool = True

    @property
    def cameras(self) -> NDArray[np.float64]:
        """The camera and those of the alternatives for `project`, `[1 + alternatives, 3, 4]`."""
        poses = (self, *self.alternatives)
        R, t = (np.stack([getattr(pose, name) for pose in poses]) for name in ("R", "t"))
        found: NDArray[np.float64] = _cameras.pinhole(np, self.K, R, t, self.size, "opencv")
        return found

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes a JSON file at `path`: `K`, `size`, and `poses`, the best first, each with `R`, `t` and `iou`."""
        poses: List[Dict[str, object]] = [
            {"R": pose.R.tolist(), "t": pose.t.tolist(), "iou": pose.iou} for pose in (self, *self.alternatives)
        ]
        with open(path, "w", encoding="utf-8") as file:
            json.dump({"convention": "opencv", "K": self.K.tolist(), "size": list(self.size), "poses": poses}, file, indent=2)


def load_mask(path: Union[str, os.PathLike[str]]) -> NDArray[np.float32]:
    """Reads a mask from a picture: `[height, width]` in [0, 1], float32, top row first.

    White or opaque is inside. Masks of 0 and 1, of one dark colour, and of 16 bits are read too. Raises `ValueError` if the file is no mask.
    """
    return _native.load_mask(path)


def find_pose(
    mesh: Tuple[ArrayLike, ArrayLike, object], mask: ArrayLike, K: ArrayLike, *, start: Optional[Tuple[ArrayLike, ArrayLike]] = None,
    progress: _progress.Progress = None,
) -> FoundPose:
    """The camera from which a mesh has the silhouette of a mask.

    `mesh` is positions `[V, 3]`, faces `[F, 3]` and anything third, as `load_mesh` returns them, anywhere and in any unit. `mask` `[height,
    width]` is bool, or float in [0, 1], top row first. `K` `[3, 3]` is in pixels with the centre of the first pixel at (0, 0), as `pinhole`
    takes it, without skew. All directions are tried, or `start` alone, which is an `R` and a `t`. `progress` receives the number of each step,
    which starts at 1 and never falls, the largest number that it may reach, and the least loss; or it is a bar of tqdm.

    Ctrl-C ends the search at its next step and returns the best pose until then, with `complete` False; before the first step, or for the second
    time, it raises KeyboardInterrupt. An error of `progress` is raised again. Raises `ValueError` if nothing or all of the mask is inside, the
    mesh has no extent, the start does not see it, or an argument is out of range.
    """
    positions, faces = _shapes.rows(mesh[0], "positions"), _shapes.faces(mesh[1])
    levels = _shapes.mask(mask)
    lens = np.asarray(_shapes.as_array(K, "K"), np.float64)
    if lens.shape != (3, 3) or lens[0, 1] != 0.0:
        raise ValueError(f"K must be [3, 3] without skew, found {lens.tolist()}")
    known = None
    if start is not None:
        R, t = (np.asarray(_shapes.as_array(x, "start"), np.float64) for x in start)
        if R.shape != (3, 3) or t.shape != (3,):
            raise ValueError(f"start must be R [3, 3] and t [3], found {list(R.shape)} and {list(t.shape)}")
        known = R.tolist(), t.tolist()
    # Pixels from the corner of the picture, not from the centre of its first pixel.
    numbers = [lens[0, 0], lens[1, 1], lens[0, 2] + 0.5, lens[1, 2] + 0.5]
    found, complete = _native.find_pose(positions, faces, levels, numbers, known, _progress.visit(progress))
    best, *others = (Pose(np.array(R), np.array(t), iou) for R, t, iou in found)
    return FoundPose(best.R, best.t, best.iou, lens, (levels.shape[0], levels.shape[1]), tuple(others), complete)
