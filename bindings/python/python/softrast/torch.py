"""The functions of `softrast` for PyTorch, differentiable twice, on the CPU, and on request on CUDA devices.

Gradients reach vertices, cameras, attributes, background, texture and φ, in reverse and in forward mode: `torch.autograd`, `torch.func.grad`,
`vmap`, `jacrev`, `jacfwd`, `jvp` and `hessian` work, and `torch.compile(fullgraph=True)` with first derivatives. A third derivative raises an
error. Arguments, shapes and units are those of `softrast`, with tensors in the place of arrays; float16 and bfloat16 are converted to float32,
and so are the results.

A tensor on a CUDA device raises an error, unless the wheel was built with the feature `cuda` and the environment variable `SOFTRAST_CUDA` is 1
at the import. Then float32 vertices are drawn on their device, to which the other arguments are moved; only φ is read on the CPU. **CUDA has
not been run on a card yet.**
"""

from __future__ import annotations

import os as _os
from typing import Any as _Any, List as _List, Optional as _Optional, Sequence as _Sequence, Tuple as _Tuple, Union as _Union

import torch as _torch

import softrast as _softrast

from . import _cameras, _ops, _passes, _shapes

__all__ = [
    "blend", "blends", "from_clip", "hard_silhouette", "hvp", "iou_loss", "jvp", "mse_loss", "orbit", "pinhole", "project", "silhouette",
    "silhouette_loss", "silhouettes", "value_and_grad",
]

_Number = _Union[float, _torch.Tensor]

# As near as the rasterizer draws, in world units.
_NEAR = 0.01
# Until it has been seen to work, CUDA is only for those who ask for it.
_ON_CUDA = _os.environ.get("SOFTRAST_CUDA") == "1" and _softrast._native.has_cuda()
_HALVES = (_torch.float16, _torch.bfloat16)
# Plain strings, which torch.compile reads.
_ORBIT_MATRIX, _PERSPECTIVE = _passes.ORBIT_MATRIX.handle, _passes.PERSPECTIVE.handle
_LOSSES = {"mse": ("mse_loss", _passes.MSE_LOSS.handle), "iou": ("iou_loss", _passes.IOU_LOSS.handle)}


def _floats(x: _torch.Tensor, name: str, cuda: bool = _ON_CUDA) -> _torch.Tensor:
    """A tensor of float32 or float64, on the CPU or where CUDA is allowed."""
    if not isinstance(x, _torch.Tensor):
        raise ValueError(f"{name} must be a tensor, found {type(x).__name__}: convert it with torch.as_tensor")
    if x.device.type != "cpu" and not (cuda and x.device.type == "cuda"):
        raise ValueError(f"{name} must lie on the CPU, found {x.device}: move it with cpu()")
    if x.dtype in _HALVES:
        return x.float()
    if x.dtype not in (_torch.float32, _torch.float64):
        raise ValueError(f"{name} must be float32 or float64, found {x.dtype}: convert it with to()")
    return x


def orbit(distance: _Number, elevation_deg: _Number = 0.0, azimuth_deg: _Number = 0.0, fov_deg: _Number = 60.0) -> _torch.Tensor:
    """Cameras `[views, 4]` that look at the origin: distance in world units, angles and whole field of view in degrees.

    Numbers, or tensors `[]` or `[views]`, of which the result has the float type; float64 if all are numbers. See `softrast.orbit`.
    """
    numbers = [distance, elevation_deg, azimuth_deg, fov_deg]
    given = [x for x in numbers if isinstance(x, _torch.Tensor)]
    types, device = [x.dtype for x in given if x.is_floating_point()], given[0].device if given else None
    dtype = _torch.float64 if not types or _torch.float64 in types else types[0]
    tensors = _torch.broadcast_tensors(*(_torch.atleast_1d(_torch.as_tensor(x, dtype=dtype, device=device)) for x in numbers))
    return _torch.stack(tensors, -1)


