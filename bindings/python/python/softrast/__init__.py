"""Soft silhouettes of triangle meshes, with exact first and second derivatives, on any CPU.

This module needs NumPy alone and draws; `softrast.torch` has the same functions with gradients.

Vertices are `[views, V, 3]`: world units with y up before `project`, then x and y in NDC (x right, y up, the shorter side of the image is
[-1, 1]) and the camera depth in world units. Images are `[views, height, width]`, top row first. Float types are float32 and float64.
"""

import numpy as _np

from . import _native, _shapes
from ._native import Softness, families, learned_names

__all__ = [
    "Renderer", "Softness", "families", "fox", "hard_silhouette", "icosphere", "learned_names", "load_mesh", "orbit", "project",
    "save_mesh", "silhouette",
]


class Renderer(_native.Renderer):
    """What an image depends on beside the vertices and φ.

    `faces` `[F, 3]` are vertex numbers from 0. `size` is a number of pixels for a square, or `(height, width)`. `softness` is a
    `Softness`, at `part` (0 to 1) of its run. `tolerance` bounds the error of any pixel. `t_conorm` combines the coverages of faces:
    "probabilistic", "einstein", "hamacher:p", "frank:p", "yager:p", "aczel_alsina:p", "dombi:p" or "schweizer_sklar:p".

    Raises `ValueError` if one of them is out of range.
    """

    def __new__(cls, faces, size, softness, *, part=0.0, tolerance=1e-5, t_conorm="probabilistic"):
        return super().__new__(cls, _shapes.faces(faces), _shapes.size(size), softness, part, tolerance, t_conorm)


def load_mesh(path):
    """Reads OBJ, PLY, STL or GLB: positions `[V, 3]` (float64), faces `[F, 3]` (int64), and colours `[V, 3]` in [0, 1] or None."""
    return _native.load_mesh(path)


def save_mesh(path, positions, faces, colours=None):
    """Writes OBJ, PLY or GLB by the ending of `path`, whole or not at all; arguments as `load_mesh` returns them."""
    colours = None if colours is None else _np.asarray(colours, _np.float64)
    _native.save_mesh(path, _np.asarray(positions, _np.float64), _shapes.faces(faces), colours)


def fox():
    """The fox of the examples, as `load_mesh` returns a mesh."""
    return _native.fox()


def icosphere(subdivisions):
    """A sphere of radius 1 with `20 * 4**subdivisions` faces, as `load_mesh` returns a mesh."""
    return _native.icosphere(subdivisions)


def orbit(distance, elevation_deg=0.0, azimuth_deg=0.0, fov_deg=60.0):
    """Cameras `[views, 4]` (float64) that look at the origin: distance in world units, angles and whole field of view in degrees.

    Numbers or vectors `[views]`. At azimuth 0 a camera stands at -z with +x on its left.
    """
    return _np.stack(_np.broadcast_arrays(*map(_np.atleast_1d, (distance, elevation_deg, azimuth_deg, fov_deg))), -1).astype(_np.float64)


def project(vertices, cameras):
    """World vertices `[1 or views, V, 3]` as cameras see them, `[views, V, 3]`.

    `cameras` are orbits `[views, 4]` or matrices `[views, 3, 4]`, of which two rows give x and y in NDC times the depth, the third the
    depth. Both must have one float type.
    """
    vertices, cameras = _np.ascontiguousarray(vertices), _np.ascontiguousarray(cameras)
    _shapes.project(vertices.shape, cameras.shape)
    if cameras.ndim == 2:
        cameras = _native.orbit_matrix().forward([cameras])
    return _native.perspective().forward([vertices, cameras]).swapaxes(1, 2)


def silhouette(renderer, vertices, phi=None):
    """Coverage `[views, height, width]` in [0, 1] of projected `vertices` `[views, V, 3]`, under φ `[P]` or the renderer's own."""
    vertices = _np.asarray(vertices)
    _shapes.vertices(vertices.shape, renderer.least_vertices)
    phi = renderer.phi if phi is None else _np.asarray(phi, _np.float64)
    prepared = renderer.prepared(phi)
    table = prepared.table().forward([_np.ascontiguousarray(phi)]).astype(vertices.dtype)
    sums = prepared.sum().forward([_np.ascontiguousarray(vertices.swapaxes(1, 2)), table])
    return prepared.coverage().forward([sums])


def hard_silhouette(vertices, faces, size):
    """1 where the centre of a pixel lies in a face, else 0: `[views, height, width]`, float32, of projected `vertices` `[views, V, 3]`."""
    vertices, faces = _np.asarray(vertices, _np.float64), _shapes.faces(faces)
    _shapes.vertices(vertices.shape, faces.max() + 1 if faces.size else 0)
    return _native.hard_silhouette(vertices, faces, _shapes.size(size))
