"""Cameras by their matrices, for arrays of any framework."""

from . import _shapes

# Signs of the axes of a convention against those of OpenCV: x right, y down, z ahead.
_AXES = {"opencv": (1.0, 1.0, 1.0), "opengl": (1.0, -1.0, -1.0), "pytorch3d": (-1.0, -1.0, 1.0)}


def pinhole(of, K, R, t, size, convention):
    """Matrices `[views, 3, 4]` by the functions `of` a framework; see `softrast.pinhole`."""
    if convention not in _AXES:
        raise ValueError(f"convention must be one of {', '.join(_AXES)}, found {convention!r}")
    shapes = [list(x.shape) for x in (K, R, t)]
    views = max([shape[0] for shape, whole in zip(shapes, (3, 3, 2)) if len(shape) == whole], default=1)
    ends = ([3, 3], [3, 3], [3])
    for shape, end in zip(shapes, ends):
        if views == 0 or shape not in (end, [1, *end], [views, *end]):
            raise ValueError(f"K, R and t must be [3, 3], [3, 3] and [3], or have views first, found {shapes[0]}, {shapes[1]} and {shapes[2]}")
    height, width = _shapes.size(size)
    K, R, t = (of.broadcast_to(x, (views, *end)) for x, end in zip((K, R, t), ends))
    # Rows of R, or columns where points are row vectors, and the translation behind them.
    x, y, z = (
        of.stack([*((R[:, k, axis] if convention == "pytorch3d" else R[:, axis, k]) for k in range(3)), t[:, axis]], -1) * sign
        for axis, sign in enumerate(_AXES[convention])
    )
    focal, skew, middle = K[:, :2, :2], K[:, :1, 1], K[:, :2, 2]
    half = 2.0 / min(height, width)
    # The centre of the first pixel is at 0 in pixels, and half a pixel from the corner of the image.
    right = half * (focal[:, :1, 0] * x + skew * y + (middle[:, :1] + 0.5 - 0.5 * width) * z)
    down = half * (focal[:, 1:, 1] * y + (middle[:, 1:] + 0.5 - 0.5 * height) * z)
    return of.stack([right, -down, z], 1)