def pinhole(
    K: _torch.Tensor, R: _torch.Tensor, t: _torch.Tensor, size: _softrast._Size, convention: str = "opencv",
) -> _torch.Tensor:
    """Cameras `[views, 3, 4]` of matrices `K` and poses `R`, `t`, differentiable in all three; see `softrast.pinhole`."""
    R = _floats(R, "R")
    K, t = (_floats(x, name).to(R) for x, name in ((K, "K"), (t, "t")))
    return _cameras.pinhole(_torch, K, R, t, size, convention)


def project(vertices: _torch.Tensor, cameras: _torch.Tensor) -> _torch.Tensor:
    """World vertices `[V, 3]` or `[1 or views, V, 3]` as cameras see them, `[views, V, 3]`: x and y in NDC, depth in world units.

    `cameras` are orbits `[1 or views, 4]` or matrices `[1 or views, 3, 4]`; see `softrast.project`.
    """
    vertices, cameras = _floats(vertices, "vertices"), _floats(cameras, "cameras")
    vertices = vertices[None] if vertices.dim() == 2 else vertices
    views = _shapes.project(vertices.shape, cameras.shape)
    cameras = cameras.to(vertices)
    if cameras.dim() == 2:
        cameras = _ops.value("orbit_matrix", _ORBIT_MATRIX, [cameras])[0]
    cameras = cameras.expand(views, 3, 4)
    return _ops.value("project", _PERSPECTIVE, [vertices, cameras])[0].transpose(1, 2)


def from_clip(clip: _torch.Tensor, size: _softrast._Size) -> _torch.Tensor:
    """Vertices in clip space `[views, V, 4]` (x, y, z, w, as for OpenGL and nvdiffrast) as `silhouette` takes them, `[views, V, 3]`.

    `size` is that of the image, as in `Renderer`: clip space has [-1, 1] along both sides, NDC here along the shorter one. The depth is w, so
    w must be that of a perspective projection: the depth ahead of the camera. Images have their top row first, those of nvdiffrast the bottom
    row.
    """
    clip = _floats(clip, "clip")
    if clip.dim() != 3 or clip.shape[2] != 4 or clip.shape[0] == 0:
        raise ValueError(f"clip must be [views, V, 4] with at least one view, found {list(clip.shape)}")
    height, width = _shapes.size(size)
    shorter = min(height, width)
    # A vertex behind the camera is projected as though it were near, so that nothing divides by zero; its faces are not drawn.
    w = clip[..., 3]
    over = 1.0 / w.clamp_min(_NEAR)
    return _torch.stack([clip[..., 0] * over * (width / shorter), clip[..., 1] * over * (height / shorter), w], -1)


def _scene(
    renderer: _softrast.Renderer, vertices: _torch.Tensor, phi: _Optional[_torch.Tensor],
) -> _Tuple[str, _List[_torch.Tensor]]:
    """The name of a renderer's function and its inputs: vertices `[views, 3, V]` and, if it is given, φ."""
    vertices = _floats(vertices, "vertices")
    _shapes.vertices(vertices.shape, renderer._least)
    inputs = [vertices.transpose(1, 2).contiguous()]
    if phi is None:
        return renderer._by_own_name, inputs
    phi = _floats(phi, "phi")
    _shapes.parameters("phi", phi.shape, renderer._parameters)
    # On the CPU φ may be of any type.
    return renderer._by_phi_name, [*inputs, phi.to("cpu", _torch.float64) if vertices.is_cuda else phi.cpu()]


def silhouette(renderer: _softrast.Renderer, vertices: _torch.Tensor, phi: _Optional[_torch.Tensor] = None) -> _torch.Tensor:
    """Coverage `[views, height, width]` in [0, 1] of projected `vertices` `[views, V, 3]`, under φ `[P]` or the renderer's own.

    Support and knots follow the values of φ. The table of φ is computed in float64 and rounded to the type of the vertices. Where the softness
    has a surrogate, the gradient to the vertices is that of the surrogate, and the gradient to φ is 0.
    """
    name, inputs = _scene(renderer, vertices, phi)
    return _ops.value_alone("silhouette", name, inputs)


