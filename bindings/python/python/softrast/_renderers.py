"""Renderers: faces, image size, softness, tolerance, and the knots that they keep."""

from __future__ import annotations

from typing import Any, Dict, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native, _passes, _shapes
from ._native import Softness

Size = Union[int, Sequence[int]]


class Renderer:
    """Silhouettes of meshes with these faces: all that an image depends on except vertices and φ.

    `faces` `[F, 3]` are vertex numbers from 0. `size` is a number of pixels for a square, or `(height, width)`. `softness` is a
    `Softness`, at `progress` (0 to 1) of its run; if it has a surrogate, the image is its own and the gradient to the vertices that of the
    surrogate. `tolerance` (0 to 1) bounds the error of any pixel. `t_conorm` combines the coverages of faces: "probabilistic",
    "einstein", "hamacher:p", "frank:p", "yager:p", "aczel_alsina:p", "dombi:p" or "schweizer_sklar:p". `cull_back_faces` leaves out
    faces whose corners the camera sees clockwise: for closed meshes, where they cost half of the time and widen the outline.

    A renderer can be copied and pickled. It keeps its knots while no parameter of φ moves by more than 2e-5, so that images are smooth in φ there.

    Raises `ValueError` if one of them is out of range.
    """

    def __init__(
        self, faces: ArrayLike, size: Size, softness: Softness, *, progress: float = 0.0, tolerance: float = 1e-5,
        t_conorm: str = "probabilistic", cull_back_faces: bool = False,
    ) -> None:
        _shapes.softness(softness)
        self._settings = {
            "faces": _shapes.faces(faces), "size": _shapes.size(size), "softness": softness, "progress": progress, "tolerance": tolerance,
            "t_conorm": t_conorm, "cull_back_faces": cull_back_faces,
        }
        self._draw_by(_native.Renderer(*self._settings.values()))

    def _draw_by(self, native: _native.Renderer) -> None:
        self._native, self._size = native, self._settings["size"]
        # Plain attributes: torch.compile reads no others.
        self._least, self._parameters = self._native.least_vertices, len(self._native.phi)
        self._by_own, self._by_phi = (_passes.silhouette(self._native, own) for own in (True, False))
        self._by_own_name, self._by_phi_name = self._by_own.handle, self._by_phi.handle
        self._losses = _passes.silhouette_losses(self._native)
        self._loss_names = {name: of.handle for name, of in self._losses.items()}

    def with_faces(self, faces: ArrayLike) -> Renderer:
        """This renderer for other `faces` `[F, 3]`. It keeps its knots unless there are more faces than they were chosen for."""
        return _with_faces(self, faces)

    @property
    def faces(self) -> NDArray[np.int64]:
        """Faces `[F, 3]`, a copy."""
        return self._settings["faces"].copy()

    @property
    def phi(self) -> NDArray[np.float64]:
        """Parameters φ `[P]`, float64: those that are drawn with where no others are given."""
        return self._native.phi

    @property
    def size(self) -> Tuple[int, int]:
        """Height and width of the image, in pixels."""
        return self._native.size

    @property
    def error_bound(self) -> float:
        """The largest error of a pixel under φ, in coverage: the tolerance, or more where no table can follow the softness to it."""
        return self._native.error_bound

    @property
    def least_vertices(self) -> int:
        """How many vertices the faces ask for."""
        return self._least

    def __repr__(self) -> str:
        return repr(self._native)

    def __reduce__(self) -> Tuple[Any, ...]:
        return _made, (type(self), self._settings)


