"""The functions of `softrast` for PyTorch, differentiable twice, on the CPU.

Gradients reach vertices, cameras, attributes, background, texture and φ. A third derivative raises an error. Arguments, shapes and units
are those of `softrast`, with tensors in the place of arrays.
"""

from __future__ import annotations

from typing import Optional as _Optional, Union as _Union

import numpy as _np
import torch as _torch

import softrast as _softrast

from . import _native, _shapes

__all__ = ["blend", "from_clip", "hard_silhouette", "orbit", "project", "silhouette"]

_Number = _Union[float, _torch.Tensor]

# As near as the rasterizer draws, in world units.
_NEAR = 0.01


def _array(tensor):
    return tensor.detach().contiguous().numpy()


def _parts(flat, shapes):
    sizes = [int(_np.prod(shape)) for shape in shapes]
    return [part.view(shape) for part, shape in zip(_torch.from_numpy(flat).split(sizes), shapes)]


def _spread(parts, wanted):
    """The parts at the places that are wanted, None elsewhere."""
    parts = iter(parts)
    return tuple(next(parts) if want else None for want in wanted)


class _Value(_torch.autograd.Function):
    @staticmethod
    def forward(ctx, op, *inputs):
        ctx.op = op.keeping() if any(ctx.needs_input_grad) else op
        ctx.save_for_backward(*inputs)
        return _torch.from_numpy(ctx.op.forward([_array(x) for x in inputs]))

    @staticmethod
    def backward(ctx, upstream):
        wanted = list(ctx.needs_input_grad[1:])
        gradients = _Vjp.apply(ctx.op, wanted, upstream, *ctx.saved_tensors)
        return (None, *_spread(gradients, wanted))


class _Vjp(_torch.autograd.Function):
    @staticmethod
    def forward(ctx, op, wanted, upstream, *inputs):
        ctx.op, ctx.along = op, wanted
        ctx.save_for_backward(upstream, *inputs)
        flat = op.vjp([_array(x) for x in inputs], _array(upstream), wanted)
        return tuple(_parts(flat, [x.shape for x, want in zip(inputs, wanted) if want]))

    @staticmethod
    @_torch.autograd.function.once_differentiable
    def backward(ctx, *directions):
        upstream, *inputs = ctx.saved_tensors
        to_upstream, *to_inputs = ctx.needs_input_grad[2:]
        wanted = [*to_inputs, to_upstream]
        arrays = [_array(x) for x in inputs]
        flat = ctx.op.vjp_of_vjp(arrays, _array(upstream), [_array(x) for x in directions], ctx.along, wanted)
        shapes = [x.shape for x, want in zip([*inputs, upstream], wanted) if want]
        *gradients, gradient = _spread(_parts(flat, shapes), wanted)
        return (None, None, gradient, *gradients)


def _tensors(**tensors):
    for name, x in tensors.items():
        if not isinstance(x, _torch.Tensor):
            raise ValueError(f"{name} must be a tensor, found {type(x).__name__}: convert it with torch.as_tensor")
        if x.device.type != "cpu":
            raise ValueError(f"{name} must lie on the CPU, found {x.device}: move it with cpu()")
        if x.dtype not in (_torch.float32, _torch.float64):
            raise ValueError(f"{name} must be float32 or float64, found {x.dtype}: convert it with to()")


def orbit(distance: _Number, elevation_deg: _Number = 0.0, azimuth_deg: _Number = 0.0, fov_deg: _Number = 60.0) -> _torch.Tensor:
    """Cameras `[views, 4]` that look at the origin: distance in world units, angles and whole field of view in degrees.

    Numbers, or tensors `[]` or `[views]`, of which the result has the float type; float64 if all are numbers. See `softrast.orbit`.
    """
    numbers = [distance, elevation_deg, azimuth_deg, fov_deg]
    types = [x.dtype for x in numbers if isinstance(x, _torch.Tensor) and x.is_floating_point()]
    dtype = _torch.float64 if not types or _torch.float64 in types else types[0]
    tensors = _torch.broadcast_tensors(*(_torch.atleast_1d(_torch.as_tensor(x, dtype=dtype)) for x in numbers))
    return _torch.stack(tensors, -1)


