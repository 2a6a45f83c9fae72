"""The functions of `softrast` for JAX, differentiable twice in forward and reverse mode, on the CPU.

They work under `jax.jit` and `jax.vmap`; XLA calls compiled functions without Python. Gradients reach vertices, cameras, attributes, background,
texture and φ; `jax.grad`, `jacfwd`, `jacrev`, `jvp` and `hessian` work, and a third derivative is a `ValueError`. Without `jax_enable_x64`, all is
float32. Arguments, shapes and units are those of `softrast`, with JAX arrays in the place of NumPy's.
"""

from __future__ import annotations

from typing import Optional as _Optional

import jax as _jax
import jax.numpy as _jnp
from jax.typing import ArrayLike as _ArrayLike

import softrast as _softrast

from . import _cameras, _passes, _primitives, _shapes

__all__ = ["blend", "iou_loss", "mse_loss", "orbit", "pinhole", "project", "silhouette", "silhouette_loss"]

_LOSSES = {"mse": _passes.MSE_LOSS, "iou": _passes.IOU_LOSS}
_HALVES = (_jnp.float16, _jnp.bfloat16)


def _floats(array, name):
    array = array if isinstance(array, _jax.Array) else _jnp.asarray(_shapes.floats(array, name))
    if array.dtype in _HALVES:
        return array.astype(_jnp.float32)
    if array.dtype not in (_jnp.float32, _jnp.float64):
        raise ValueError(f"{name} must be float32 or float64, found {array.dtype}: convert with astype")
    return array


def orbit(distance: _ArrayLike, elevation_deg: _ArrayLike = 0.0, azimuth_deg: _ArrayLike = 0.0, fov_deg: _ArrayLike = 60.0) -> _jax.Array:
    """Cameras `[views, 4]` that look at the origin: distance in world units, angles and whole field of view in degrees.

    Numbers or vectors `[views]`; see `softrast.orbit`.
    """
    numbers = [_jnp.atleast_1d(_jnp.asarray(x, dtype=_jnp.result_type(float))) for x in (distance, elevation_deg, azimuth_deg, fov_deg)]
    return _jnp.stack(_jnp.broadcast_arrays(*numbers), -1)


def pinhole(K: _ArrayLike, R: _ArrayLike, t: _ArrayLike, size: _softrast._Size, convention: str = "opencv") -> _jax.Array:
    """Cameras `[views, 3, 4]` of matrices `K` and poses `R`, `t`; see `softrast.pinhole`."""
    K, R, t = (_jnp.asarray(x, dtype=_jnp.result_type(float)) for x in (K, R, t))
    return _cameras.pinhole(_jnp, K, R, t, size, convention)


def project(vertices: _ArrayLike, cameras: _ArrayLike) -> _jax.Array:
    """World vertices `[V, 3]` or `[1 or views, V, 3]` as cameras see them, `[views, V, 3]`: x and y in NDC, depth in world units.

    `cameras` are orbits `[1 or views, 4]` or matrices `[1 or views, 3, 4]`; see `softrast.project`.
    """
    vertices, cameras = _floats(vertices, "vertices"), _floats(cameras, "cameras")
    cameras = cameras.astype(vertices.dtype)
    vertices = vertices[None] if vertices.ndim == 2 else vertices
    views = _shapes.project(vertices.shape, cameras.shape)
    if cameras.ndim == 2:
        cameras = _primitives.value(_passes.ORBIT_MATRIX, [cameras])
    cameras = _jnp.broadcast_to(cameras, (views, 3, 4))
    return _jnp.swapaxes(_primitives.value(_passes.PERSPECTIVE, [vertices, cameras]), 1, 2)


def silhouette(renderer: _softrast.Renderer, vertices: _ArrayLike, phi: _Optional[_ArrayLike] = None) -> _jax.Array:
    """Coverage `[views, height, width]` in [0, 1] of projected `vertices` `[views, V, 3]`, under φ `[P]` or the renderer's own.

    Support and knots follow the values of φ, which may be traced. The table of φ is computed in float64 and rounded to the type of the
    vertices. Where the softness has a surrogate, the gradient to the vertices is that of the surrogate, and the gradient to φ is 0.
    """
    vertices = _floats(vertices, "vertices")
    _shapes.vertices(vertices.shape, renderer._least)
    inputs = [_jnp.swapaxes(vertices, 1, 2)]
    if phi is None:
        return _primitives.value(renderer._by_own, inputs)
    phi = _floats(phi, "phi")
    _shapes.parameters("phi", phi.shape, renderer._parameters)
    return _primitives.value(renderer._by_phi, [*inputs, phi])