class ColourRenderer:
    """Colours of meshes with these faces: all that an image depends on except vertices, attributes, background and φ.

    `faces` `[F, 3]` are vertex numbers from 0. `size` is a number of pixels for a square, or `(height, width)`. A face weighs what
    `softness`, a `Softness` at `progress` (0 to 1) of its run, says of the distance to its edge, times what `depth` says of its depth: the name
    of a family, or "depth_mlp". `planes` are a near and a far depth in world units, around the mesh; they do not cut. `depth_scale` is in
    units of the distance between them: with "exp" a face counts e times as much as one that lies so far behind it. `tolerance` (0 to 1)
    bounds the error of any pixel, as a part of the range of what is shown. `cull_back_faces` leaves out faces whose corners the camera
    sees clockwise: for closed meshes whose faces go counter-clockwise as seen from outside, in half of the time.

    A renderer can be copied and pickled. It keeps its knots while φ and the background's weight move by 2e-5 at most, as a `Renderer` does.

    Raises `ValueError` if one of them is out of range, or the softness has a surrogate.
    """

    def __init__(
        self, faces: ArrayLike, size: Size, softness: Softness, planes: Sequence[float], *, progress: float = 0.0, depth: str = "exp",
        depth_scale: float = 0.05, tolerance: float = 1e-5, cull_back_faces: bool = False,
    ) -> None:
        _shapes.softness(softness)
        self._settings = {
            "faces": _shapes.faces(faces), "size": _shapes.size(size), "softness": softness, "planes": _shapes.planes(planes),
            "progress": progress, "depth": depth, "depth_scale": depth_scale, "tolerance": tolerance, "cull_back_faces": cull_back_faces,
        }
        self._draw_by(_native.ColourRenderer(*self._settings.values()))

    def _draw_by(self, native: _native.ColourRenderer) -> None:
        self._native = native
        # Plain attributes: torch.compile reads no others.
        self._least, self._log_weight = self._native.least_vertices, self._native.log_weight
        self._phi = tuple(map(float, self._native.phi)), tuple(map(float, self._native.phi_depth))
        self._functions: Dict[Any, _passes.Function] = {}
        self._plain_name = self._blend(None, None).handle

    def _blend(self, corners: Optional[NDArray[np.int64]], texture: Optional[Tuple[int, int]]) -> _passes.Function:
        """The function for these corners `[F, 3]` of attributes, or None, and rows and columns of a texture, or None."""
        key = None if corners is None else corners.tobytes(), texture
        if key not in self._functions:
            self._functions[key] = _passes.blend(self._native, corners, texture)
        return self._functions[key]

    def with_faces(self, faces: ArrayLike) -> ColourRenderer:
        """This renderer for other `faces` `[F, 3]`, and the knots as in `Renderer.with_faces`."""
        return _with_faces(self, faces)

    @property
    def phi(self) -> NDArray[np.float64]:
        """Parameters φ of the softness by edge, `[P]`, float64: those that are drawn with where no others are given."""
        return self._native.phi

    @property
    def phi_depth(self) -> NDArray[np.float64]:
        """Parameters φ of the softness by depth, `[Q]`, float64: those that are drawn with where no others are given."""
        return self._native.phi_depth

    @property
    def log_weight(self) -> float:
        """Logarithm of the weight of a background that is given none: a thousandth of a face at the far plane."""
        return self._native.log_weight

    @property
    def size(self) -> Tuple[int, int]:
        """Height and width of the image, in pixels."""
        return self._native.size

    @property
    def error_bound(self) -> float:
        """The largest error of a pixel under φ, as a part of the range of what is shown, in front of a background of the default weight.

        It is the tolerance, or more where no table can follow a softness to it.
        """
        return self._native.error_bound

    @property
    def face_count(self) -> int:
        """How many faces there are."""
        return self._native.face_count

    @property
    def least_vertices(self) -> int:
        """How many vertices the faces ask for."""
        return self._least

    def __repr__(self) -> str:
        return repr(self._native)

    def __reduce__(self) -> Tuple[Any, ...]:
        return _made, (type(self), self._settings)


def _with_faces(renderer: Any, faces: ArrayLike) -> Any:
    other = object.__new__(type(renderer))
    other.__dict__.update(renderer.__dict__)
    other._settings = {**renderer._settings, "faces": _shapes.faces(faces)}
    other._draw_by(renderer._native.with_faces(other._settings["faces"]))
    return other


def _made(kind: Any, settings: Dict[str, Any]) -> Any:
    """A renderer of these settings, for pickle."""
    return kind(**settings)
