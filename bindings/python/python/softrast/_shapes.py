"""Checks of what users pass, each with an error of one line."""

import numpy as np


def faces(faces):
    """Faces as int64 `[F, 3]`."""
    faces = np.asarray(faces)
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise ValueError(f"faces must be integers [F, 3], found {faces.dtype} {list(faces.shape)}")
    return faces.astype(np.int64)


def size(size):
    """Height and width."""
    pair = [size, size] if np.ndim(size) == 0 else list(size)
    if len(pair) != 2 or any(int(side) != side or side < 1 for side in pair):
        raise ValueError(f"size must be a number of pixels or (height, width), found {size}")
    return [int(side) for side in pair]


def vertices(shape, least):
    """Projected vertices that the faces find."""
    shape = list(shape)
    if len(shape) != 3 or shape[2] != 3 or shape[0] == 0:
        raise ValueError(f"vertices must be [views, V, 3] with at least one view, found {shape}")
    if shape[1] < least:
        raise ValueError(f"a face uses vertex {least - 1}, but there are {shape[1]}")


def project(points, cameras):
    """World vertices and cameras that go together."""
    points, cameras = list(points), list(cameras)
    if len(cameras) not in (2, 3) or cameras[1:] not in ([4], [3, 4]) or cameras[0] == 0:
        raise ValueError(f"cameras must be orbits [views, 4] or matrices [views, 3, 4], found {cameras}")
    if len(points) != 3 or points[2] != 3 or points[0] not in (1, cameras[0]):
        raise ValueError(f"vertices must be [1 or {cameras[0]}, V, 3], found {points}")
