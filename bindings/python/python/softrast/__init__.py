"""Soft silhouettes and colours of triangle meshes, with exact first and second derivatives, on any CPU.

This module needs NumPy alone and draws. `softrast.torch` and `softrast.jax` have the same functions with gradients.

Vertices are `[views, V, 3]`: world units with y up before `project`, then x and y in NDC (x right, y up, the shorter side of the image is [-1,
1]) and the camera depth in world units. Images are `[views, height, width]`, top row first. Float types are float32 and float64; an image has
that of its vertices. Arrays of others that have `__dlpack__`, such as tensors of torch, are read without a copy. Whatever is wrong is a
`ValueError` of one line.
"""

from __future__ import annotations

import os as _os
from typing import Optional as _Optional, Tuple as _Tuple, Union as _Union

import numpy as _np
from numpy.typing import ArrayLike as _ArrayLike

from . import _cameras, _native, _passes, _shapes
from ._learning import LearnedSoftness, learn_softness
from ._meshes_of_views import FoundMesh, fit_mesh, paint
from ._native import Softness, __version__, families, learned_names
from ._pose import FoundPose, Pose, find_pose, load_mask
from ._renderers import ColourRenderer, Renderer, Size as _Size
from ._views import Views, load_views

__all__ = [
    "ColourRenderer", "FoundMesh", "FoundPose", "LearnedSoftness", "Pose", "Renderer", "Softness", "Views", "blend", "families",
    "find_pose", "fit_mesh", "fox", "hard_silhouette", "icosphere", "learn_softness", "learned_names", "load_mask", "load_mesh",
    "load_views", "orbit", "paint", "pinhole", "project", "save_mesh", "silhouette",
]

_Path = _Union[str, "_os.PathLike[str]"]
_Mesh = _Tuple[_np.ndarray, _np.ndarray, _Optional[_np.ndarray]]


def load_mesh(path: _Path) -> _Mesh:
    """Reads OBJ, PLY, STL, OFF, GLB or glTF: positions `[V, 3]` (float64), faces `[F, 3]` (int64), and colours `[V, 3]` in [0, 1] or None."""
    return _native.load_mesh(path)


def save_mesh(path: _Path, positions: _ArrayLike, faces: _ArrayLike, colours: _Optional[_ArrayLike] = None) -> None:
    """Writes OBJ, PLY or GLB by the ending of `path`, whole or not at all.

    `positions` are `[V, 3]`, `faces` `[F, 3]`, `colours` `[V, 3]` in [0, 1] or None, as `load_mesh` returns them.
    """
    colours = None if colours is None else _shapes.rows(colours, "colours")
    _native.save_mesh(path, _shapes.rows(positions, "positions"), _shapes.faces(faces), colours)


def fox() -> _Mesh:
    """The fox of the examples: positions `[V, 3]`, faces `[F, 3]` and None, as `load_mesh` returns a mesh."""
    return _native.fox()


def icosphere(subdivisions: int) -> _Mesh:
    """A sphere of radius 1 with `F = 20 * 4**subdivisions` faces: `[V, 3]`, `[F, 3]` and None, as `load_mesh` returns a mesh."""
    return _native.icosphere(subdivisions)


def orbit(
    distance: _ArrayLike, elevation_deg: _ArrayLike = 0.0, azimuth_deg: _ArrayLike = 0.0, fov_deg: _ArrayLike = 60.0,
) -> _np.ndarray:
    """Cameras `[views, 4]` (float64) that look at the origin: distance in world units, angles and whole field of view in degrees.

    Numbers or vectors `[views]`. At azimuth 0 a camera stands at -z with +x on its left, at 90 at +x.
    """
    numbers = [_np.atleast_1d(_shapes.as_array(x, "orbit")) for x in (distance, elevation_deg, azimuth_deg, fov_deg)]
    return _np.stack(_np.broadcast_arrays(*numbers), -1).astype(_np.float64)


def pinhole(K: _ArrayLike, R: _ArrayLike, t: _ArrayLike, size: _Size, convention: str = "opencv") -> _np.ndarray:
    """Cameras `[views, 3, 4]` (float64) of matrices `K` `[3, 3]` and poses `R` `[3, 3]`, `t` `[3]`, each with views first if there are several.

    `size` is that of the image: a number of pixels, or `(height, width)`. `K` is in pixels with the centre of the first pixel at (0, 0), as
    OpenCV has it; COLMAP's cx and cy are larger by 0.5. `t` is in world units. `convention` names the axes of the camera and what R and t do:

    - "opencv": `R X + t`, x right, y down, z ahead;
    - "opengl": `R X + t`, x right, y up, z behind: the view matrix, which is the inverse of a camera-to-world matrix;
    - "pytorch3d": `X R + t`, x left, y up, z ahead.

    Raises `ValueError` for another convention, or shapes that do not fit.
    """
    K, R, t = (_np.asarray(_shapes.as_array(x, name), _np.float64) for x, name in ((K, "K"), (R, "R"), (t, "t")))
    return _cameras.pinhole(_np, K, R, t, size, convention)


