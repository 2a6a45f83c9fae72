"""`orbit`, `project` and `silhouette` for JAX, differentiable twice in reverse mode, on the CPU.

They work under `jax.jit` and `jax.vmap`, by callbacks to the host. Gradients reach vertices, cameras and φ. Take `jax.jacrev(jax.grad(f))` for
second derivatives: there is no forward mode and no third derivative. Without `jax_enable_x64`, all is float32. Arguments, shapes and units are
those of `softrast`, with JAX arrays in the place of NumPy's.
"""

from __future__ import annotations

import functools as _functools
from typing import Optional as _Optional

import jax as _jax
import jax.numpy as _jnp
import numpy as _np
from jax.typing import ArrayLike as _ArrayLike

import softrast as _softrast

from . import _passes, _shapes

__all__ = ["orbit", "project", "silhouette"]


def _on_host(passes, like, of, axes, *arrays):
    """What `of` makes on the host of arrays with these numbers of axes, and of more axes in front under `vmap`; `like` has its shapes."""
    def call(*arrays):
        arrays = [_np.ascontiguousarray(array) for array in arrays]
        lead = _np.broadcast_shapes(*(array.shape[:array.ndim - axis] for array, axis in zip(arrays, axes)))
        if not lead:
            return tuple(of(*arrays))
        spread = [_np.broadcast_to(array, lead + array.shape[array.ndim - axis:]) for array, axis in zip(arrays, axes)]
        if passes.views:
            # All that is computed of a view is its own, so views of all scenes go through in one call.
            flat = [_np.ascontiguousarray(array).reshape(-1, *array.shape[len(lead) + 1:]) for array in spread]
            return tuple(found.reshape(*lead, -1, *found.shape[1:]) for found in of(*flat))
        found = [of(*(_np.ascontiguousarray(array[at]) for array in spread)) for at in _np.ndindex(*lead)]
        return tuple(_np.stack(parts).reshape(*lead, *parts[0].shape) for parts in zip(*found))

    return _jax.pure_callback(call, tuple(like), *arrays, vmap_method="expand_dims")


def _like(arrays):
    return [_jax.ShapeDtypeStruct(array.shape, array.dtype) for array in arrays]


@_functools.partial(_jax.custom_vjp, nondiff_argnums=(0, 1))
def _value(passes, shape, inputs):
    """The value, of this shape, and what is kept, which is of the same shape and passes on no gradient of its own."""
    like = [_jax.ShapeDtypeStruct(shape, inputs[0].dtype)] * (1 + passes.keeps)

    def of(*inputs):
        value, kept = passes.forward(*inputs)
        return [value, *kept]

    value, *kept = _on_host(passes, like, of, passes.axes, *inputs)
    return value, kept


def _value_forward(passes, shape, inputs):
    value, kept = _value(passes, shape, inputs)
    return (value, kept), (inputs, kept)


def _value_back(passes, shape, saved, upstream):
    return (_vjp(passes, *saved, upstream[0]),)


_value.defvjp(_value_forward, _value_back)


@_functools.partial(_jax.custom_vjp, nondiff_argnums=(0,))
def _vjp(passes, inputs, kept, upstream):
    of = lambda *all: passes.vjp(all[:len(inputs)], all[len(inputs):-1], all[-1])
    axes = (*passes.axes, *(array.ndim for array in kept), upstream.ndim)
    return _on_host(passes, _like(inputs), of, axes, *inputs, *kept, upstream)


def _vjp_forward(passes, inputs, kept, upstream):
    return _vjp(passes, inputs, kept, upstream), (inputs, kept, upstream)


def _vjp_back(passes, saved, directions):
    inputs, kept, upstream = saved
    count, ends = len(inputs), len(inputs) + len(kept)
    of = lambda *all: passes.vjp_of_vjp(all[:count], all[count:ends], all[ends], all[ends + 1:])
    axes = (*passes.axes, *(array.ndim for array in kept), upstream.ndim, *passes.axes)
    *to_inputs, to_upstream = _on_host(passes, _like([*inputs, upstream]), of, axes, *inputs, *kept, upstream, *directions)
    # What is kept is a function of the inputs: they have its share.
    return tuple(to_inputs), [_jnp.zeros_like(array) for array in kept], to_upstream


_vjp.defvjp(_vjp_forward, _vjp_back)


def _floats(array, name):
    array = array if isinstance(array, _jax.Array) else _jnp.asarray(_shapes.floats(array, name))
    if array.dtype not in (_jnp.float32, _jnp.float64):
        raise ValueError(f"{name} must be float32 or float64, found {array.dtype}: convert with astype")
    return array


def orbit(distance: _ArrayLike, elevation_deg: _ArrayLike = 0.0, azimuth_deg: _ArrayLike = 0.0, fov_deg: _ArrayLike = 60.0) -> _jax.Array:
    """Cameras `[views, 4]` that look at the origin: distance in world units, angles and whole field of view in degrees.

    Numbers or vectors `[views]`; see `softrast.orbit`.
    """
    numbers = [_jnp.atleast_1d(_jnp.asarray(x, dtype=_jnp.result_type(float))) for x in (distance, elevation_deg, azimuth_deg, fov_deg)]
    return _jnp.stack(_jnp.broadcast_arrays(*numbers), -1)


def project(vertices: _ArrayLike, cameras: _ArrayLike) -> _jax.Array:
    """World vertices `[V, 3]` or `[1 or views, V, 3]` as cameras see them, `[views, V, 3]`: x and y in NDC, depth in world units.

    `cameras` are orbits `[views, 4]` or matrices `[views, 3, 4]`; see `softrast.project`.
    """
    vertices, cameras = _floats(vertices, "vertices"), _floats(cameras, "cameras")
    cameras = cameras.astype(vertices.dtype)
    vertices = vertices[None] if vertices.ndim == 2 else vertices
    _shapes.project(vertices.shape, cameras.shape)
    views, count = cameras.shape[0], vertices.shape[1]
    if cameras.ndim == 2:
        cameras = _value(_passes.ORBIT_MATRIX, (views, 3, 4), (cameras,))[0]
    return _jnp.swapaxes(_value(_passes.PERSPECTIVE, (views, 3, count), (vertices, cameras))[0], 1, 2)


def silhouette(renderer: _softrast.Renderer, vertices: _ArrayLike, phi: _Optional[_ArrayLike] = None) -> _jax.Array:
    """Coverage `[views, height, width]` in [0, 1] of projected `vertices` `[views, V, 3]`, under φ `[P]` or the renderer's own.

    Support and knots follow the values of φ, which may be traced. The table of φ is computed in float64 and rounded to the type of the
    vertices. Where the softness has a surrogate, the gradient to the vertices is that of the surrogate, and there is none to φ.
    """
    vertices = _floats(vertices, "vertices")
    _shapes.vertices(vertices.shape, renderer.least_vertices)
    inputs = [_jnp.swapaxes(vertices, 1, 2)]
    if phi is not None:
        phi = _floats(phi, "phi")
        if phi.shape != renderer.phi.shape:
            raise ValueError(f"phi must be [{len(renderer.phi)}], found {list(phi.shape)}")
        inputs.append(phi)
    passes = _passes.Silhouette(renderer, phi is None)
    return _value(passes, (vertices.shape[0], *renderer.size), tuple(inputs))[0]
