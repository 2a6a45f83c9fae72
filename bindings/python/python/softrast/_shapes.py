"""Checks of what users pass, each with an error of one line."""

import numpy as np

from ._native import Softness


def softness(found):
    if not isinstance(found, Softness):
        raise ValueError(f"softness must be a softrast.Softness such as Softness('logistic', 0.01), found {type(found).__name__}")


# The CPU among the devices of DLPack.
_CPU = 1


def as_array(found, name):
    """An array of NumPy: the same numbers without a copy where what is given has `__dlpack__`, as tensors of torch and arrays of JAX."""
    if isinstance(found, np.ndarray):
        return found
    if hasattr(found, "__dlpack__") and hasattr(np, "from_dlpack"):
        if found.__dlpack_device__()[0] != _CPU:
            raise ValueError(f"{name} must lie on the CPU: move it there first")
        try:
            return np.from_dlpack(found)
        except (BufferError, RuntimeError, TypeError, ValueError):
            pass  # Types that DLPack or NumPy does not know; tensors with gradients fail below too.
    try:
        return np.asarray(found)
    except Exception as error:
        raise ValueError(f"{name} is no array: {' '.join(str(error).split())}") from None


def floats(found, name):
    """An array of floats as it is, numbers of other types refused."""
    array = as_array(found, name)
    if array.dtype not in (np.float32, np.float64):
        raise ValueError(f"{name} must be float32 or float64, found {array.dtype}: convert with astype")
    return array


def vector(array, name):
    """Parameters as float64 `[P]`."""
    array = as_array(array, name).astype(np.float64)
    if array.ndim != 1:
        raise ValueError(f"{name} must be a vector, found {list(array.shape)}")
    return np.ascontiguousarray(array)


def rows(array, name):
    """float64 `[N, 3]`."""
    array = np.asarray(as_array(array, name), np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name} must be [N, 3], found {list(array.shape)}")
    return array


def faces(faces, name="faces"):
    """Faces as int64 `[F, 3]`."""
    faces = as_array(faces, name)
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise ValueError(f"{name} must be integers [F, 3], found {faces.dtype} {list(faces.shape)}")
    return faces.astype(np.int64, copy=False)


def size(size):
    """Height and width."""
    try:
        pair = [size, size] if np.ndim(size) == 0 else list(size)
        fits = len(pair) == 2 and all(int(side) == side and side >= 1 for side in pair)
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise ValueError(f"size must be a number of pixels or (height, width), found {size}")
    return [int(side) for side in pair]


def whole(number, name, least):
    """A whole number that is at least this."""
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or number < least:
        raise ValueError(f"{name} must be a whole number from {least} on, found {number!r}")
    return int(number)


def mask(mask):
    """A mask as float32 `[height, width]` in [0, 1]."""
    levels = as_array(mask, "mask")
    if levels.ndim != 2 or levels.dtype.kind not in "bf":
        raise ValueError(f"mask must be [height, width] of bool or float in [0, 1], found {levels.dtype} {list(levels.shape)}")
    levels = levels.astype(np.float32)
    if not ((levels >= 0.0) & (levels <= 1.0)).all():
        raise ValueError("mask must be in [0, 1], found a level that is not")
    return levels


def planes(planes):
    """A near and a far depth."""
    if np.shape(planes) != (2,):
        raise ValueError(f"planes must be a near and a far depth, found {planes}")
    return [float(plane) for plane in planes]


def vertices(shape, least):
    """Projected vertices that the faces find."""
    shape = list(shape)
    if len(shape) != 3 or shape[2] != 3 or shape[0] == 0:
        raise ValueError(f"vertices must be [views, V, 3] with at least one view, as project returns them, found {shape}")
    if shape[1] < least:
        raise ValueError(f"a face uses vertex {least - 1}, but there are {shape[1]}")


def project(points, cameras):
    """How many views there are, of world vertices and cameras that go together."""
    points, cameras = list(points), list(cameras)
    if len(cameras) not in (2, 3) or cameras[1:] not in ([4], [3, 4]) or cameras[0] == 0:
        raise ValueError(f"cameras must be orbits [views, 4] or matrices [views, 3, 4], found {cameras}")
    if len(points) != 3 or points[2] != 3 or points[0] == 0 or points[0] != 1 and cameras[0] not in (1, points[0]):
        raise ValueError(f"vertices must be [V, 3] or [1 or {cameras[0]}, V, 3], found {points}")
    return max(points[0], cameras[0])


def parameters(name, shape, count):
    """Parameters of a softness that has this many."""
    if list(shape) != [count]:
        raise ValueError(f"{name} must be [{count}], found {list(shape)}")


def images(image, target):
    """An image and what it is compared with."""
    image, target = list(image), list(target)
    if len(image) != 3 or image[0] == 0 or len(target) != 3 or target[1:] != image[1:] or target[0] not in (1, image[0]):
        raise ValueError(f"image must be [views, height, width] and target [1 or views, height, width], found {image} and {target}")


def attributes(shape, views, least, texture):
    """How many channels are seen, of attributes `[1 or views, entries, numbers]` and the shape of a texture or None."""
    shape = list(shape)
    if len(shape) != 3 or shape[0] not in (1, views) or shape[2] == 0:
        raise ValueError(f"attributes must be [entries, channels] or [1 or {views}, entries, channels], found {shape}")
    if shape[1] < least:
        raise ValueError(f"a corner has entry {least - 1}, but there are attributes of {shape[1]}")
    if texture is None:
        return shape[2]
    if len(texture) != 3 or not 1 <= texture[2] <= 4 or not 1 <= texture[0] * texture[1] <= 1 << 26:
        raise ValueError(f"texture must be [height, width, 1 to 4 channels] of at most 2**26 texels, found {list(texture)}")
    if shape[2] != 2:
        raise ValueError(f"attributes on a texture must be places with 2 numbers, found {shape}")
    return texture[2]


def background(shape, channels):
    """A number, or one for each channel."""
    if list(shape) not in ([], [channels]):
        raise ValueError(f"background must be a number or [{channels}], found {list(shape)}")


def finite(fits, name):
    if not fits:
        raise ValueError(f"{name} must be finite, found a number that is not")