def project(vertices: _ArrayLike, cameras: _ArrayLike) -> _np.ndarray:
    """World vertices `[V, 3]` or `[1 or views, V, 3]` as cameras see them, `[views, V, 3]`.

    `cameras` are orbits `[1 or views, 4]` or matrices `[1 or views, 3, 4]`, of which two rows give x and y in NDC times the depth, the third the
    depth. The result has x and y in NDC and the depth in world units, in the float type of the vertices.
    """
    vertices = _shapes.floats(vertices, "vertices")
    cameras = _np.ascontiguousarray(_shapes.floats(cameras, "cameras"), vertices.dtype)
    vertices = vertices[None] if vertices.ndim == 2 else vertices
    views = _shapes.project(vertices.shape, cameras.shape)
    if cameras.ndim == 2:
        (cameras,) = _passes.ORBIT_MATRIX.call("image", [cameras], [], [])
    cameras = _np.broadcast_to(cameras, (views, 3, 4))
    (seen,) = _passes.PERSPECTIVE.call("image", [_np.ascontiguousarray(x) for x in (vertices, cameras)], [], [])
    return seen.swapaxes(1, 2)


def silhouette(renderer: Renderer, vertices: _ArrayLike, phi: _Optional[_ArrayLike] = None) -> _np.ndarray:
    """Coverage `[views, height, width]` in [0, 1] of projected `vertices` `[views, V, 3]`, under φ `[P]` or the renderer's own.

    A face with a corner nearer than 0.01 world units, or beyond 1e6 NDC, is not drawn.
    """
    vertices = _shapes.floats(vertices, "vertices")
    _shapes.vertices(vertices.shape, renderer._least)
    function = renderer._by_own if phi is None else renderer._by_phi
    inputs = [_np.ascontiguousarray(vertices.swapaxes(1, 2)), *([] if phi is None else [_shapes.vector(phi, "phi")])]
    return function.call("image", inputs, [], [])[0]


def hard_silhouette(vertices: _ArrayLike, faces: _ArrayLike, size: _Size) -> _np.ndarray:
    """1 where the centre of a pixel lies in a face, else 0: `[views, height, width]`, float32, of projected `vertices` `[views, V, 3]`.

    `faces` are `[F, 3]`; `size` is a number of pixels, or `(height, width)`.
    """
    vertices, faces = _np.asarray(_shapes.floats(vertices, "vertices"), _np.float64), _shapes.faces(faces)
    _shapes.vertices(vertices.shape, faces.max() + 1 if faces.size else 0)
    return _native.hard_silhouette(vertices, faces, _shapes.size(size))


def blend(
    renderer: ColourRenderer, vertices: _ArrayLike, attributes: _ArrayLike, background: _ArrayLike = 0.0, *,
    corners: _Optional[_ArrayLike] = None, texture: _Optional[_ArrayLike] = None, log_weight: _Optional[float] = None,
    phi: _Optional[_ArrayLike] = None, phi_depth: _Optional[_ArrayLike] = None,
) -> _np.ndarray:
    """Soft colours, `[views, channels + 1, height, width]`, of projected `vertices` `[views, V, 3]`; the last is the share of the faces.

    `attributes` `[V, channels]` or `[1 or views, V, channels]` are what vertices show, as many channels as you like, interpolated in
    perspective. With `corners` `[F, 3]` they have entries of their own, `[1 or views, entries, channels]`, and corners say which one each
    corner of a face has. With a `texture` `[height, width, channels]` (1 to 4 channels, top row first) they are places on it, u and v from 0
    to 1 with v up, and it is what is seen.

    `background` is a number or a colour `[channels]`, `log_weight` the logarithm of its weight; without one it weighs a thousandth of a face
    at the far plane. `phi` `[P]` and `phi_depth` `[Q]` are parameters of the softnesses by edge and by depth, or the renderer's own.
    """
    vertices = _shapes.floats(vertices, "vertices")
    _shapes.vertices(vertices.shape, renderer._least)
    dtype = vertices.dtype
    attributes = _shapes.floats(attributes, "attributes").astype(dtype)
    attributes = attributes[None] if attributes.ndim == 2 else attributes
    texture = None if texture is None else _shapes.floats(texture, "texture").astype(dtype)
    corners = None if corners is None else _shapes.faces(corners, "corners")
    channels = _shapes.attributes(
        attributes.shape, vertices.shape[0], renderer.least_vertices if corners is None else corners.max(initial=-1) + 1,
        None if texture is None else texture.shape,
    )
    background = _np.asarray(_shapes.as_array(background, "background"), dtype)
    _shapes.background(background.shape, channels)
    log_weight = renderer.log_weight if log_weight is None else float(log_weight)
    phi, phi_depth = (
        _shapes.vector(own if given is None else given, name)
        for given, own, name in [(phi, renderer.phi, "phi"), (phi_depth, renderer.phi_depth, "phi_depth")]
    )
    _shapes.parameters("phi", phi.shape, len(renderer._phi[0]))
    size = None if texture is None else texture.shape[:2]
    if texture is not None:
        texture = _np.pad(texture.reshape(-1, channels), ((0, 0), (0, 4 - channels)))
    behind = _np.append(_np.broadcast_to(background, channels), log_weight).astype(dtype)
    function = renderer._blend(corners, size)
    inputs = [vertices.swapaxes(1, 2), attributes, _np.concatenate([phi, phi_depth]), behind, *([] if texture is None else [texture])]
    return function.call("image", [_np.ascontiguousarray(array) for array in inputs], [], [])[0]