def mse_loss(image: _ArrayLike, target: _ArrayLike) -> _jax.Array:
    """Mean squared difference of each view, `[views]`, of an `image` `[views, height, width]` and a `target` `[1 or views, height, width]`."""
    return _loss(_passes.MSE_LOSS, image, target)


def iou_loss(image: _ArrayLike, target: _ArrayLike) -> _jax.Array:
    """One less the overlap over the union of each view, `[views]` in [0, 1]: `1 - sum(p t) / (sum(p + t - p t) + 1e-6)`.

    Both images are coverages in [0, 1], of the shapes of `mse_loss`. Two empty images have the loss 1.
    """
    return _loss(_passes.IOU_LOSS, image, target)


def _loss(function, image, target):
    image, target = _floats(image, "image"), _floats(target, "target")
    _shapes.images(image.shape, target.shape)
    return _primitives.value(function, [image, target.astype(image.dtype)])


def silhouette_loss(
    renderer: _softrast.Renderer, vertices: _ArrayLike, target: _ArrayLike, loss: str = "mse", phi: _Optional[_ArrayLike] = None,
) -> _jax.Array:
    """Losses `[views]` of the `silhouette` against a `target` `[1 or views, height, width]`; `loss` is "mse" or "iou".

    See `softrast.torch.silhouette_loss`: it is one op under the same conditions.
    """
    if loss not in _LOSSES:
        raise ValueError(f"loss must be one of {', '.join(_LOSSES)}, found {loss!r}")
    if phi is not None or loss not in renderer._losses:
        return _loss(_LOSSES[loss], silhouette(renderer, vertices, phi), target)
    vertices, target = _floats(vertices, "vertices"), _floats(target, "target")
    _shapes.vertices(vertices.shape, renderer._least)
    _shapes.images((vertices.shape[0], *renderer._size), target.shape)
    return _primitives.value(renderer._losses[loss], [_jnp.swapaxes(vertices, 1, 2), target.astype(vertices.dtype)])


def blend(
    renderer: _softrast.ColourRenderer, vertices: _ArrayLike, attributes: _ArrayLike, background: _ArrayLike = 0.0, *,
    corners: _Optional[_softrast._ArrayLike] = None, texture: _Optional[_ArrayLike] = None, log_weight: _Optional[_ArrayLike] = None,
    phi: _Optional[_ArrayLike] = None, phi_depth: _Optional[_ArrayLike] = None,
) -> _jax.Array:
    """Soft colours, `[views, channels + 1, height, width]`, of projected `vertices` `[views, V, 3]`; the last is the share of the faces.

    `attributes` are `[V, channels]` or `[1 or views, V, channels]`, or entries for `corners` `[F, 3]` (an array of NumPy), or places on a `texture`
    `[height, width, channels]`; `background` is a number or `[channels]`, `log_weight` a number or `[1]`; see `softrast.blend`.
    """
    vertices, attributes = _floats(vertices, "vertices"), _floats(attributes, "attributes")
    dtype = vertices.dtype
    _shapes.vertices(vertices.shape, renderer._least)
    attributes = attributes[None] if attributes.ndim == 2 else attributes
    corners = None if corners is None else _shapes.faces(corners, "corners")
    texture = None if texture is None else _floats(texture, "texture").astype(dtype)
    least = renderer._least if corners is None else corners.max(initial=-1) + 1
    channels = _shapes.attributes(attributes.shape, vertices.shape[0], least, None if texture is None else texture.shape)
    background = _jnp.asarray(background, dtype)
    _shapes.background(background.shape, channels)
    log_weight = _jnp.asarray(renderer._log_weight if log_weight is None else log_weight, dtype)
    if log_weight.size != 1:
        raise ValueError(f"log_weight must be a number or [1], found {list(log_weight.shape)}")
    both = []
    for x, own, name in ((phi, renderer._phi[0], "phi"), (phi_depth, renderer._phi[1], "phi_depth")):
        x = _jnp.asarray(own, _jnp.result_type(float)) if x is None else _floats(x, name)
        _shapes.parameters(name, x.shape, len(own))
        both.append(x)
    behind = _jnp.append(_jnp.broadcast_to(background, channels), log_weight.reshape(1))
    inputs = [_jnp.swapaxes(vertices, 1, 2), attributes.astype(dtype), _jnp.concatenate(both), behind]
    if texture is not None:
        inputs.append(_jnp.pad(texture.reshape(-1, channels), ((0, 0), (0, 4 - channels))))
    return _primitives.value(renderer._blend(corners, None if texture is None else texture.shape[:2]), inputs)