def silhouettes(
    renderers: _Sequence[_softrast.Renderer], vertices: _Sequence[_torch.Tensor], *, packed: bool = False,
) -> _torch.Tensor:
    """Coverage of several meshes, each with its renderer and its projected vertices `[views, V, 3]`; all images are of one size.

    `[meshes, views, height, width]` with zeros behind the views of a mesh that has fewer than others, or `[all views, height, width]` if
    `packed`. Raises `ValueError` if there is no mesh, or numbers of renderers and vertices or sizes of images differ.
    """
    _meshes(renderers, vertices)
    return _joined([silhouette(renderer, corners) for renderer, corners in zip(renderers, vertices)], packed)


def blends(
    renderers: _Sequence[_softrast.ColourRenderer], vertices: _Sequence[_torch.Tensor], attributes: _Sequence[_torch.Tensor],
    background: _Number = 0.0, *, packed: bool = False,
) -> _torch.Tensor:
    """Soft colours of several meshes, each with its renderer, its projected vertices `[views, V, 3]` and its attributes as `blend` takes them.

    `[meshes, views, channels + 1, height, width]` with zeros behind the views of a mesh that has fewer than others, or `[all views, channels +
    1, height, width]` if `packed`. All have the same `background`. Raises `ValueError` as `silhouettes` does, and if numbers of channels differ.
    """
    _meshes(renderers, vertices)
    if len(attributes) != len(vertices) or len({of.shape[-1] for of in attributes}) > 1:
        found = [list(of.shape) for of in attributes]
        raise ValueError(f"attributes must be one tensor for each of the {len(vertices)} meshes, of as many channels, found {found}")
    return _joined([blend(*mesh, background) for mesh in zip(renderers, vertices, attributes)], packed)


def _meshes(renderers: _Sequence[_Any], vertices: _Sequence[_torch.Tensor]) -> None:
    if len(renderers) != len(vertices) or not renderers or len({renderer.size for renderer in renderers}) > 1:
        sizes = [renderer.size for renderer in renderers]
        raise ValueError(f"there must be a renderer for each mesh, of one size, found {len(vertices)} meshes and renderers of {sizes}")


def _joined(images: _List[_torch.Tensor], packed: bool) -> _torch.Tensor:
    return _torch.cat(images) if packed else _torch.nn.utils.rnn.pad_sequence(images, batch_first=True)


def hard_silhouette(vertices: _torch.Tensor, faces: _softrast._ArrayLike, size: _softrast._Size) -> _torch.Tensor:
    """1 where the centre of a pixel lies in a face, else 0: `[views, height, width]` of projected `vertices` `[views, V, 3]`, no gradient.

    `faces` are `[F, 3]`, an array or a tensor; `size` is a number of pixels, or `(height, width)`.
    """
    vertices = _floats(vertices, "vertices", cuda=False)
    return _torch.from_numpy(_softrast.hard_silhouette(vertices.detach().contiguous().numpy(), faces, size)).to(vertices.dtype)


def mse_loss(image: _torch.Tensor, target: _torch.Tensor) -> _torch.Tensor:
    """Mean squared difference of each view, `[views]`, of an `image` `[views, height, width]` and a `target` `[1 or views, height, width]`."""
    return _loss("mse", image, target)


def iou_loss(image: _torch.Tensor, target: _torch.Tensor) -> _torch.Tensor:
    """One less the overlap over the union of each view, `[views]` in [0, 1]: `1 - sum(p t) / (sum(p + t - p t) + 1e-6)`.

    Both images are coverages in [0, 1], of the shapes of `mse_loss`. Two empty images have the loss 1.
    """
    return _loss("iou", image, target)


def _known(loss: str) -> None:
    if loss not in _LOSSES:
        raise ValueError(f"loss must be one of {', '.join(_LOSSES)}, found {loss!r}")