def project(vertices: _torch.Tensor, cameras: _torch.Tensor) -> _torch.Tensor:
    """World vertices `[V, 3]` or `[1 or views, V, 3]` as cameras see them, `[views, V, 3]`: x and y in NDC, depth in world units.

    `cameras` are orbits `[views, 4]` or matrices `[views, 3, 4]`; see `softrast.project`.
    """
    _tensors(vertices=vertices, cameras=cameras)
    vertices = vertices[None] if vertices.dim() == 2 else vertices
    _shapes.project(vertices.shape, cameras.shape)
    cameras = cameras.to(vertices.dtype)
    if cameras.dim() == 2:
        cameras = _Value.apply(_native.orbit_matrix(), cameras)
    return _Value.apply(_native.perspective(), vertices, cameras).transpose(1, 2)


def from_clip(clip: _torch.Tensor, size: _softrast._Size) -> _torch.Tensor:
    """Vertices in clip space `[views, V, 4]` (x, y, z, w, as for OpenGL and nvdiffrast) as `silhouette` takes them, `[views, V, 3]`.

    `size` is that of the image, as in `Renderer`: clip space has [-1, 1] along both sides, NDC here along the shorter one. The depth is w, so
    w must be that of a perspective projection: the depth ahead of the camera. Images have their top row first, those of nvdiffrast the bottom
    row.
    """
    _tensors(clip=clip)
    if clip.dim() != 3 or clip.shape[2] != 4 or clip.shape[0] == 0:
        raise ValueError(f"clip must be [views, V, 4] with at least one view, found {list(clip.shape)}")
    height, width = _shapes.size(size)
    shorter = min(height, width)
    # A vertex behind the camera is projected as though it were near, so that nothing divides by zero; its faces are not drawn.
    w = clip[..., 3]
    over = 1.0 / w.clamp_min(_NEAR)
    return _torch.stack([clip[..., 0] * over * (width / shorter), clip[..., 1] * over * (height / shorter), w], -1)


def _sums(prepared, vertices, phi):
    """Sums `[views, height, width]` for vertices `[views, 3, V]`; `phi` is a tensor, or a table of numbers."""
    if isinstance(phi, _torch.Tensor):
        table = _Value.apply(prepared.table(), phi).to(vertices.dtype)
    else:
        table = _torch.from_numpy(phi)
    return _Value.apply(prepared.sum(), vertices, table)


def silhouette(renderer: _softrast.Renderer, vertices: _torch.Tensor, phi: _Optional[_torch.Tensor] = None) -> _torch.Tensor:
    """Coverage `[views, height, width]` in [0, 1] of projected `vertices` `[views, V, 3]`, under φ `[P]` or the renderer's own.

    Support and knots follow the values of φ. The table of φ is computed in float64 and rounded to the type of the vertices. Where the softness
    has a surrogate, the gradient to the vertices is that of the surrogate, and there is none to φ.
    """
    _tensors(vertices=vertices)
    _shapes.vertices(vertices.shape, renderer.least_vertices)
    kind = _np.dtype(str(vertices.dtype).split(".")[-1])
    if phi is None:
        prepared, phi = renderer._own(kind)
    else:
        _tensors(phi=phi)
        prepared = renderer.prepared(phi.detach().double().numpy())
    vertices, felt = vertices.transpose(1, 2).contiguous(), renderer._felt(kind)
    if felt is None:
        sums = _sums(prepared, vertices, phi)
    else:
        sums = _sums(prepared, vertices.detach(), phi.detach() if isinstance(phi, _torch.Tensor) else phi)
        if vertices.requires_grad:
            # Nothing is added but the gradient.
            wide = _sums(felt[0], vertices, felt[1])
            sums = sums + (wide - wide.detach())
    return _Value.apply(prepared.coverage(), sums)


