"""`project` and `silhouette` for PyTorch, differentiable twice, on the CPU.

Gradients reach vertices, cameras and φ. A third derivative raises an error.
"""

import numpy as np
import torch as _torch

from . import _native, _shapes

__all__ = ["project", "silhouette"]


def _array(tensor):
    return tensor.detach().contiguous().numpy()


def _parts(flat, shapes):
    sizes = [int(np.prod(shape)) for shape in shapes]
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
        if not isinstance(x, _torch.Tensor) or x.device.type != "cpu" or x.dtype not in (_torch.float32, _torch.float64):
            found = f"{x.dtype} on {x.device}" if isinstance(x, _torch.Tensor) else type(x).__name__
            raise ValueError(f"{name} must be a float32 or float64 tensor on the CPU, found {found}")


def project(vertices, cameras):
    """World vertices `[1 or views, V, 3]` as cameras see them, `[views, V, 3]`; see `softrast.project`."""
    _tensors(vertices=vertices, cameras=cameras)
    _shapes.project(vertices.shape, cameras.shape)
    cameras = cameras.to(vertices.dtype)
    if cameras.dim() == 2:
        cameras = _Value.apply(_native.orbit_matrix(), cameras)
    return _Value.apply(_native.perspective(), vertices, cameras).transpose(1, 2)


def silhouette(renderer, vertices, phi=None):
    """Coverage `[views, height, width]` in [0, 1] of projected `vertices` `[views, V, 3]`, under φ `[P]` or the renderer's own.

    Support and knots follow the values of φ. The table of φ is computed in float64 and rounded to the type of the vertices.
    """
    _tensors(vertices=vertices)
    _shapes.vertices(vertices.shape, renderer.least_vertices)
    phi = _torch.from_numpy(renderer.phi) if phi is None else phi
    _tensors(phi=phi)
    prepared = renderer.prepared(phi.detach().double().numpy())
    table = _Value.apply(prepared.table(), phi).to(vertices.dtype)
    sums = _Value.apply(prepared.sum(), vertices.transpose(1, 2).contiguous(), table)
    return _Value.apply(prepared.coverage(), sums)