def _loss(name: str, image: _torch.Tensor, target: _torch.Tensor) -> _torch.Tensor:
    image, target = _floats(image, "image"), _floats(target, "target")
    _shapes.images(image.shape, target.shape)
    kind, handle = _LOSSES[name]
    return _ops.value(kind, handle, [image, target.to(image)])[0]


def silhouette_loss(
    renderer: _softrast.Renderer, vertices: _torch.Tensor, target: _torch.Tensor, loss: str = "mse", phi: _Optional[_torch.Tensor] = None,
) -> _torch.Tensor:
    """Losses `[views]` of the `silhouette` against a `target` `[1 or views, height, width]`; `loss` is "mse" or "iou".

    They are those of `mse_loss` and `iou_loss` of the image, to the renderer's tolerance. Under the renderer's own φ, with the probabilistic sum and without a
    surrogate, one op computes image, loss and gradient to the vertices: a step takes 0.7 to 0.85 of its time with two ops.
    """
    _known(loss)
    name, inputs = _scene(renderer, vertices, phi)
    if phi is not None or loss not in renderer._loss_names:
        return _loss(loss, _ops.value_alone("silhouette", name, inputs), target)
    return _ops.value_alone("silhouette_loss", *_loss_scene(renderer, inputs[0], target, loss))


def _loss_scene(
    renderer: _softrast.Renderer, vertices: _torch.Tensor, target: _torch.Tensor, loss: str,
) -> _Tuple[str, _List[_torch.Tensor]]:
    """The name of a renderer's loss and its inputs: vertices `[views, 3, V]` and the target."""
    target = _floats(target, "target")
    _shapes.images((vertices.shape[0], *renderer._size), target.shape)
    return renderer._loss_names[loss], [vertices, target.to(vertices)]


def jvp(
    renderer: _softrast.Renderer, vertices: _torch.Tensor, direction: _torch.Tensor, phi: _Optional[_torch.Tensor] = None,
    phi_direction: _Optional[_torch.Tensor] = None,
) -> _Tuple[_torch.Tensor, _torch.Tensor]:
    """The `silhouette` and its derivative along a `direction` `[views, V, 3]` of the vertices and `[P]` of φ, both `[views, height, width]`.

    Both have first derivatives, under `torch.compile` too.
    """
    name, inputs = _scene(renderer, vertices, phi)
    directions = [_along(direction, vertices).transpose(1, 2)]
    if phi is not None:
        directions.append(None if phi_direction is None else _floats(phi_direction, "phi_direction").to(inputs[1]))
    image, *kept = _ops.value("silhouette", name, inputs)
    return image, _ops.jvp("silhouette", name, inputs, kept, directions)


def value_and_grad(
    renderer: _softrast.Renderer, vertices: _torch.Tensor, target: _torch.Tensor, loss: str = "mse", phi: _Optional[_torch.Tensor] = None,
) -> _Tuple[_torch.Tensor, _torch.Tensor]:
    """Losses `[views]` of the `silhouette` against a `target` `[1 or views, height, width]`, and their gradient `[views, V, 3]` to the vertices.

    `loss` is "mse" or "iou". Both results have first derivatives, under `torch.compile` too, which cannot differentiate a backward pass.
    """
    losses, gradient, _ = _judged(renderer, vertices, target, loss, phi, None)
    return losses, gradient


def hvp(
    renderer: _softrast.Renderer, vertices: _torch.Tensor, target: _torch.Tensor, direction: _torch.Tensor, loss: str = "mse",
    phi: _Optional[_torch.Tensor] = None,
) -> _Tuple[_torch.Tensor, _torch.Tensor, _torch.Tensor]:
    """Losses and gradient as `value_and_grad` has them, and the product `[views, V, 3]` of the Hessian by the vertices with a `direction`.

    `direction` is `[views, V, 3]`. The results have no derivatives.
    """
    with _torch.no_grad():
        return _judged(renderer, vertices, target, loss, phi, direction)


def _along(direction: _torch.Tensor, vertices: _torch.Tensor) -> _torch.Tensor:
    direction = _floats(direction, "direction")
    if direction.shape != vertices.shape:
        raise ValueError(f"direction must be {list(vertices.shape)} as the vertices are, found {list(direction.shape)}")
    return direction.to(_floats(vertices, "vertices"))