def hard_silhouette(vertices: _torch.Tensor, faces: _softrast._ArrayLike, size: _softrast._Size) -> _torch.Tensor:
    """1 where the centre of a pixel lies in a face, else 0: `[views, height, width]` of projected `vertices` `[views, V, 3]`, no gradient.

    `faces` are `[F, 3]`, an array or a tensor; `size` is a number of pixels, or `(height, width)`.
    """
    _tensors(vertices=vertices)
    return _torch.from_numpy(_softrast.hard_silhouette(_array(vertices), faces, size)).to(vertices.dtype)


def blend(
    renderer: _softrast.ColourRenderer, vertices: _torch.Tensor, attributes: _torch.Tensor, background: _Number = 0.0, *,
    corners: _Optional[_softrast._ArrayLike] = None, texture: _Optional[_torch.Tensor] = None, log_weight: _Optional[_Number] = None,
    phi: _Optional[_torch.Tensor] = None, phi_depth: _Optional[_torch.Tensor] = None,
) -> _torch.Tensor:
    """Soft colours, `[views, channels + 1, height, width]`, of projected `vertices` `[views, V, 3]`; the last is the share of the faces.

    `attributes` are `[V, channels]` or `[1 or views, V, channels]`, or entries for `corners` `[F, 3]`, or places on a `texture` `[height,
    width, channels]`; `background` is a number or `[channels]`; see `softrast.blend`. All of them, `log_weight` (a number or `[1]`), `phi`
    `[P]` and `phi_depth` `[Q]` receive gradients of both orders.
    """
    numbers = {"background": background, "log_weight": log_weight}
    given = {name: x for name, x in numbers.items() if isinstance(x, _torch.Tensor)}
    if texture is not None:
        given["texture"] = texture
    _tensors(vertices=vertices, attributes=attributes, **given)
    _shapes.vertices(vertices.shape, renderer.least_vertices)
    dtype = vertices.dtype
    attributes = attributes[None] if attributes.dim() == 2 else attributes
    corners = None if corners is None else _shapes.faces(corners, "corners")
    least = renderer.least_vertices if corners is None else corners.max(initial=-1) + 1
    channels = _shapes.attributes(attributes.shape, vertices.shape[0], least, None if texture is None else tuple(texture.shape))
    background = _torch.as_tensor(background, dtype=dtype)
    _shapes.background(background.shape, channels)
    log_weight = _torch.as_tensor(renderer.log_weight if log_weight is None else log_weight, dtype=dtype)
    if log_weight.numel() != 1:
        raise ValueError(f"log_weight must be a number or [1], found {list(log_weight.shape)}")
    phi = _torch.from_numpy(renderer.phi) if phi is None else phi
    phi_depth = _torch.from_numpy(renderer.phi_depth) if phi_depth is None else phi_depth
    _tensors(phi=phi, phi_depth=phi_depth)
    for name, x in [("attributes", attributes), ("background", background), ("texture", texture)]:
        _shapes.finite(x is None or bool(x.isfinite().all()), name)
    values = [x.detach().double().numpy() for x in (phi, phi_depth)]
    size = None if texture is None else tuple(texture.shape[:2])
    prepared = renderer.prepared(*values, log_weight.item(), corners, size)
    tables = _Value.apply(prepared.tables(), _torch.cat([phi.double(), phi_depth.double()])).to(dtype)
    behind = _torch.cat([background.expand(channels), log_weight.reshape(1)])
    inputs = [vertices.transpose(1, 2).contiguous(), attributes.to(dtype), tables, behind]
    if texture is not None:
        inputs.append(_torch.nn.functional.pad(texture.to(dtype).reshape(-1, channels), (0, 4 - channels)))
    return _Value.apply(prepared.blend(), *inputs)
