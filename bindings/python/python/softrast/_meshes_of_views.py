"""Meshes from views, and colours of a mesh from pictures."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import Optional, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, _progress, _shapes
from ._views import Views

_Mesh = Tuple[ArrayLike, ArrayLike, object]


@dataclass(frozen=True, eq=False)
class FoundMesh:
    """A mesh that fits views, as `fit_mesh` and `paint` return it.

    `positions` are `[V, 3]` in world units, `faces` `[F, 3]`, counterclockwise from outside, `colours` `[V, 3]` in [0, 1] or None. `complete` is
    False where Ctrl-C ended the search: the mesh is as it was then. `views` are those that it fits.
    """

    positions: NDArray[np.float64] = field(repr=False)
    faces: NDArray[np.int64] = field(repr=False)
    colours: Optional[NDArray[np.float64]] = field(repr=False)
    complete: bool
    views: Views = field(repr=False)

    @property
    def mesh(self) -> Tuple[NDArray[np.float64], NDArray[np.int64], Optional[NDArray[np.float64]]]:
        """Positions, faces, and colours or None, as `load_mesh` returns a mesh."""
        return self.positions, self.faces, self.colours

    @cached_property
    def iou(self) -> NDArray[np.float64]:
        """Overlap over union of its hard silhouette and the mask of each view, `[views]` in [0, 1]."""
        return self.iou_of(self.views)

    @cached_property
    def psnr(self) -> NDArray[np.float64]:
        """How near its colours come to each picture, `[views]` in decibels; see `psnr_of`."""
        return self.psnr_of(self.views)

    def iou_of(self, views: Views) -> NDArray[np.float64]:
        """Overlap over union of its hard silhouette and the masks of other views, `[views]` in [0, 1]."""
        return np.array(_native.view_iou(self.positions, self.faces, list(views.masks), views._lenses))

    def psnr_of(self, views: Views) -> NDArray[np.float64]:
        """`-10 log10` of the mean squared difference of its colours to each picture, `[views]` in decibels, at most 100.

        Pixels that the mesh or the mask covers count, over black. Raises `ValueError` if the mesh has no colours or the views have no pictures.
        """
        if self.colours is None or views.pictures is None:
            raise ValueError("psnr needs a mesh with colours and views with pictures")
        masks, pictures = list(views.masks), list(views.pictures)
        return np.array(_native.view_psnr(self.positions, self.faces, self.colours, masks, views._lenses, pictures))

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes the mesh as OBJ, PLY or GLB by the ending of `path`, whole or not at all."""
        _native.save_mesh(path, self.positions, self.faces, self.colours)


def fit_mesh(
    views: Views, *, colours: bool = False, steps: int = 500, size: Optional[int] = None, max_faces: int = 200_000, smoothing: float = 1.0,
    start: Union[str, _Mesh] = "hull", progress: _progress.Progress = None,
) -> FoundMesh:
    """The surface that views show: a closed mesh with the silhouettes of their masks, `[V, 3]` and `[F, 3]` in their world units.

    Two views from different directions are the least. Where the views have `normals`, these pull the surface too, and with `colours` so do the
    pictures, which also give it the colours of its vertices. It is remeshed as it moves, in `steps` steps, on up to `size` by `size` pixels (at
    least 8; as many as the pictures have, up to 256, by default) and with at most `max_faces` faces. `smoothing` in (0, 5] is how much smoother
    than usual it is kept. `start` is "hull", the visual hull of the masks, or "sphere", which has no holes, or a closed mesh as `load_mesh`
    returns it.

    `progress` is a function that receives the number of each step, how many there are and the loss, or a bar of tqdm. Ctrl-C ends the search at
    its next step and returns the mesh as it is then, with `complete` False; before the first step, or for the second time, it raises
    KeyboardInterrupt. An error of `progress` is raised again. Raises `ValueError` if masks and cameras do not fit together or an argument is out
    of range.
    """
    if len(views) < 2:
        raise ValueError("fit_mesh needs two views or more, from different directions, found one")
    steps, most = _shapes.whole(steps, "steps", 1), _shapes.whole(max_faces, "max_faces", 100)
    pixels = 0 if size is None else _shapes.whole(size, "size", 8)
    if colours and views.pictures is None:
        raise ValueError("fit_mesh with colours needs views with pictures")
    begin = None
    if not isinstance(start, str):
        begin = _shapes.rows(start[0], "positions"), _shapes.faces(start[1])
    elif start not in ("hull", "sphere"):
        raise ValueError(f"start must be 'hull', 'sphere' or a mesh, found {start!r}")
    pictures = list(views.pictures) if colours and views.pictures is not None else None
    normals = None if views.normals is None else list(views.normals)
    found, complete = _native.fit_mesh(
        list(views.names), list(views.masks), views._lenses, pictures, normals, begin, start == "hull" if begin is None else False,
        pixels, steps, most, float(smoothing), _progress.visit(progress),
    )
    return FoundMesh(*found, complete, views)


def paint(
    mesh: _Mesh, views: Views, *, steps: int = 60, size: int = 128, learning_rate: float = 0.05, progress: _progress.Progress = None,
) -> FoundMesh:
    """A mesh in the colours that the pictures of views show: colours `[V, 3]` in [0, 1].

    `mesh` is positions `[V, 3]`, faces `[F, 3]` and anything third, in the world units of the cameras. Its shape stays; faces that cover many
    pixels are cut into four, so that the colours have room. `steps` steps of Adam at `learning_rate` compare `size` by `size` pixels around each
    mask. What no view shows takes the colours around it.

    `progress` and Ctrl-C are as for `fit_mesh`. Raises `ValueError` if the views have no pictures, or no camera has the mesh before it.
    """
    if views.pictures is None:
        raise ValueError("paint needs views with pictures")
    positions, faces = _shapes.rows(mesh[0], "positions"), _shapes.faces(mesh[1])
    steps, size = _shapes.whole(steps, "steps", 1), _shapes.whole(size, "size", 8)
    if not 0.0 < learning_rate < np.inf:
        raise ValueError(f"learning_rate must be more than 0, found {learning_rate}")
    found, complete = _native.paint(
        positions, faces, list(views.names), list(views.masks), views._lenses, list(views.pictures), size, steps, float(learning_rate),
        _progress.visit(progress),
    )
    return FoundMesh(*found, complete, views)