def _judged(renderer, vertices, target, loss, phi, direction):
    """Losses, their gradient and, along a direction, its change."""
    _known(loss)
    kind, handle = _LOSSES[loss]
    name, inputs = _scene(renderer, vertices, phi)
    if direction is None and phi is None and loss in renderer._loss_names:
        name, inputs = _loss_scene(renderer, inputs[0], target, loss)
        losses, *kept = _ops.value("silhouette_loss", name, inputs)
        (gradient,) = _ops.vjp("silhouette_loss", name, inputs, kept, _torch.ones_like(losses), [True, False])
        return losses, gradient.transpose(1, 2), None
    wanted = [True, *[False] * (len(inputs) - 1)]
    image, *kept = _ops.value("silhouette", name, inputs)
    target = _floats(target, "target").to(image)
    _shapes.images(image.shape, target.shape)
    pair = [image, target]
    (losses,) = _ops.value(kind, handle, pair)
    each = _torch.ones_like(losses)
    (by_image,) = _ops.vjp(kind, handle, pair, [], each, [True, False])
    (gradient,) = _ops.vjp("silhouette", name, inputs, kept, by_image, wanted)
    if direction is None:
        return losses, gradient.transpose(1, 2), None
    along = [_along(direction, vertices).transpose(1, 2).contiguous(), *[None] * (len(inputs) - 1)]
    moved = _ops.jvp("silhouette", name, inputs, kept, along)
    (bent,) = _ops.vjp_of_vjp(kind, handle, pair, [], each, [moved, None], [True, False, False])
    (first,) = _ops.vjp("silhouette", name, inputs, kept, bent, wanted)
    (second,) = _ops.vjp_of_vjp("silhouette", name, inputs, kept, by_image, along, [*wanted, False])
    return losses, gradient.transpose(1, 2), (first + second).transpose(1, 2)


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
    vertices, attributes = _floats(vertices, "vertices"), _floats(attributes, "attributes")
    _shapes.vertices(vertices.shape, renderer._least)
    attributes = attributes[None] if attributes.dim() == 2 else attributes
    texture = None if texture is None else _floats(texture, "texture").to(vertices)
    least, name = renderer._least, renderer._plain_name
    if corners is not None or texture is not None:
        corners = None if corners is None else _shapes.faces(corners, "corners")
        least = least if corners is None else corners.max(initial=-1) + 1
        name = renderer._blend(corners, None if texture is None else (texture.shape[0], texture.shape[1])).handle
    channels = _shapes.attributes(attributes.shape, vertices.shape[0], least, None if texture is None else tuple(texture.shape))
    background = _number(background, "background", vertices)
    _shapes.background(background.shape, channels)
    log_weight = _number(renderer._log_weight if log_weight is None else log_weight, "log_weight", vertices)
    if log_weight.numel() != 1:
        raise ValueError(f"log_weight must be a number or [1], found {list(log_weight.shape)}")
    both = []
    for x, own, of in ((phi, renderer._phi[0], "phi"), (phi_depth, renderer._phi[1], "phi_depth")):
        x = _torch.tensor(own, dtype=_torch.float64) if x is None else _floats(x, of).to("cpu", _torch.float64)
        _shapes.parameters(of, x.shape, len(own))
        both.append(x)
    behind = _torch.cat([background.expand(channels), log_weight.reshape(1)])
    inputs = [vertices.transpose(1, 2).contiguous(), attributes.to(vertices), _torch.cat(both), behind]
    if texture is not None:
        inputs.append(_torch.nn.functional.pad(texture.reshape(-1, channels), (0, 4 - channels)))
    return _ops.value("blend", name, inputs)[0]


def _number(x: _Number, name: str, like: _torch.Tensor) -> _torch.Tensor:
    return _floats(x, name).to(like) if isinstance(x, _torch.Tensor) else _torch.tensor(x, dtype=like.dtype, device=like.device)
